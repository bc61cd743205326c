# SPDX-License-Identifier: Apache-2.0
"""Build the project's site with Sphinx: `make site` puts it into build/site.

Any warning is an error: a broken link, a page that no other links to.
"""

import shutil
import sys
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import SphinxError

from site_pages import ROOT, SiteError, pages, version

SETTINGS = {
    "project": "Ares",
    "author": "",
    "project_copyright": "",
    "html_title": "Ares: ascent guidance on ROS 2",
    "extensions": ["myst_parser"],
    "myst_heading_anchors": 4,
    "html_theme": "furo",
    "html_show_copyright": False,
    "html_show_sphinx": False,
    "version": version(),
    "templates_path": [str(ROOT / "tools" / "site")],
    "html_static_path": [str(ROOT / "tools" / "site" / "site.css")],
    "html_css_files": ["site.css"],
    "html_copy_source": False,
}


def build(folder: Path) -> None:
    """Write the pages' sources and build the site.

    Args:
        folder: of the site; its parent also gets `site_source` and `site_doctrees`.

    Raises:
        SiteError: a link is broken.
        SphinxError: a page is invalid; the text names it.
    """
    source = folder.with_name(f"{folder.name}_source")
    shutil.rmtree(source, ignore_errors=True)
    for name, text in pages().items():
        path = source / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    shutil.copytree(ROOT / "docs" / "images", source / "images")
    doctrees = folder.with_name(f"{folder.name}_doctrees")
    shutil.rmtree(folder, ignore_errors=True)
    app = Sphinx(
        source,
        None,
        folder,
        doctrees,
        "html",
        confoverrides=SETTINGS,
        status=None,
        freshenv=True,
        warningiserror=True,
        exception_on_warning=True,
    )
    app.build(force_all=True)
    for page in folder.rglob("*.html"):
        page.write_text(reachable(page.read_text()))


def reachable(page: str) -> str:
    """Add to a page what the theme lacks for keyboards and screen readers."""
    named = page.replace('role="heading"', 'role="heading" aria-level="2"')
    tables = named.replace('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper')
    return tables.replace("<pre>", '<pre tabindex="0">')


def main() -> int:
    """Build the site; return the exit status."""
    folder = Path(sys.argv[1]).absolute() if sys.argv[1:] else ROOT / "build" / "site"
    try:
        build(folder)
    except (SiteError, SphinxError) as error:
        print(f"site: {error}", file=sys.stderr)
        return 1
    print(f"site: {folder / 'index.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

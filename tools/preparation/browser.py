# SPDX-License-Identifier: Apache-2.0
"""Find a browser for the tests, or install one."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from preparation.layout import Workspace
from preparation.progress import BAR, Steps, say
from preparation.running import WorkspaceError, announce, preparation_lock, run_logged

#: Step of the installation, with its duration on an idle machine of two cores, s.
BROWSER, BROWSER_LENGTH = "a browser", 15.0
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
NO_BROWSER = (
    f"no browser found ({', '.join(BROWSERS)}), which the tests of the page of `ares reproduce`"
    " need: install one, for example `apt install chromium`"
)


def find_browser(environ: Mapping[str, str]) -> str | None:
    """Return the path of the first browser found."""
    path = environ.get("PATH", os.defpath)
    return next(filter(None, (shutil.which(name, path=path) for name in BROWSERS)), None)


def debian_packages(root: Path) -> list[str]:
    """Return the names in requirements/apt.list."""
    lines = (root / "requirements" / "apt.list").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def install_browser(workspace: Workspace, environ: Mapping[str, str]) -> None:
    """Print what to install if no browser is found; as root, install it."""
    if find_browser(environ):
        return
    if os.geteuid() != 0 or not shutil.which("apt-get", path=environ.get("PATH", os.defpath)):
        say(NO_BROWSER)
        return
    say("installing a browser for the tests (once, a quarter of a minute)")
    settings = dict(environ) | {"DEBIAN_FRONTEND": "noninteractive"}
    install = ["install", "-y", "--no-install-recommends", *debian_packages(workspace.root)]
    steps = Steps({BROWSER: BROWSER_LENGTH})
    with preparation_lock(workspace.root) as lock, BAR.over(steps), steps.step(BROWSER):
        announce(lock, {BROWSER: BROWSER_LENGTH})
        try:
            for arguments in (["update"], install):
                command = ["apt-get", *arguments]
                run_logged(command, workspace, settings, lock, "installing a browser")
        except WorkspaceError as problem:
            say(f"{problem}; {NO_BROWSER}")

# SPDX-License-Identifier: Apache-2.0
"""Cache folder of compiled kernels, one per state of their sources.

numba compiles called kernels and constants into a kernel, but its own cache checks only the
kernel's file. Standard library only: the preparation of a workspace loads this file before any
package is installed.
"""

import hashlib
import os
import pkgutil
import re
import shutil
import stat
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from importlib.machinery import FileFinder
from pathlib import Path

#: Environment variable of numba's cache folder; a value set by the user has priority.
VARIABLE = "NUMBA_CACHE_DIR"
#: Environment variable that leaves numba's private parts out, if it is 1.
PLAIN_VARIABLE = "ARES_PLAIN_NUMBA"
#: Folder in the cache of what is compiled without them.
PLAIN_FOLDER = "plain"
#: Prefix of packages whose modules can hold kernels.
PREFIX = "ares_"
#: Age at which unused folders of other states are removed, s.
KEPT = 30 * 86400.0

_KERNEL = re.compile(r"^@kernel\b", re.MULTILINE)
_FROM = re.compile(r"^from[ \t]+([.\w]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)", re.MULTILINE)
_IMPORT = re.compile(r"^import[ \t]+([.\w]+)", re.MULTILINE)


def state_of(texts: Mapping[str, str]) -> str:
    """Compute the digest of the modules with kernels and all modules that they import.

    Args:
        texts: source by full name of the module; imports of other modules are ignored.
    """
    waiting = [name for name, text in texts.items() if _KERNEL.search(text)]
    seen: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name in seen or name not in texts:
            continue
        seen.add(name)
        for source, imported in _FROM.findall(texts[name]):
            module = _absolute(source, name, texts)
            waiting += [module, *(f"{module}.{word}" for word in re.findall(r"\w+", imported))]
        waiting += _IMPORT.findall(texts[name])
    state = hashlib.sha256()
    for name in sorted(seen):
        for part in (name, texts[name]):
            raw = part.encode()
            state.update(b"%d:" % len(raw) + raw)
    return state.hexdigest()[:16]


def _absolute(source: str, importer: str, modules: Mapping[str, str]) -> str:
    """Resolve a relative import such as ``..arrays`` in the importing module."""
    dots = len(source) - len(source.lstrip("."))
    if not dots:
        return source
    parts = importer.split(".")
    is_package = any(name.startswith(importer + ".") for name in modules)
    base = parts[: len(parts) - dots + is_package]
    return ".".join([*base, *filter(None, [source[dots:]])])


def read_package(folder: Path) -> dict[str, str]:
    """Read the sources of a package, by full name of the module."""
    texts = {}
    for path in folder.rglob("*.py"):
        relative = path.relative_to(folder.parent).with_suffix("")
        parts = relative.parts[:-1] if relative.name == "__init__" else relative.parts
        texts[".".join(parts)] = path.read_text(encoding="utf-8")
    return texts


def installed_packages() -> list[Path]:
    """Find the folders of installed packages that can hold kernels; the first of a name counts."""
    found = {
        entry.name: Path(entry.module_finder.path, entry.name)
        for entry in reversed(list(pkgutil.iter_modules()))
        if entry.ispkg
        and entry.name.startswith(PREFIX)
        and isinstance(entry.module_finder, FileFinder)
    }
    return sorted(found.values())


def private_folder() -> Path:
    """Find a folder for files of the project that this user, and no other, can write."""
    user = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    for folder in (Path(user, "ares"), Path(tempfile.gettempdir(), f"ares-{os.getuid()}")):
        with suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            status = folder.stat()
            mine = status.st_uid == os.getuid() and not status.st_mode & stat.S_IWOTH
            if mine and os.access(folder, os.W_OK | os.X_OK):
                return folder
    return Path(tempfile.mkdtemp(prefix="ares-"))


def choose_folder() -> Path:
    """Create the cache folder for the present state of the installed sources, and return it."""
    texts: dict[str, str] = {}
    for package in installed_packages():
        texts |= read_package(package)
    folder = private_folder() / "kernels" / state_of(texts)
    folder.mkdir(parents=True, exist_ok=True)
    with suppress(OSError):
        os.utime(folder)
        for other in folder.parent.iterdir():
            if time.time() - other.stat().st_mtime > KEPT:
                shutil.rmtree(other, ignore_errors=True)
    return folder


def is_plain() -> bool:
    """Return whether kernels are compiled by numba's public interface alone."""
    return os.environ.get(PLAIN_VARIABLE) == "1"


def cache_folder() -> Path:
    """Return numba's cache folder: the user's, or that of the present state of the sources."""
    folder = Path(os.environ.get(VARIABLE) or choose_folder())
    return folder / PLAIN_FOLDER if is_plain() and folder.name != PLAIN_FOLDER else folder

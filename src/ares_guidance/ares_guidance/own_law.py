# SPDX-License-Identifier: Apache-2.0
"""Report an error in a law of another package in one line."""

import ast
import re
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TypeGuard

from ares_guidance.registry import GROUP
from ares_models.kernel_cache import PREFIX
from ares_models.registry import registered

#: Lines in which numba names the stage at which it failed, once per caller.
_STAGE = "Failed in "
_PLACE = re.compile(r'File "([^"]+)", line (\d+)')
_NAME = re.compile(r"name '(\w+)'|'(\w+)'$")


@contextmanager
def one_line_each(name: str) -> Iterator[None]:
    """Convert exceptions of a law of another package, compiled or called, to ValueError.

    A ValueError stays as it is; so does what a law of this project raises, which is a defect.

    Args:
        name: of the law.

    Raises:
        ValueError: one line: law, file and line as far as it is known, and the error.
    """
    try:
        yield
    except ValueError:
        raise
    except Exception as error:
        entry = registered(GROUP).get(name)
        package = entry.module.partition(".")[0] if entry else PREFIX
        if package.startswith(PREFIX):
            raise
        files = _files(package)
        path, line = _place(error, files) or (files[0], 0)
        where = f"{path}, line {line}" if line else f"{path}"
        raise ValueError(f"law {name} fails in {where}: {_text(error)}") from error


def _files(package: str) -> list[Path]:
    """Return the sources of a package or of a single-file module."""
    spec = find_spec(package)
    assert spec is not None and spec.origin is not None
    origin = Path(spec.origin).resolve()
    return sorted(origin.parent.rglob("*.py")) if origin.name == "__init__.py" else [origin]


def _place(error: Exception, files: list[Path]) -> tuple[Path, int] | None:
    """Return file and line of an error: where numba or Python tells, else of the name it tells."""
    if isinstance(error, SyntaxError):
        return Path(str(error.filename)), error.lineno or 0
    told = [(Path(path).resolve(), int(line)) for path, line in _PLACE.findall(str(error))]
    frames = [(Path(f.filename), f.lineno or 0) for f in traceback.extract_tb(error.__traceback__)]
    for path, line in (*told, *reversed(frames)):
        if path in files:
            return path, line
    found = _NAME.search(_text(error))
    name = (found[1] or found[2]) if found else None
    for path in files:
        tree = ast.walk(ast.parse(path.read_text("utf-8")))
        if lines := [node.lineno for node in tree if _uses(node, name)]:
            return path, min(lines)
    return None


def _uses(node: ast.AST, name: str | None) -> TypeGuard[ast.Name | ast.Attribute]:
    """Return whether a part of a source reads a variable or an attribute of a name."""
    if isinstance(node, ast.Name):
        return node.id == name and isinstance(node.ctx, ast.Load)
    return isinstance(node, ast.Attribute) and node.attr == name


def _text(error: Exception) -> str:
    """Return an error's own line, without the path that numba took to it."""
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__}: {error.msg}"
    lines = [line.strip(" >") for line in str(error).splitlines()]
    lines = [line for line in lines if line and not line.startswith(_STAGE)] or [""]
    text = " ".join(lines[: 1 + lines[0].endswith(":")])
    of_numba = type(error).__module__.startswith("numba.")
    return text if of_numba else f"{type(error).__name__}: {text}"

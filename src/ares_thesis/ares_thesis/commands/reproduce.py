# SPDX-License-Identifier: Apache-2.0
"""Write the reproduction for `ares reproduce`. No ROS."""

import tempfile
from contextlib import suppress
from pathlib import Path

from ares_bringup.options import CannotStart
from ares_bringup.progress import bar
from ares_bringup.report import shown_path
from ares_bringup.whole_file import write_all
from ares_models.mission import MissionError
from ares_optimizer.solution import OptimizerError
from ares_thesis.reproduce.page import dump, render
from ares_thesis.reproduce.report import make_report, parts

PAGE = "reproduction.html"
DATA = "reproduction.json"


def reproduce(out: Path) -> None:
    """Compute the thesis' tables and figures and write the page and the JSON file.

    Args:
        out: folder of the two files; made if missing.

    Raises:
        CannotStart: the folder cannot be used, or a result is missing; one line.
    """
    made = not out.exists()
    _check(out)
    try:
        _write(out)
    except BaseException:
        if made:
            # fails, and is ignored, if the folder holds other files
            with suppress(OSError):
                out.rmdir()
        raise


def _write(out: Path) -> None:
    names = parts()
    with bar() as progress:
        task = progress.add_task("", total=len(names))
        left = iter(range(len(names)))
        try:
            report = make_report(
                lambda name: progress.update(task, description=name, completed=next(left))
            )
        except (MissionError, OptimizerError) as error:
            raise CannotStart(f"a result is missing: {error}") from error
        progress.update(task, description="done", completed=len(names))
    data = dump(report)
    write_all(out, {PAGE: render(report, data, DATA).encode(), DATA: data.encode()})
    for name in (PAGE, DATA):
        size = (out / name).stat().st_size / 1e6
        print(f"{shown_path(str(out / name))}  ({size:.1f} MB)")


def _check(out: Path) -> None:
    """Check, before the work, that the folder can be written."""
    if out.exists() and not out.is_dir():
        raise CannotStart(f"--out is {str(out)!r}, which is a file; expected a folder")
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise CannotStart(
            f"--out is {str(out)!r}, which cannot be written: {error.strerror}"
        ) from error

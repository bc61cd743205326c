# SPDX-License-Identifier: Apache-2.0
"""Write files atomically. No ROS."""

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path

from ares_bringup.commands.interrupts import note_written
from ares_bringup.options import CannotStart


def write_whole(out: Path, content: bytes) -> None:
    """Write the file of `--out` atomically, by way of a temporary name.

    Raises:
        CannotStart: it cannot be written; one line.
    """
    _write(out, {out: content})


def write_all(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write files, by name, in the folder of `--out`; remove temporary files on failure.

    Raises:
        CannotStart: one cannot be written; one line.
    """
    _write(folder, {folder / name: content for name, content in contents.items()})


def _write(out: Path, contents: Mapping[Path, bytes]) -> None:
    partial = {path.with_name(f".{path.name}.partial"): path for path in contents}
    try:
        for part, path in partial.items():
            part.write_bytes(contents[path])
        for part, path in partial.items():
            os.replace(part, path)
            note_written(str(path))
    except OSError as error:
        raise CannotStart(
            f"--out is {str(out)!r}, which cannot be written: {error.strerror}"
        ) from error
    finally:
        for part in partial:
            with contextlib.suppress(OSError):
                part.unlink()

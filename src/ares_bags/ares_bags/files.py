# SPDX-License-Identifier: Apache-2.0
"""Find the files of a bag: one in our bags, possibly several in those of `ros2 bag record`."""

import re
from pathlib import Path
from typing import Any

from ares_bags.errors import BagError, cause
from ares_bags.metadata import METADATA_FILE, read_metadata_file

#: Suffix of a file that rosbag2 has compressed as a whole.
PACKED = ".zstd"
_SPLIT = re.compile(r"(.*)_(\d+)\.mcap(?:\.zstd)?")


def find_files(path: Path | str) -> list[Path]:
    """Return the MCAP files of a bag in the order of recording.

    Args:
        path: the bag's folder, its `metadata.yaml`, or a single MCAP file.

    Raises:
        BagError: there is none, its storage is not MCAP, or the files belong to different bags.
    """
    path = Path(path)
    if path.name == METADATA_FILE:
        path = path.parent
    try:
        path.stat()
    except FileNotFoundError:
        raise BagError(f"bag {path} does not exist") from None
    except (OSError, ValueError) as error:
        raise BagError(f"bag {path} cannot be read: {cause(error)}") from error
    if path.is_file():
        if path.suffix == ".db3":
            raise _of_sqlite(path)
        return [path]
    if not path.is_dir():
        raise BagError(f"bag {path} is neither a file nor a folder")
    return _listed(path) or _found(path)


def find_file(path: Path | str) -> Path:
    """Return the MCAP file of a bag, the first if there are several; raise as `find_files`."""
    return find_files(path)[0]


def _of_sqlite(path: Path) -> BagError:
    return BagError(
        f"bag {path} is kept by sqlite3, expected mcap: rosbags-convert --src {path} "
        "--dst NEW --dst-storage mcap makes one"
    )


def _listed(folder: Path) -> list[Path]:
    """Return the files named by `metadata.yaml`; none if it, or one of them, cannot be used."""
    try:
        information = read_metadata_file(folder / METADATA_FILE)
    except (OSError, ValueError):
        return []
    _check_storage(folder, information)
    names = information.get("relative_file_paths")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return []
    files = [folder / name for name in names]
    if not all(file.is_file() for file in files):
        return []
    if len(there := _mcap_files(folder)) > len(files):
        raise _too_many(folder, len(there), len(files))
    return files


def _mcap_files(folder: Path) -> list[Path]:
    return sorted([*folder.glob("*.mcap"), *folder.glob(f"*.mcap{PACKED}")])


def _too_many(folder: Path, count: int, expected: int) -> BagError:
    return BagError(
        f"{folder} is not a bag: it holds {count or 'no'} .mcap files; expected "
        f"{'one' if expected == 1 else expected}"
    )


def _check_storage(folder: Path, information: dict[str, Any]) -> None:
    if information.get("storage_identifier") == "sqlite3":
        raise _of_sqlite(folder)
    if str(information.get("compression_mode", "")).upper() == "MESSAGE":
        raise BagError(
            f"bag {folder} has each message compressed by itself (compression_mode MESSAGE), which "
            "is not read here; `ros2 bag convert` with compression_mode NONE makes one that is"
        )


def _found(folder: Path) -> list[Path]:
    """Return the files of a folder without a usable `metadata.yaml`, ordered by number."""
    files = _mcap_files(folder)
    if not files and any(folder.glob("*.db3")):
        raise _of_sqlite(folder)
    parts = [_SPLIT.fullmatch(file.name) for file in files]
    names = {part[1] for part in parts if part}
    if len(files) > 1 and all(parts) and len(names) == 1:
        return sorted(files, key=lambda file: int(_SPLIT.fullmatch(file.name)[2]))  # type: ignore[index]
    if len(files) != 1:
        raise _too_many(folder, len(files), 1)
    return files

# SPDX-License-Identifier: Apache-2.0
"""Measure the time from a fresh clone to the end of the first flight, with empty caches, by part.

    python3 benchmarks/first_flight.py [TARGET]

Needs git, make, a compiler and a network. Clones this repository into a temporary folder and runs
`make TARGET` (default fly) there. Standard library only.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: Lines that begin a part.
MARKS = re.compile(r"^(ares: .*|flight [0-9a-f]{16}: .*|=+ test session starts =+)$")


def size_mb(folder: Path) -> float:
    """Return the disk space of the files below a folder, each counted once, MB."""
    files = {}
    for path in folder.rglob("*"):
        if path.is_file() and not path.is_symlink():
            status = path.stat()
            files[status.st_ino] = status.st_blocks * 512
    return sum(files.values()) / 1e6


def main() -> int:
    """Print the begin of each part, the total time, and the disk space."""
    target = sys.argv[1] if sys.argv[1:] else "fly"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        clone = folder / "clone"
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        caches = {key: str(folder / key) for key in ("UV_CACHE_DIR", "PIP_CACHE_DIR")}
        begun = time.monotonic()
        run = subprocess.Popen(
            ["make", "--no-print-directory", target],
            cwd=clone,
            env={**os.environ, **caches, "XDG_CACHE_HOME": str(folder / "cache")},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert run.stdout is not None
        for line in run.stdout:
            if MARKS.match(line.rstrip()):
                print(f"{time.monotonic() - begun:7.1f} s  {line.rstrip()[:90]}", flush=True)
        status = run.wait()
        print(f"{time.monotonic() - begun:7.1f} s  over, exit status {status}")
        print(f"{size_mb(clone):7.0f} MB in the clone")
    return status


if __name__ == "__main__":
    sys.exit(main())

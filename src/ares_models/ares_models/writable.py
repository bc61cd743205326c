# SPDX-License-Identifier: Apache-2.0
"""Check before long work that its results can be kept."""

import os
import tempfile
from pathlib import Path


def check_folder(folder: Path) -> None:
    """Check that files can be made in a folder, or in the first that exists above it; leave none.

    Raises:
        OSError: they cannot.
    """
    there = folder.absolute()
    while not os.path.lexists(there):
        there = there.parent
    with tempfile.TemporaryFile(dir=there):
        pass

# SPDX-License-Identifier: Apache-2.0
"""Let all tests share the plans of the flights that they start; collect no garbage too early."""

import gc
import os
from tempfile import TemporaryDirectory

import pytest

from ares_optimizer.registry import SHARED_SOLUTIONS

# what is imported and collected stays: to look for garbage in it takes a fifth of that time
gc.disable()


def pytest_collection_finish() -> None:
    """Look for garbage from now on, but not in what has been collected."""
    gc.freeze()
    gc.enable()


def pytest_configure(config: pytest.Config) -> None:
    """Name a folder for the workers and all processes that they start."""
    if SHARED_SOLUTIONS not in os.environ:
        folder = TemporaryDirectory(prefix="ares_solutions_", ignore_cleanup_errors=True)
        os.environ[SHARED_SOLUTIONS] = folder.name
        config.add_cleanup(folder.cleanup)

# SPDX-License-Identifier: Apache-2.0
"""Let all tests share the plans of the flights that they start."""

import os
from tempfile import TemporaryDirectory

import pytest

from ares_optimizer.registry import SHARED_SOLUTIONS


def pytest_configure(config: pytest.Config) -> None:
    """Name a folder for the workers and all processes that they start."""
    if SHARED_SOLUTIONS not in os.environ:
        folder = TemporaryDirectory(prefix="ares_solutions_", ignore_cleanup_errors=True)
        os.environ[SHARED_SOLUTIONS] = folder.name
        config.add_cleanup(folder.cleanup)

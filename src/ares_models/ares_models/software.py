# SPDX-License-Identifier: Apache-2.0
"""Version of the software and of its kernels, to record with results."""

import os
import re
from importlib.metadata import version
from pathlib import Path

from ares_models.kernel_cache import VARIABLE

_STATE = re.compile(r"[0-9a-f]{16}")


def software() -> str:
    """Return the version and the state of the kernels' sources, if their folder is named by it.

    One line; equal for equal kernels.
    """
    number = version("ares_models")
    state = Path(os.environ.get(VARIABLE, "")).name
    return f"{number}, kernels {state}" if _STATE.fullmatch(state) else number

# SPDX-License-Identifier: Apache-2.0
"""What computes: told with what was computed."""

import os
import re
from importlib.metadata import version
from pathlib import Path

from ares_models.kernel_cache import VARIABLE

_STATE = re.compile(r"[0-9a-f]{16}")


def software() -> str:
    """Version, and the state of the kernels' sources where their folder is named by it.

    One line for a person; equal where the same kernels compute.
    """
    number = version("ares_models")
    state = Path(os.environ.get(VARIABLE, "")).name
    return f"{number}, kernels {state}" if _STATE.fullmatch(state) else number

# SPDX-License-Identifier: Apache-2.0
"""Print results as JSON, which holds finite numbers only."""

import json
import math
from typing import Any


def finite(value: Any) -> Any:
    """Replace numbers that JSON cannot hold by None, at any depth."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_json(value: Any) -> None:
    """Print one JSON object."""
    print(json.dumps(finite(value), indent=2, allow_nan=False))

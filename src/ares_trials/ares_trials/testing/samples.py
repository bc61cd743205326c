# SPDX-License-Identifier: Apache-2.0
"""Samples of parameters: `make test` runs some, `make trials` all."""

from collections.abc import Iterable
from typing import Any

import pytest


def one_in(every: int, values: Iterable[Any]) -> list[Any]:
    """Return parameters of a test, of which `make test` runs the first and each so many after it.

    Args:
        every: one in so many.
        values: parameters; a tuple is one for several names.
    """
    return [
        value
        if k % every == 0
        else pytest.param(
            *(value if isinstance(value, tuple) else (value,)), marks=pytest.mark.trial
        )
        for k, value in enumerate(values)
    ]

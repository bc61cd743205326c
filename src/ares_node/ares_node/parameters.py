# SPDX-License-Identifier: Apache-2.0
"""Define the rows of a node's parameter table; check their values. No ROS."""

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

_TYPE_NAMES = {
    bool: "true or false",
    int: "an integer",
    float: "a number",
    str: "a string",
    tuple: "a list of strings",
}


class ParameterError(ValueError):
    """Report a parameter that is unknown, of the wrong type or out of range; one line."""


@dataclass(frozen=True)
class Parameter:
    """Describe a parameter, one row of a node's table.

    The type is that of the default: bool, int, float, str or a tuple of str (not empty).

    Attributes:
        name: parameter name.
        default: value if it is not set.
        description: of its effect, one sentence.
        unit: SI unit; empty for a pure number or a text.
        minimum: smallest allowed value of a number.
        maximum: largest allowed value of a number.
        choices: allowed texts; empty allows any.
        read_only: fixed at construction of the node; others are read by `configure`.
        at_any_time: may also be set on a configured node, with immediate effect.
        may_be_nan: NaN is allowed and means "not given".
        option: name of its option of `ares fly` and its launch argument; "": none.
        registered: the choices are what installed packages register.
    """

    name: str
    default: Any
    description: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = False
    at_any_time: bool = False
    may_be_nan: bool = False
    option: str = ""
    registered: bool = False

    @property
    def text(self) -> str:
        """Return the description with the unit."""
        return self.description + (f" [{self.unit}]" if self.unit else "")

    @property
    def expected(self) -> str:
        """Describe the allowed values."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        words = _TYPE_NAMES[type(self.default)]
        if self.minimum is not None and self.maximum is not None:
            words += f" from {self.minimum:g} to {self.maximum:g}"
        elif self.minimum is not None:
            words += f" of at least {self.minimum:g}"
        elif self.maximum is not None:
            words += f" of at most {self.maximum:g}"
        return f"{words} {self.unit}".rstrip()

    def checked(self, value: Any) -> Any:
        """Check a value and return it in the parameter's type; an integer is valid as a float.

        Raises:
            ParameterError: wrong type, out of range, not finite, or not one of the choices.
        """
        kind = type(self.default)
        if kind is float and type(value) is int:
            value = float(value)
        elif kind is tuple and isinstance(value, (list, tuple)):
            value = tuple(value)
        good = type(value) is kind
        if good and kind is tuple:
            good = bool(value) and all(isinstance(item, str) for item in value)
        if good and kind in (int, float):
            good = (
                (self.may_be_nan if math.isnan(value) else not math.isinf(value))
                and not (self.minimum is not None and value < self.minimum)
                and not (self.maximum is not None and value > self.maximum)
            )
        if good and self.choices:
            good = value in self.choices
        if not good:
            raise ParameterError(f"parameter {self.name} is {value!r}; expected {self.expected}")
        return value

    def parsed(self, text: str) -> Any:
        """Convert the text of a launch argument and check it.

        Raises:
            ParameterError: as `checked`.
        """
        value: Any = text
        kind = type(self.default)
        if kind is bool:
            value = {"true": True, "false": False}.get(text, text)
        elif kind in (int, float):
            with suppress(ValueError):
                value = kind(text)
        return self.checked(value)


#: Row of the nodes that fly by a mission.
MISSION = Parameter(
    "mission", "ares_v", "Shipped mission's name, or path of a mission file.", option="mission"
)

# SPDX-License-Identifier: Apache-2.0
"""Parameters of a node from a table, declared with descriptors and checked at the start."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

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

    def descriptor(self) -> ParameterDescriptor:
        """Build the descriptor for `ros2 param describe`."""
        unit = f" [{self.unit}]" if self.unit else ""
        descriptor = ParameterDescriptor(
            description=self.description + unit,
            additional_constraints=self.expected,
            read_only=self.read_only,
        )
        bounded = self.minimum is not None or self.maximum is not None
        if bounded and type(self.default) is float:
            lowest = -math.inf if self.minimum is None else float(self.minimum)
            highest = math.inf if self.maximum is None else float(self.maximum)
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=lowest, to_value=highest, step=0.0)
            ]
        elif bounded and type(self.default) is int:
            lowest_int = -(2**63) if self.minimum is None else int(self.minimum)
            highest_int = 2**63 - 1 if self.maximum is None else int(self.maximum)
            descriptor.integer_range = [
                IntegerRange(from_value=lowest_int, to_value=highest_int, step=0)
            ]
        return descriptor


def declare_parameters(
    node: Node, table: Sequence[Parameter], refusal: Callable[[Parameter], str | None]
) -> dict[str, Any]:
    """Declare a node's whole table and return the values in force.

    A given parameter that is not in the table is refused: a misspelt name would otherwise use the
    default silently.

    Args:
        node: the node, after its own constructor.
        table: all parameters of the node; call this once per node.
        refusal: returns the reason why a parameter may not be set now, one line, or None.

    Raises:
        ParameterError: an unknown name, a wrong type or a value out of range.
    """
    overrides = node._parameter_overrides  # rclpy has no public access to given values
    for row in table:
        value = row.default
        if row.name in overrides:
            value = row.checked(overrides[row.name].value)
            ros_value = list(value) if isinstance(value, tuple) else value
            overrides[row.name] = RosParameter(row.name, value=ros_value)
        default = list(row.default) if isinstance(row.default, tuple) else row.default
        try:
            node.declare_parameter(row.name, default, row.descriptor())
        except ParameterException as error:
            raise ParameterError(str(error)) from error
    unknown = sorted(name for name in overrides if not node.has_parameter(name))
    if unknown:
        known = ", ".join(sorted(row.name for row in table))
        raise ParameterError(f"parameter {unknown[0]} is not known; expected one of {known}")

    rows = {row.name: row for row in table}

    def check(parameters: list[RosParameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name in rows:
                reason = refusal(rows[parameter.name])
                if reason is not None:
                    text = f"parameter {parameter.name} cannot be set: {reason}"
                    return SetParametersResult(successful=False, reason=text)
                try:
                    rows[parameter.name].checked(parameter.value)
                except ParameterError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(check)
    return read_parameters(node, table)


def read_parameters(node: Node, table: Sequence[Parameter]) -> dict[str, Any]:
    """Read the present values of a node's declared parameters, by name."""
    return {row.name: row.checked(node.get_parameter(row.name).value) for row in table}

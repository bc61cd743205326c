# SPDX-License-Identifier: Apache-2.0
"""Declare the parameters of a node from its table, with descriptors, checked at the start."""

import math
from collections.abc import Callable, Sequence
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

from ares_node.parameters import Parameter, ParameterError


def descriptor(row: Parameter) -> ParameterDescriptor:
    """Build the descriptor for `ros2 param describe`."""
    described = ParameterDescriptor(
        description=row.text, additional_constraints=row.expected, read_only=row.read_only
    )
    bounded = row.minimum is not None or row.maximum is not None
    if bounded and type(row.default) is float:
        lowest = -math.inf if row.minimum is None else float(row.minimum)
        highest = math.inf if row.maximum is None else float(row.maximum)
        described.floating_point_range = [
            FloatingPointRange(from_value=lowest, to_value=highest, step=0.0)
        ]
    elif bounded and type(row.default) is int:
        lowest_int = -(2**63) if row.minimum is None else int(row.minimum)
        highest_int = 2**63 - 1 if row.maximum is None else int(row.maximum)
        described.integer_range = [
            IntegerRange(from_value=lowest_int, to_value=highest_int, step=0)
        ]
    return described


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
            node.declare_parameter(row.name, default, descriptor(row))
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

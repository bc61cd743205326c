# SPDX-License-Identifier: Apache-2.0
"""Parameters: types, ranges, unknown names, descriptors."""

import math

import pytest
from rclpy.context import Context
from rclpy.parameter import Parameter as RosParameter

from ares_node.node import FlightNode
from ares_node.parameters import Parameter, ParameterError

TABLE = [
    Parameter("step", 0.5, "Step.", "s", 0.0, 10.0),
    Parameter("count", 3, "Count.", minimum=1),
    Parameter("law", "peg", "Law.", choices=("peg", "igm")),
    Parameter("topics", ("a", "b"), "Topics."),
    Parameter("limit", math.nan, "Limit.", "W", may_be_nan=True),
    Parameter("pace", 1.0, "Pace.", minimum=0.0),
]


def make(context: Context, **given: object) -> FlightNode:
    overrides = [RosParameter(name, value=value) for name, value in given.items()]
    return FlightNode("thing", parameters=TABLE, context=context, parameter_overrides=overrides)


def test_defaults_and_given_values(ros_context: Context) -> None:
    node = make(ros_context, step=2, topics=["c"])
    assert node.values["step"] == 2.0
    assert type(node.get_parameter("step").value) is float
    assert node.values["topics"] == ("c",)
    assert node.get_parameter("topics").value == ["c"]
    assert node.values["law"] == "peg"
    assert math.isnan(node.values["limit"])
    node.destroy_node()


def test_descriptors_carry_unit_range_and_read_only(ros_context: Context) -> None:
    node = make(ros_context)
    step = node.describe_parameter("step")
    assert step.description == "Step. [s]"
    assert not step.read_only
    assert node.describe_parameter("autostart").read_only
    assert (step.floating_point_range[0].from_value, step.floating_point_range[0].to_value) == (
        0.0,
        10.0,
    )
    assert node.describe_parameter("count").integer_range[0].from_value == 1
    assert node.describe_parameter("law").additional_constraints == "one of peg, igm"
    node.destroy_node()


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"step": 11.0}, "parameter step is 11.0; expected a number from 0 to 10 s"),
        ({"step": math.nan}, "parameter step is nan; expected a number from 0 to 10 s"),
        ({"step": "x"}, "parameter step is 'x'; expected a number from 0 to 10 s"),
        ({"limit": math.inf}, "parameter limit is inf; expected a number W"),
        ({"count": 0}, "parameter count is 0; expected an integer of at least 1"),
        ({"count": 1.5}, "parameter count is 1.5; expected an integer of at least 1"),
        ({"count": True}, "parameter count is True; expected an integer of at least 1"),
        ({"law": "zzz"}, "parameter law is 'zzz'; expected one of peg, igm"),
        (
            {"lwa": "peg"},
            (
                "parameter lwa is not known; expected one of autostart, count, law, limit, "
                "pace, step, topics"
            ),
        ),
    ],
)
def test_bad_values_are_one_line(ros_context: Context, given: dict[str, object], line: str) -> None:
    with pytest.raises(ParameterError) as caught:
        make(ros_context, **given)
    assert str(caught.value) == line


def test_a_later_set_is_checked_too(ros_context: Context) -> None:
    node = make(ros_context)
    results = node.set_parameters(
        [RosParameter("pace", value=math.nan), RosParameter("count", value=0)]
    )
    assert [result.successful for result in results] == [False, False]
    assert "nan" in results[0].reason
    assert "count" in results[1].reason
    assert not node.set_parameters([RosParameter("autostart", value=False)])[0].successful
    node.destroy_node()


def test_what_is_set_before_it_is_what_configure_finds(ros_context: Context) -> None:
    node = make(ros_context)
    asked = [RosParameter("law", value="igm"), RosParameter("topics", value=["c"])]
    assert all(result.successful for result in node.set_parameters(asked))
    assert node.start()
    assert (node.values["law"], node.values["topics"]) == ("igm", ("c",))

    refused = node.set_parameters([RosParameter("law", value="peg")])[0]
    assert refused.reason == (
        "parameter law cannot be set: the node is active, and configured with it; clean it up first"
    )
    node.trigger_deactivate()
    assert (
        "the node is inactive" in node.set_parameters([RosParameter("step", value=1.0)])[0].reason
    )
    node.trigger_cleanup()
    assert node.set_parameters([RosParameter("law", value="peg")])[0].successful
    assert node.start()
    assert node.values["law"] == "peg"
    node.stop()
    node.destroy_node()

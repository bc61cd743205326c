# SPDX-License-Identifier: Apache-2.0
"""Messages read all at once give the same numbers as messages read singly."""

from pathlib import Path

import numpy as np
import pytest

from ares_bags import reader
from ares_bags.layout import fixed_layout
from ares_bags.reader import open_bag
from ares_bags.schema import message_definition

REFERENCE = Path(__file__).parents[3] / "bags" / "reference"
FIXED = ("NavState", "VehicleState", "GuidanceStatus", "FlightEvent")


def layout_of(name: str):
    kind = f"ares_msgs/msg/{name}"
    return fixed_layout(kind, message_definition(kind))


@pytest.mark.parametrize(
    "topic", ["nav_state", "vehicle_state", "guidance_status", "flight_event", "thrust_command"]
)
def test_columns_are_those_of_the_messages(topic: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = open_bag(REFERENCE)
    at_once = bag.columns(topic)
    monkeypatch.setattr(reader, "fixed_layout", lambda *_: None)
    one_by_one = bag.columns(topic)
    assert list(at_once) == list(one_by_one)
    for name, column in one_by_one.items():
        assert at_once[name].dtype == column.dtype, name
        np.testing.assert_array_equal(at_once[name], column, err_msg=name)


def test_messages_of_one_size_have_a_layout() -> None:
    assert all(layout_of(name) is not None for name in FIXED)


@pytest.mark.parametrize(
    "field",
    ["float64[] list", "float64[<=24] list", "string text", "string<=9 text", "uint8[4] bytes"]
    + ["builtin_interfaces/Time[2] stamps"],
)
def test_lists_and_texts_have_none(field: str) -> None:
    assert fixed_layout("made_up/msg/Fixed", "float64 number\n") is not None
    assert fixed_layout("made_up/msg/Loose", f"float64 number\n{field}\n") is None


def test_places_follow_the_alignment_of_cdr() -> None:
    layout = fixed_layout(
        "made_up/msg/Mixed",
        "uint8 A=1  # a constant\nuint8 small\nfloat64[2] pair\nbool flag\nuint16 middle\n"
        "Inner in\n"
        f"{'=' * 80}\nMSG: made_up/Inner\nint8 minus\nuint64 large 5\nfloat32 half\n",
    )
    assert layout is not None
    fields = layout.dtype.fields
    assert fields is not None
    assert {name: place[1] for name, place in fields.items()} == {
        "small": 0,
        "pair": 8,
        "flag": 24,
        "middle": 26,
        "in.minus": 28,
        "in.large": 32,
        "in.half": 40,
    }
    body = np.zeros(1, layout.dtype)
    body["small"], body["pair"], body["flag"], body["in.minus"] = 7, (1.5, -2.5), True, -3
    body["in.large"] = 2**64 - 1
    columns = layout.columns([b"\x00\x01\x00\x00" + body.tobytes()])
    assert columns is not None
    assert columns["small"].tolist() == [7]
    assert columns["pair"].tolist() == [[1.5, -2.5]]
    assert columns["flag"].tolist() == [True]
    assert columns["in.minus"].tolist() == [-3]
    assert columns["in.large"].tolist() == [2**64 - 1]


def test_what_is_written_otherwise_is_left_to_the_decoder() -> None:
    layout = layout_of("NavState")
    assert layout is not None
    size = layout.dtype.itemsize
    body = bytes(size)
    assert layout.columns([]) is None
    assert layout.columns([b"\x00\x01\x00\x00" + body, b"\x00\x01\x00\x00" + body[:-8]]) is None
    assert layout.columns([b"\x00\x00\x00\x00" + body]) is None  # big-endian
    filled = layout.columns([b"\x00\x01\x00\x03" + body + b"\x00\x00\x00"])
    assert filled is not None
    assert filled["sequence"].tolist() == [0]

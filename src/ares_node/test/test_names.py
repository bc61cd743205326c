# SPDX-License-Identifier: Apache-2.0
"""Names that flights on one domain would share."""

import pytest

from ares_node.names import own_frames, own_names, remappings


@pytest.mark.parametrize("namespace", ["ares", "/ares"])
def test_a_flight_that_is_told_no_namespace_keeps_them(namespace: str) -> None:
    assert own_names(namespace) == {}
    assert own_frames(namespace) == ""
    assert remappings(namespace) == []


@pytest.mark.parametrize("namespace", ["/east", "/range/ares"])
def test_a_flight_in_another_has_its_own(namespace: str) -> None:
    assert own_names(namespace)["/tf"] == "tf"
    assert set(own_names(namespace)) == {"/clock", "/diagnostics", "/tf", "/tf_static"}
    assert own_frames(namespace) == f"{namespace[1:]}/"
    assert remappings(namespace)[:2] == ["-r", "/clock:=clock"]

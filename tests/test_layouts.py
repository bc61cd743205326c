# SPDX-License-Identifier: Apache-2.0
"""Files for other tools: the layout for Foxglove and Lichtblick, the displays of RViz."""

import json
import re
from pathlib import Path

import pytest
import yaml
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ares_bags.reader import open_bag
from ares_view.standard.frames import Frames
from ares_view.standard.node import FORWARDED, PUBLISHED

ROOT = Path(__file__).parent.parent
BRINGUP = ROOT / "src" / "ares_bringup"
LAYOUT = json.loads((BRINGUP / "layouts" / "ares.json").read_text())
PANELS = LAYOUT["configById"]
RVIZ = yaml.safe_load((BRINGUP / "rviz" / "flight.rviz").read_text())
#: What the view node publishes, by full name.
SHOWN = {name if name.startswith("/") else f"/ares/{name}" for name in PUBLISHED}


def panels_in(layout):
    """Return the identities of all panels of a layout, including those in tabs."""
    if isinstance(layout, str):
        tabs = PANELS[layout].get("tabs", ())
        return [layout, *(panel for tab in tabs for panel in panels_in(tab["layout"]))]
    return [*panels_in(layout["first"]), *panels_in(layout["second"])]


def paths_in(panel):
    """Return the message paths of a panel."""
    config = PANELS[panel]
    plain = [config[key] for key in ("topicPath", "topicToRender") if key in config]
    return [*plain, *(path["value"] for path in config.get("paths", ()))]


PATHS = sorted({path for panel in PANELS for path in paths_in(panel)})


def test_every_panel_has_its_place_and_the_other_way_round():
    assert sorted(panels_in(LAYOUT["layout"])) == sorted(PANELS)
    kinds = {panel.split("!")[0] for panel in PANELS}
    assert {"Plot", "StateTransitions", "DiagnosticSummary", "3D", "map"} <= kinds


@pytest.mark.parametrize("path", PATHS)
def test_every_path_leads_to_a_number_of_our_bags(path):
    topic, _, field = path.partition(".")
    if topic == "/diagnostics":
        # a flight without a complaint has none
        assert "diagnostics" in {name.strip("/") for name in FORWARDED}
        return
    found = open_bag(ROOT / "bags" / "reference").topics[topic]
    if not field:
        return
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(found.definition, found.type_name))
    _, fields = store.fielddefs[found.type_name]
    kinds = {name: kind for name, (_, kind) in fields}
    assert kinds[field][0] in ("uint8", "float64")


def test_space_and_map_show_what_the_view_publishes():
    space, ground = PANELS["3D!space"], PANELS["map!ground"]
    assert space["followTf"] == Frames().eci
    assert {*space["topics"], ground["followTopic"], *ground["topicColors"]} <= SHOWN


def test_rviz_shows_what_the_view_publishes():
    manager = RVIZ["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == Frames().eci
    shown = {display["Class"].split("/")[1]: display for display in manager["Displays"]}
    assert set(shown) == {"Marker", "Path", "TF"}
    for name in ("marker", "path"):
        topic = shown[name.capitalize()]["Topic"]
        kind, qos = PUBLISHED[name]
        assert topic["Value"] == f"/ares/{name}"
        assert kind.__name__ == name.capitalize()
        for policy in ("Durability", "Reliability", "History"):
            told = re.sub(r"\W", "_", topic[f"{policy} Policy"]).upper()
            assert told == getattr(qos, policy.lower()).name
        assert topic["Depth"] == qos.depth

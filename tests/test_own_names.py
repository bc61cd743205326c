# SPDX-License-Identifier: Apache-2.0
"""Flights of two namespaces in one domain: neither receives the other's messages."""

import subprocess
import sys

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from ares_bringup.recorded import read_flight
from ares_node.qos import reliable
from ares_trials.testing.flights import short_burn
from ares_trials.testing.samples import one_in

NAMESPACES = ("east", "west")
#: By their names without the namespace.
SHARED = {"clock": Clock, "tf": TFMessage, "tf_static": TFMessage, "diagnostics": DiagnosticArray}
PATIENCE = 240.0


@pytest.fixture
def heard(graph):
    """Subscribe to topics of the flights and of the whole domain; return messages by topic."""
    node = graph.add(Node("listener", context=graph.context))
    found = {}
    for name, kind in SHARED.items():
        for topic in (f"/{name}", *(f"/{namespace}/{name}" for namespace in NAMESPACES)):
            found[topic] = []
            qos = reliable(1000, keep_for_late=name == "tf_static")
            node.create_subscription(kind, topic, found[topic].append, qos)
    return found


@pytest.mark.trial
@pytest.mark.parametrize("way", one_in(2, [["--in-process"], []]), ids=["one process", "processes"])
def test_each_has_names_and_frames_of_its_own(graph, heard, ros_environment, tmp_path, way):
    # the cover stays on, which is reported
    mission = tmp_path / "mission.yaml"
    mission.write_text(yaml.safe_dump(short_burn(90.0, **{"jettisons.0.heating_limit_w_m2": 1e-6})))
    started = []
    for namespace in NAMESPACES:
        words = ["fly", *way, "--mission", str(mission), "--pace", "10", "--view"]
        words += ["--namespace", namespace, "--bag", str(tmp_path / namespace)]
        command = [sys.executable, "-m", "ares_bringup", *words]
        started.append(subprocess.Popen(command, env=ros_environment, stderr=subprocess.PIPE))
    graph.spin(lambda: all(flight.poll() is not None for flight in started), PATIENCE)
    for flight in started:
        _, said = flight.communicate()
        assert flight.returncode == 1, said
    for namespace in NAMESPACES:
        for name in ("clock", "tf", "tf_static"):
            assert heard[f"/{namespace}/{name}"], name
        transforms = [t for message in heard[f"/{namespace}/tf"] for t in message.transforms]
        frames = {t.child_frame_id for t in transforms} | {t.header.frame_id for t in transforms}
        assert frames == {"earth", f"{namespace}/ares_eci", f"{namespace}/ares_vehicle"}
        # what is recorded under such a name is found again
        bag = tmp_path / namespace
        count = len(heard[f"/{namespace}/diagnostics"])
        assert count > 0
        assert read_flight(bag).summary.diagnostic_count > 0
    assert not [topic for topic in heard if topic.count("/") == 1 and heard[topic]]

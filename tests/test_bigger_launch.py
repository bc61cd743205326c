# SPDX-License-Identifier: Apache-2.0
"""The launch file included in a foreign one: two flights beside other nodes."""

import json
import re
import signal
import subprocess
import time
from pathlib import Path

import psutil
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from ares_bringup.recorded import read_flight
from ares_node.qos import reliable

LAUNCH_FILE = Path(__file__).parent / "launches" / "two_flights.launch.py"
NAMESPACES = ("east", "west")
#: Wall time in s after which the launch counts as hanging.
PATIENCE = 240.0
FINAL_MASS_KG = 174_117.62
#: Topics of a flight that displays ask for, below its namespace.
DISPLAYS = {"pose": PoseStamped, "marker": Marker, "tf": TFMessage, "clock": Clock}
#: Names that flights of one domain would share.
SHARED = {"/clock": Clock, "/tf": TFMessage, "/tf_static": TFMessage}


class Displays:
    """Subscribe to the views of both flights and to the foreign node."""

    def __init__(self, graph):
        self.heard = {}
        node = graph.add(Node("displays", context=graph.context))
        topics = {f"/{n}/{name}": kind for n in NAMESPACES for name, kind in DISPLAYS.items()}
        for name, kind in {**topics, **SHARED, "/other": String}.items():
            self.heard[name] = []
            node.create_subscription(kind, name, self.heard[name].append, reliable(100))

    def frames(self, namespace):
        """Return the frames named by messages of a flight."""
        transforms = [t for m in self.heard[f"/{namespace}/tf"] for t in m.transforms]
        children = {t.child_frame_id for t in transforms}
        headed = (*transforms, *self.heard[f"/{namespace}/pose"])
        return children | {message.header.frame_id for message in headed}


@pytest.fixture
def launch(ros2, ros_environment, tmp_path, free_port):
    """Run the launch; afterwards assert that none of its processes is left."""
    output = tmp_path / "output"
    words = [f"bags:={tmp_path}", f"ports:={free_port},{free_port + 1}"]
    with output.open("w") as file:
        process = psutil.Popen(
            [*ros2, "launch", str(LAUNCH_FILE), *words],
            env={**ros_environment, "ROS_LOG_DIR": str(tmp_path / "log"), "COLUMNS": "200"},
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=file,
        )
    children = []
    try:
        yield process, output, children
    finally:
        children += process.children(recursive=True) if process.is_running() else []
        for one in [process, *children]:
            if one.is_running():
                one.kill()


@pytest.mark.long
@pytest.mark.trial
def test_two_flights_beside_other_nodes(graph, launch, ros_environment, tmp_path):
    process, output, children = launch
    displays = Displays(graph)

    def both_are_over():
        assert process.poll() is None, output.read_text()
        return output.read_text().count("]: flight ") == 2 * len(NAMESPACES)

    graph.spin(both_are_over, PATIENCE)
    said = output.read_text()
    assert len(re.findall(r"flight [0-9a-f]{16}: exit status 0$", said, re.MULTILINE)) == 2, said
    assert said.count("final mass          174,117.62 kg") == 2, said

    # the node of somebody else goes on, with an environment of its own
    before = len(displays.heard["/other"])
    graph.spin(lambda: len(displays.heard["/other"]) > before + 1, PATIENCE)
    found = json.loads(displays.heard["/other"][-1].data)
    assert found == {name: ros_environment.get(name) for name in found}

    for namespace in NAMESPACES:
        flight = read_flight(tmp_path / namespace)
        assert flight.columns["vehicle_state"]["mass"][-1] == pytest.approx(FINAL_MASS_KG, abs=0.01)
        assert not flight.summary.shortcomings()
        for name in DISPLAYS:
            assert displays.heard[f"/{namespace}/{name}"], name
        own = {f"{namespace}/ares_{frame}" for frame in ("eci", "vehicle")}
        assert displays.frames(namespace) == {"earth", *own}
    assert not any(displays.heard[name] for name in SHARED)

    # it ends when it is told to, and nothing is left
    children += process.children(recursive=True)
    process.send_signal(signal.SIGINT)
    graph.spin(lambda: process.poll() is not None, PATIENCE)
    said = output.read_text()
    assert "other node ends well" in said
    counts = json.loads(re.search(r"read (\{.*\})", said)[1])
    for namespace in NAMESPACES:
        assert min(counts[f"/{namespace}/{name}"] for name in ("nav_state", "pose", "tf")) > 0
    deadline = time.monotonic() + PATIENCE
    while any(one.is_running() for one in children) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [one for one in children if one.is_running()]
    assert "Traceback" not in said

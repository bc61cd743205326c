# SPDX-License-Identifier: Apache-2.0
"""The view node in the graph: a flight as seen by other tools."""

import asyncio
import contextlib
import json
import math
import socket
import struct
import threading

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Path
from pyproj import Transformer
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import NavSatFix
from tf2_msgs.msg import TFMessage
from tornado.websocket import websocket_connect
from visualization_msgs.msg import Marker

from ares_bags.compare import differences
from ares_bags.reader import open_bag
from ares_bags.recorder import RecorderNode
from ares_bags.schema import type_hash
from ares_guidance.node import GuidanceNode
from ares_models.mission import load_mission
from ares_msgs.msg import FlightEvent, VehicleState
from ares_node.qos import EVENTS, FLIGHT
from ares_node.time import ns_from_stamp, stamp_from_seconds
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.node import VehicleSimNode
from ares_view.standard.frames import EARTH as ROOT
from ares_view.standard.frames import Frames
from ares_view.standard.node import FORWARDED, PUBLISHED, ViewNode

EARTH = load_mission("ares_v").environment.earth
#: Flight time in ns of states that best effort may lose at the end.
LOST_AT_MOST = 2_000_000_000
ECI, START, VEHICLE = Frames().eci, Frames().start, Frames().vehicle


class Viewer:
    """Subscribe as a tool does, with the QoS of the publishers."""

    def __init__(self, graph):
        self.heard = {name: [] for name in PUBLISHED}
        for name, (kind, qos) in PUBLISHED.items():
            graph.observer.create_subscription(kind, name, self.heard[name].append, qos)

    def __getitem__(self, name):
        return self.heard[name]

    def texts(self):
        return [marker.text for marker in self["marker"] if marker.text]


class Flight:
    """Publish states and events of a synthetic flight on a circle over the equator."""

    RADIUS, SPEED = 6.6e6, 7.7e3

    def __init__(self, graph, flight_id):
        self.flight_id = flight_id
        self.node = graph.observer
        self.states = self.node.create_publisher(VehicleState, "vehicle_state", FLIGHT)
        self.events = self.node.create_publisher(FlightEvent, "flight_event", EVENTS)
        # best effort: a state that is sent before the view listens is lost
        graph.spin(lambda: self.states.get_subscription_count() and self.heard())

    def heard(self):
        return self.events.get_subscription_count() > 1

    def fly(self, time):
        angle = self.SPEED / self.RADIUS * time
        cosine, sine = math.cos(angle), math.sin(angle)
        self.states.publish(
            VehicleState(
                stamp=stamp_from_seconds(time),
                flight_id=self.flight_id,
                position=[self.RADIUS * cosine, self.RADIUS * sine, 0.0],
                velocity=[-self.SPEED * sine, self.SPEED * cosine, 0.0],
                thrust_direction=[-sine, cosine, 0.0],
                thrust=1.0e6,
            )
        )

    def say(self, kind, time=0.0, index=0):
        self.events.publish(
            FlightEvent(
                stamp=stamp_from_seconds(time),
                flight_id=self.flight_id,
                type=kind,
                index=index,
                time=time,
            )
        )


def stamp_of(heard):
    """Return the flight time of the latest message, ns; -1 without one."""
    return ns_from_stamp(heard[-1].header.stamp) if heard else -1


@pytest.fixture
def flown(graph, tmp_path):
    """Fly the default mission with the view, and record everything possible."""
    viewer = Viewer(graph)
    graph.start(ViewNode)
    kinds = {"pose": PoseStamped, "twist": TwistStamped, "fix": NavSatFix, "path": Path}
    kinds["marker"] = Marker
    for kind in kinds.values():
        assert kind.get_fields_and_field_types()["header"] == "std_msgs/Header"
    also = [
        f"{name}:{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
        for name, kind in kinds.items()
    ]
    recorder = graph.start(
        RecorderNode,
        bag=str(tmp_path / "bag"),
        topics=["vehicle_state", "flight_event", *also],
    )
    graph.start(VehicleSimNode, expected_recorders=1, navigation_period_s=0.5)
    graph.start(GuidanceNode)
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    graph.spin(lambda: "flight complete" in viewer.texts())
    # a viewer asks for no state again: the last ones may be lost
    end = ns_from_stamp(graph.states[-1].stamp) - LOST_AT_MOST
    graph.spin(lambda: all(stamp_of(viewer[x]) >= end for x in ("path", "fix")))
    recorder.drain_and_close(graph.executor)
    return viewer, open_bag(tmp_path / "bag")


def proj():
    figure = f"+a={EARTH.equatorial_radius_m} +b={EARTH.polar_radius_m} +no_defs"
    return Transformer.from_crs(f"+proj=geocent {figure}", f"+proj=longlat {figure}")


def rotated(vector, q):
    axis = np.array([q.x, q.y, q.z])
    return vector + 2.0 * np.cross(axis, np.cross(axis, vector) + q.w * vector)


def reverse(q):
    return type(q)(x=-q.x, y=-q.y, z=-q.z, w=q.w)


def frames(viewer):
    """Return the transforms by child, in order."""
    found = {}
    for message in (*viewer["/tf_static"], *viewer["/tf"]):
        for transform in message.transforms:
            found.setdefault(transform.child_frame_id, []).append(transform)
    return found


def test_a_flight_in_standard_messages(flown, graph):
    viewer, bag = flown
    truth = bag.columns("vehicle_state")
    row_at = {int(stamp): row for row, stamp in enumerate(truth["stamp"])}

    # every frame reaches the root, by one way
    tree = frames(viewer)
    assert set(tree) == {ECI, VEHICLE, START}
    parents = {child: {t.header.frame_id for t in all_} for child, all_ in tree.items()}
    assert parents == {ECI: {ROOT}, VEHICLE: {ECI}, START: {ROOT}}
    known = {ROOT, *tree}
    headed = (*viewer["pose"], *viewer["twist"], *viewer["fix"], *viewer["path"])
    assert {message.header.frame_id for message in (*headed, *viewer["marker"])} <= known

    # the Earth turns at its rate, x of the vehicle is its thrust
    for transform in tree[ECI]:
        angle = EARTH.rotation_rate_rad_s * ns_from_stamp(transform.header.stamp) / 1e9
        angle += math.radians(EARTH.zero_longitude_deg)
        east = rotated(np.array([1.0, 0.0, 0.0]), reverse(transform.transform.rotation))
        assert east == pytest.approx([math.cos(angle), math.sin(angle), 0.0], abs=1e-12)
    for transform in tree[VEHICLE]:
        row = row_at[ns_from_stamp(transform.header.stamp)]
        at = transform.transform.translation
        assert [at.x, at.y, at.z] == truth["position"][row].tolist()
        ahead = rotated(np.array([1.0, 0.0, 0.0]), transform.transform.rotation)
        assert ahead == pytest.approx(truth["thrust_direction"][row], abs=1e-12)

    # the place is that of PROJ to a metre, by way of the published frames
    to_place = proj()
    turned = {ns_from_stamp(t.header.stamp): t.transform.rotation for t in tree[ECI]}
    assert viewer["fix"]
    for fix in viewer["fix"]:
        stamp = ns_from_stamp(fix.header.stamp)
        fixed = rotated(truth["position"][row_at[stamp]], turned[stamp])
        longitude, latitude, height = to_place.transform(*fixed)
        metre = 180.0 / math.pi / EARTH.equatorial_radius_m
        assert fix.latitude == pytest.approx(latitude, abs=metre)
        assert fix.longitude == pytest.approx(longitude, abs=metre)
        assert fix.altitude == pytest.approx(height, abs=1.0)

    # the path is the whole flight, and ends where it ends
    last = viewer["path"][-1]
    stamps = [ns_from_stamp(point.header.stamp) for point in last.poses]
    assert stamps[0] == truth["stamp"][0]
    assert truth["stamp"][-1] - stamps[-1] <= LOST_AT_MOST
    assert len(stamps) == pytest.approx((truth["stamp"][-1] - truth["stamp"][0]) / 1e9, rel=0.05)
    assert viewer["pose"][-1].header.stamp == viewer["fix"][-1].header.stamp
    shown = ns_from_stamp(viewer["pose"][-1].header.stamp)
    assert truth["stamp"][-1] - shown <= LOST_AT_MOST
    assert viewer.texts() == [
        "ignition",
        "staging",
        "ignition",
        "jettison: payload fairing",
        "cut-off",
        "flight complete",
    ]

    # and all of it with a header is in the bag
    counts = {name.rsplit("/", 1)[-1]: topic.count for name, topic in bag.topics.items()}
    for name in ("pose", "twist", "fix", "path", "marker"):
        assert counts[name] == len(viewer[name]), name
    assert not graph.reports


def test_states_are_thinned_to_the_rate(graph):
    viewer = Viewer(graph)
    graph.start(ViewNode, rate_hz=2.0)
    flight = Flight(graph, 7)
    for step in range(200):
        flight.fly(step * 0.1)
        graph.executor.spin_once(timeout_sec=0.002)
    graph.spin(lambda: all(stamp_of(viewer[x]) == 19_900_000_000 for x in ("pose", "twist")))
    # one at once, one each half second, one at the end
    assert len(viewer["pose"]) <= 6
    assert viewer["twist"][-1].twist.angular.z == pytest.approx(
        Flight.SPEED / Flight.RADIUS, rel=1e-3
    )


def test_one_flight_is_shown_and_then_the_next(graph):
    viewer = Viewer(graph)
    view = graph.start(ViewNode)
    first, second = Flight(graph, 7), Flight(graph, 8)
    first.say(FlightEvent.FLIGHT_STARTED)
    first.say(FlightEvent.IGNITION)
    for time in (1.0, 2.0, 3.0):
        first.fly(time)
    graph.spin(lambda: viewer["pose"] and viewer["pose"][-1].header.stamp.sec == 3)
    second.fly(1.0)
    second.say(FlightEvent.IGNITION, 1.0)
    first.fly(4.0)
    graph.spin(lambda: viewer["pose"][-1].header.stamp.sec == 4)
    assert view.flight_id == 7
    assert viewer.texts() == ["ignition"]
    first.say(FlightEvent.FLIGHT_COMPLETE, 4.0)
    graph.spin(lambda: viewer.texts()[-1] == "flight complete")
    graph.spin(lambda: stamp_of(viewer["path"]) == 4_000_000_000)
    assert len(viewer["path"][-1].poses) == 4
    second.fly(2.0)
    graph.spin(lambda: viewer["pose"][-1].header.stamp.sec == 2)
    assert view.flight_id == 8
    second.say(FlightEvent.FLIGHT_COMPLETE, 2.0)
    graph.spin(lambda: len(viewer["path"][-1].poses) == 1)
    # what belongs to the first is taken away before anything of the second comes
    actions = [marker.action for marker in viewer["marker"]]
    assert actions.count(Marker.DELETEALL) == 2


def test_a_flight_that_is_published_again_begins_anew(graph):
    viewer = Viewer(graph)
    graph.start(ViewNode)
    flight = Flight(graph, 7)
    for time in (1.0, 2.0, 3.0, 4.0):
        flight.fly(time)
    graph.spin(lambda: viewer["path"] and viewer["path"][-1].header.stamp.sec == 4)
    for time in (1.0, 2.0):
        flight.fly(time)
    graph.spin(lambda: viewer["path"][-1].header.stamp.sec == 2)
    assert len(viewer["path"][-1].poses) == 2


def test_a_named_flight_only(graph):
    viewer = Viewer(graph)
    graph.start(ViewNode, flight_id=8)
    first, second = Flight(graph, 7), Flight(graph, 8)
    first.fly(1.0)
    second.fly(2.0)
    graph.spin(lambda: viewer["pose"])
    assert [pose.header.stamp.sec for pose in viewer["pose"]] == [2]


def test_who_comes_late_sees_path_markers_and_start(graph):
    graph.start(ViewNode)
    flight = Flight(graph, 7)
    flight.say(FlightEvent.IGNITION)
    flight.fly(1.0)
    flight.fly(2.0)
    flight.say(FlightEvent.FLIGHT_COMPLETE, 2.0)
    graph.spin(lambda: graph.events and graph.events[-1].type == FlightEvent.FLIGHT_COMPLETE)
    late = Viewer(graph)
    graph.spin(lambda: late["path"] and late["/tf_static"] and "flight complete" in late.texts())


def test_tf_is_the_type_that_tools_know():
    store = get_typestore(Stores.ROS2_JAZZY)
    assert type_hash("tf2_msgs/msg/TFMessage") == store.hash_rihs01("tf2_msgs/msg/TFMessage")
    assert TFMessage.get_fields_and_field_types() == {
        "transforms": "sequence<geometry_msgs/TransformStamped>"
    }


@pytest.mark.parametrize("way", one_in(2, [["--in-process"], []]), ids=["one process", "processes"])
def test_a_flight_is_the_same_whether_it_is_shown_or_not(ares, tmp_path, way):
    words = ("fly", "--mission", "ares_v", *way, "--json", "--nav-period", "1")
    plain = ares(*words, "--bag", str(tmp_path / "plain"))
    shown = ares(*words, "--bag", str(tmp_path / "shown"), "--view")
    assert (plain.returncode, shown.returncode) == (0, 0), shown.stderr
    results = [json.loads(done.stdout) for done in (plain, shown)]
    assert results[0]["m_f_kg"] == results[1]["m_f_kg"]
    assert not results[1]["diagnostics"]
    bags = [open_bag(tmp_path / name) for name in ("plain", "shown")]
    assert differences(*bags) == []
    assert [set(bag.topics) for bag in bags[:1]] == [set(bag.topics) for bag in bags[1:]]


def test_an_unknown_mission_is_refused(graph):
    overrides = [Parameter("mission", value="rocket")]
    view = graph.add(ViewNode(context=graph.context, parameter_overrides=overrides))
    assert not view.start()
    assert "rocket" in view.failure


# ---- Foxglove


class Client:
    """Connect to the WebSocket server; collect its messages by channel."""

    def __init__(self, port):
        self._port = port
        self.channels = {}
        self.heard = {}
        self.sessions = []

    async def connect(self):
        self._socket = await websocket_connect(
            f"ws://127.0.0.1:{self._port}", subprotocols=["foxglove.sdk.v1"]
        )
        while len(self.channels) < len(PUBLISHED) + len(FORWARDED):
            await self._take()
        wanted = [{"id": key, "channelId": key} for key in self.channels]
        await self._socket.write_message(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    async def _take(self):
        message = await self._socket.read_message()
        if isinstance(message, str):
            told = json.loads(message)
            if told["op"] == "serverInfo":
                self.sessions.append(told["sessionId"])
            for channel in told.get("channels", ()):
                self.channels[channel["id"]] = channel
        elif message and message[0] == 1:
            key, stamp = struct.unpack_from("<IQ", message, 1)
            topic = self.channels[key]["topic"]
            self.heard.setdefault(topic, []).append((stamp, message[13:]))

    async def take_for(self, seconds, enough):
        """Take what comes until it is enough."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + seconds
        while not enough() and loop.time() < deadline:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._take(), 0.5)
        assert enough(), {topic: len(told) for topic, told in self.heard.items()}


#: Time of the second state of a flight that is watched, ns.
LATER = 2_000_000_000


def test_foxglove_gets_a_flight_as_it_happens(graph, free_port):
    graph.start(ViewNode, foxglove_port=free_port)
    flight = Flight(graph, 7)
    for kind in (FlightEvent.FLIGHT_STARTED, FlightEvent.IGNITION):
        flight.say(kind)
    flight.fly(1.0)
    graph.spin(lambda: len(graph.events) == 2)
    over = threading.Event()
    client = Client(free_port)

    async def watch():
        await client.connect()
        # it comes late, and is told what has been
        await client.take_for(30, lambda: len(client.heard.get("/ares/flight_event", ())) == 2)
        await client.take_for(
            30, lambda: {"/tf_static", "/ares/marker", "/ares/path"} <= set(client.heard)
        )
        over.set()
        await client.take_for(30, lambda: "/tf" in client.heard)
        await client.take_for(30, lambda: LATER in dict(client.heard.get("/ares/fix", ())))

    thread = threading.Thread(target=lambda: asyncio.run(watch()))
    thread.start()
    try:
        graph.spin(lambda: over.is_set() or not thread.is_alive(), 60)
        flight.fly(2.0)
        graph.spin(lambda: not thread.is_alive(), 60)
    finally:
        thread.join()
    topics = {channel["topic"]: channel for channel in client.channels.values()}
    assert len(topics) == len(PUBLISHED) + len(FORWARDED)
    for channel in topics.values():
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        # what any reader can make of it
        assert get_types_from_msg(channel["schema"], channel["schemaName"])
    # the place at 1 s may have come late, after the client
    data = dict(client.heard["/ares/fix"])[LATER]
    assert deserialize_message(data, NavSatFix).altitude == pytest.approx(
        Flight.RADIUS - EARTH.equatorial_radius_m
    )
    kinds = [
        deserialize_message(data, FlightEvent).type
        for _, data in client.heard["/ares/flight_event"]
    ]
    assert kinds[:2] == [FlightEvent.FLIGHT_STARTED, FlightEvent.IGNITION]


def test_a_port_that_is_taken_is_refused(graph, free_port):
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", free_port))
        listener.listen()
        overrides = [Parameter("foxglove_port", value=free_port)]
        view = graph.add(ViewNode(context=graph.context, parameter_overrides=overrides))
        assert not view.start()
    assert f"foxglove_port is {free_port}, which cannot be opened" in view.failure

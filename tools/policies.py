# SPDX-License-Identifier: Apache-2.0
"""Derive the SROS2 access policies from the endpoints that the nodes create.

    ./ares exec python tools/policies.py

starts each node alone, reads its endpoints, and writes policies.xml of ares_bringup. Usage:
docs/security.md.
"""

# mypy: allow-untyped-calls
# rclpy has no types

import os
import socket
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

import ares_bringup
from ares_bags.recorder import RecorderNode
from ares_bringup.judge import JudgeNode
from ares_guidance.node import GuidanceNode
from ares_node.domains import claimed_domain
from ares_node.node import FlightNode
from ares_node.qos import NAMESPACE
from ares_node.security import ENCLAVES, stay_on_this_machine
from ares_optimizer.node import OptimizerNode
from ares_vehicle_sim.node import VehicleSimNode
from ares_view.live.node import LiveNode
from ares_view.standard.node import ViewNode

FILE = Path(ares_bringup.__file__).with_name("policies.xml")
#: Enclave of the process with the judge, or with all nodes in-process.
FLY = "fly"
#: Enclave of a replay, which publishes in place of the recorded nodes.
REPLAY = "replay"
#: Names in a profile of each kind of endpoint: element, attribute, item.
_KINDS = {
    "publish": ("topics", "publish", "topic"),
    "subscribe": ("topics", "subscribe", "topic"),
    "reply": ("services", "reply", "service"),
    "request": ("services", "request", "service"),
}


@dataclass(frozen=True)
class Endpoints:
    """Hold the full names, sorted, of a node's topics and services."""

    publish: tuple[str, ...]
    subscribe: tuple[str, ...]
    reply: tuple[str, ...]
    request: tuple[str, ...]


def _free_port() -> int:
    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        return int(made.getsockname()[1])


def makers(folder: Path) -> dict[str, tuple[Callable[..., FlightNode], dict[str, Any]]]:
    """Return class and parameters of each node of a flight, such that it has all its endpoints."""
    return {
        "vehicle_sim": (VehicleSimNode, {}),
        "guidance": (GuidanceNode, {"initial_guess": "optimizer"}),
        "optimizer": (OptimizerNode, {}),
        "recorder": (RecorderNode, {"bag": str(folder / "flight")}),
        "judge": (JudgeNode, {}),
        "view": (ViewNode, {"foxglove_port": _free_port()}),
        "live": (LiveNode, {}),
    }


def endpoints_of(node: FlightNode) -> Endpoints:
    """Return the endpoints of an active node."""
    if isinstance(node, LiveNode):
        # it creates its client when a node reports the pace
        node._control(f"/{NAMESPACE}/vehicle_sim")

    def names(found: Any) -> tuple[str, ...]:
        return tuple(sorted(name for name, _ in found))

    who = node.get_name(), node.get_namespace()
    return Endpoints(
        names(node.get_publisher_names_and_types_by_node(*who)),
        names(node.get_subscriber_names_and_types_by_node(*who)),
        names(node.get_service_names_and_types_by_node(*who)),
        names(node.get_client_names_and_types_by_node(*who)),
    )


@contextmanager
def _alone() -> Iterator[Context]:
    with claimed_domain() as domain:
        context = Context()
        rclpy.init(args=[], context=context, domain_id=domain)
        try:
            yield context
        finally:
            context.try_shutdown()


def collect() -> dict[str, Endpoints]:
    """Return the endpoints of each node, by its name."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, (kind, values) in makers(Path(folder)).items():
            with _alone() as context:
                given = [Parameter(key, value=value) for key, value in values.items()]
                node = kind(context=context, parameter_overrides=given)
                if not node.start():
                    raise RuntimeError(f"{name}: {node.failure}")
                found[name] = endpoints_of(node)
                node.stop()
                node.destroy_node()
    return found


def _profile(parent: ElementTree.Element, node: str, allowed: Endpoints) -> None:
    profile = ElementTree.SubElement(parent, "profile", ns=f"/{NAMESPACE}", node=node)
    for kind, (group, attribute, item) in _KINDS.items():
        names = getattr(allowed, kind)
        if names:
            held = ElementTree.SubElement(profile, group, {attribute: "ALLOW"})
            for name in names:
                ElementTree.SubElement(held, item).text = name


def document(found: Mapping[str, Endpoints]) -> str:
    """Render the policies: an enclave per node, one with all of them, one for a replay."""
    policy = ElementTree.Element("policy", version="0.2.0")
    enclaves = ElementTree.SubElement(policy, "enclaves")

    def enclave(name: str) -> ElementTree.Element:
        made = ElementTree.SubElement(enclaves, "enclave", path=f"{ENCLAVES}/{name}")
        return ElementTree.SubElement(made, "profiles")

    for name, allowed in found.items():
        _profile(enclave(name), name, allowed)
    whole = enclave(FLY)
    for name, allowed in found.items():
        _profile(whole, name, allowed)
    recorded = set(found["recorder"].subscribe) - {f"/{NAMESPACE}/flight_member"}
    published = {*recorded, "/clock", "/rosout", "/parameter_events", f"/{NAMESPACE}/timing"}
    _profile(enclave(REPLAY), REPLAY, Endpoints(tuple(sorted(published)), (), (), ()))
    ElementTree.indent(policy)
    return ElementTree.tostring(policy, encoding="unicode", xml_declaration=True) + "\n"


def read(text: str) -> dict[str, Endpoints]:
    """Parse the endpoints allowed in each node's own enclave, by node name."""
    allowed = {}
    for enclave in ElementTree.fromstring(text).iter("enclave"):
        name = str(enclave.get("path")).removeprefix(f"{ENCLAVES}/")
        profiles = list(enclave.iter("profile"))
        if len(profiles) == 1 and profiles[0].get("node") == name:
            lists = {
                kind: tuple(
                    str(entry.text)
                    for held in profiles[0].iter(group)
                    if held.get(attribute) == "ALLOW"
                    for entry in held.iter(item)
                )
                for kind, (group, attribute, item) in _KINDS.items()
            }
            allowed[name] = Endpoints(**lists)
    return allowed


def main() -> None:
    """Write policies.xml."""
    stay_on_this_machine(os.environ)
    FILE.write_text(document(collect()), encoding="utf-8")
    print(FILE)


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Settings of nodes by anybody: parameters, and failures written as texts."""

import contextlib
import io
import json
import math
from collections.abc import Sequence
from random import Random
from typing import Any

import numpy as np
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message

from ares_bags.recorder import RecorderNode
from ares_bringup.judge import JudgeNode
from ares_guidance.node import GuidanceNode
from ares_models.failures import KEYS, FailureError, read_failure
from ares_models.mission import load_mission
from ares_optimizer.node import OptimizerNode
from ares_vehicle_sim.node import VehicleSimNode
from ares_vehicle_sim.simulator import Simulator
from ares_view.live.node import LiveNode
from ares_view.standard.node import ViewNode
from hostile.mutate import WHOLE, changed, number, text
from hostile.nodes import Call, NodeTarget
from hostile.target import Target, check, one_line


def failure_text(random: Random) -> str:
    """Write a failure, valid or nearly so."""
    kind = random.choice(list(KEYS))
    values = {"arc": 1.0, "jettison": 0.0, "time": 300.0}
    items = []
    for key in random.choice((KEYS[kind], KEYS[kind], KEYS[random.choice(list(KEYS))])):
        value: Any = values.get(key, 0.8)
        if key in ("arc", "jettison") and random.random() < 0.8:
            value = random.choice((0, 1, 2, -1, 10**6, 10**30))
        elif random.random() < 0.4:
            value = random.choice((number(random, value), text(random)))
        items.append(f"{key}={value}")
    random.shuffle(items)
    said = f"{kind}:{','.join(items * random.choice((1, 1, 1, 1, 2)))}"
    return text(random) if random.random() < 0.05 else said


class FailureTexts(Target):
    """Try texts of `--failure`: an accepted one is flown to numbers."""

    name = "failures"
    share = 0.65

    def begin(self) -> None:
        self._missions = [load_mission(name) for name in ("ares_v", "saturn_v_as506")]

    def make(self, random: Random) -> bytes:
        said = failure_text(random).encode("utf-8", "surrogatepass")
        return changed(said, random) if random.random() < 0.2 else said

    def run(self, data: bytes) -> str:
        random = Random(data)
        try:
            failure = read_failure(data.decode("utf-8", "replace"))
            simulator = Simulator(random.choice(self._missions), failure=failure)
        except FailureError as error:
            one_line(str(error))
            return "refused"
        for _ in range(3):
            simulator.advance()
        truth = simulator.truth()
        for name in ("position", "velocity", "mass"):
            check(bool(np.all(np.isfinite(truth[name]))), f"{name} is {truth[name]}")
        return "taken"


#: Nodes by number of the input.
_NODES = (
    *(VehicleSimNode, GuidanceNode, OptimizerNode, RecorderNode, JudgeNode, ViewNode, LiveNode),
)


class Parameters(NodeTarget):
    """Set parameters of each node by its service; a simulator then starts with them."""

    name = "parameters"
    share = 1.0

    def set_up(self) -> Sequence[Call]:
        self._nodes = []
        for kind in _NODES:
            node = kind(context=self.context)
            self._held.callback(node.destroy_node)
            self._held.callback(node.stop)
            self._nodes.append(node)
        self._active = self.node(VehicleSimNode)
        self._nodes.append(self._active)
        self._goods = [
            {name: node.get_parameter(name).value for name in sorted(node._parameters)}
            for node in self._nodes
        ]
        return ()

    def make(self, random: Random) -> bytes:
        at = random.choice((0, 0, 0, *range(len(self._nodes))))
        name, good = random.choice(list(self._goods[at].items()))
        kind = random.random()
        value: Any = text(random)
        if kind < 0.6 and isinstance(good, bool):
            value = random.random() < 0.5
        elif kind < 0.6 and isinstance(good, int):
            value = random.choice((*WHOLE, good + 1, -(2**63), 2**63 - 1, 2**64))
        elif kind < 0.6 and isinstance(good, float):
            value = number(random, good or 1.0)
        elif kind < 0.7:
            value = random.choice((None, [1.0, math.nan], [text(random)], [True], 3, 2.5, [], [1]))
        if name == "failure" and random.random() < 0.8:
            value = failure_text(random)
        if random.random() < 0.03:
            name = text(random)
        return json.dumps([at, name, value, random.random() < 0.25]).encode()

    def run(self, data: bytes) -> str:
        at, name, value, start = json.loads(data)
        node = self._nodes[at]
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            word = self._set(node, name, value)
            if word == "taken" and start and at == 0:
                word = self._started(node)
            set_now = word in ("taken", "started", "not started") and name in self._goods[at]
            if set_now and node is not self._active:
                # the next one comes alone
                node.set_parameters([Parameter(name, value=self._goods[at][name])])
        check("Traceback" not in said.getvalue(), f"a traceback: {said.getvalue()[-300:]!r}")
        return word

    def _set(self, node: Any, name: str, value: Any) -> str:
        try:
            wanted = Parameter(name, value=value)
            serialize_message(wanted.to_parameter_msg())
        except Exception:
            # no message can carry it
            return "no parameter"
        try:
            result = node.set_parameters_atomically([wanted])
        except ParameterException as error:
            # told by the service to whoever asked
            check("Traceback" not in str(error), str(error)[:200])
            return "unknown"
        if not result.successful:
            one_line(result.reason)
            return "refused"
        return "taken"

    def _started(self, node: Any) -> str:
        if not node.start():
            one_line(node.failure)
            return "not started"
        truth = node.simulator.truth()
        check(math.isfinite(float(truth["mass"])), f"mass {truth['mass']}")
        node.trigger_deactivate()
        node.trigger_cleanup()
        return "started"

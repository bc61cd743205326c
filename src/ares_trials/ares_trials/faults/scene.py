# SPDX-License-Identifier: Apache-2.0
"""Run a real flight in processes of its own, observed and disturbed from outside."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from ares_bringup.discovery import apply_discovery_settings
from ares_bringup.held import all_pids, clear, shared_memory
from ares_bringup.keeper import GUIDANCE, SIMULATOR
from ares_bringup.processes import MODULES
from ares_node.domains import claimed_domain
from ares_node.key import new_key
from ares_node.membership import AGREED, Role
from ares_trials.faults.relay import GUIDANCE_ARGUMENTS, SIMULATOR_ARGUMENTS, Relay

#: Environment variable that marks the processes of a trial.
MARK = "ARES_FAULT_TRIAL"
#: Wall time in s after which a trial stops waiting.
PATIENCE = 120.0
#: Wall time in s for processes to end.
LEFT_TIMEOUT = 5.0
LOOK_PERIOD = 0.01
#: Options of the flight: Ares V with a navigation state each second, as in campaigns.
FLOWN: Mapping[str, Any] = {"mission": "ares_v", "record": False, "navigation_period_s": 1.0}


@dataclass
class FlightResult:
    """Hold the result of the flight.

    Attributes:
        status: exit status; None: it hung and was killed.
        summary: output of `ares fly --json`; empty without output.
        said: standard error.
        touched: number of messages that the relay tampered with.
        left: command lines of processes that outlived it.
        facts: findings of the row: inputs of its own checks, `must_reach` and `can_be_told` (both
            default to True), and replacements of the row's `says` and `unaffected`.
    """

    status: int | None
    summary: dict[str, Any]
    said: str
    touched: int = 0
    left: list[str] = field(default_factory=list)
    facts: dict[str, Any] = field(default_factory=dict)


def marked(mark: str) -> dict[int, str]:
    """Return the running processes of a trial: command line by process id."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            # the process may have ended, or belong to another user
            with suppress(OSError):
                if f"{MARK}={mark}".encode() in (entry / "environ").read_bytes():
                    words = (entry / "cmdline").read_bytes().replace(b"\0", b" ")
                    found[int(entry.name)] = words.decode(errors="replace")
    return found


def leftovers(mark: str) -> list[str]:
    """Kill the processes of a trial that do not end; return their command lines."""
    deadline = time.monotonic() + LEFT_TIMEOUT
    while (found := marked(mark)) and time.monotonic() < deadline:
        time.sleep(LOOK_PERIOD)
    for pid in found:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    return list(found.values())


class Scene:
    """Run one flight with a relay in it, which a row can hold at any flight time.

    Attributes:
        folder: temporary folder for files.
        relay: between simulator and guidance.
        node: for further endpoints.
        facts: findings of the row, see `FlightResult`.
    """

    def __init__(
        self,
        options: Mapping[str, Any] | None = None,
        arguments: Mapping[str, Sequence[str]] | None = None,
        modules: Mapping[str, str] | None = None,
        program: str = "ares_trials.faults.flight",
        relay: Callable[[Node], Relay] = Relay,
    ) -> None:
        """Prepare the flight; start nothing.

        Args:
            options: of FlyOptions, besides FLOWN; a bag is a name in `folder`.
            arguments: further command-line arguments of nodes.
            modules: in place of the nodes' own.
            program: module that flies.
            relay: makes the relay between simulator and guidance.
        """
        self._make_relay = relay
        self._program = program
        self.facts: dict[str, Any] = {}
        self._options = {**FLOWN, **(options or {})}
        given = dict(arguments or {})
        own = {GUIDANCE: GUIDANCE_ARGUMENTS, SIMULATOR: SIMULATOR_ARGUMENTS}
        self._options["arguments"] = {
            name: [*own.get(name, ()), *given.get(name, ())] for name in {**own, **given}
        }
        self._modules = dict(modules or {})
        self._mark = uuid.uuid4().hex
        self._held = ExitStack()

    def __enter__(self) -> Self:
        """Start the flight, which waits for the relay."""
        held = self._held
        apply_discovery_settings()
        self.folder = Path(held.enter_context(tempfile.TemporaryDirectory(prefix="ares-fault-")))
        domain = held.enter_context(claimed_domain())
        context = Context()
        rclpy.init(
            args=[],
            context=context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        held.callback(context.try_shutdown)
        self.executor = EventsExecutor(context=context)
        held.callback(self.executor.shutdown)
        self.node = Node(
            "relay",
            namespace="ares",
            context=context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        held.callback(self.node.destroy_node)
        self.executor.add_node(self.node)
        if self._options.get("sealed"):
            # the relay needs the key too
            held.enter_context(new_key())
        self.relay = self._make_relay(self.node)
        if "bag" in self._options:
            self._options["bag"] = str(self.folder / self._options["bag"])
        held.callback(lambda: leftovers(self._mark))
        self._out = (self.folder / "out").open("w+")
        self._said = (self.folder / "said").open("w+")
        given = json.dumps({"options": self._options, "modules": self._modules})
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "ares_bringup.child", self._program, given],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain), MARK: self._mark},
            stdin=subprocess.PIPE,
            stdout=self._out,
            stderr=self._said,
            process_group=0,
        )
        held.callback(self.process.communicate)
        held.callback(self.process.kill)
        return self

    def __exit__(self, *_: object) -> None:
        """End all processes and remove their shared memory, which killed ones leave."""
        mapped = shared_memory(marked(self._mark))
        self._out.close()
        self._said.close()
        self._held.close()
        clear(mapped - shared_memory(all_pids()))

    # ---- observation

    @property
    def bag(self) -> Path:
        """Return the folder of the bag."""
        return Path(self._options["bag"])

    def spin(self, until: Callable[[], bool], timeout: float = PATIENCE) -> bool:
        """Spin until a condition holds; return False if the flight or the time ended before."""
        deadline = time.monotonic() + timeout
        while not until():
            if self.process.poll() is not None or time.monotonic() > deadline:
                return False
            self.executor.spin_once(timeout_sec=LOOK_PERIOD)
        return True

    def fly_to(self, time_s: float) -> bool:
        """Fly to the first navigation state at or after a flight time, and hold there."""
        self.relay.let_go(time_s)
        return self.spin(lambda: self.relay.holding)

    def fly_past(self, time_s: float) -> bool:
        """Fly on until a flight time has passed."""
        self.relay.let_go()
        return self.spin(lambda: self.relay.now >= time_s)

    def pid(self, name: str) -> int:
        """Return the process id of a node; 0 if it does not run."""
        word = MODULES[name]
        pids = [pid for pid, line in marked(self._mark).items() if f"child {word} " in line]
        return pids[0] if pids else 0

    def guidances(self) -> set[int]:
        """Return the identities of the guidances that are in the flight."""
        ready = self.relay.membership.others(Role.GUIDANCE, *AGREED)
        return {int(member.member_id) for member in ready}

    # ---- intervention

    def keep(self, process: subprocess.Popen[bytes]) -> None:
        """Kill another process at the end of the trial."""
        self._held.callback(process.wait)
        self._held.callback(process.kill)

    def signal(self, name: str, number: int) -> None:
        """Send a signal to a node if it runs."""
        pid = self.pid(name)
        if pid:
            os.kill(pid, number)

    def set_simulator(self, **values: Any) -> None:
        """Set parameters of the simulator."""
        client = self.node.create_client(SetParameters, f"{SIMULATOR}/set_parameters")
        try:
            if not self.spin(client.service_is_ready):
                return
            parameters = [Parameter(key, value=x).to_parameter_msg() for key, x in values.items()]
            answer = client.call_async(SetParameters.Request(parameters=parameters))
            self.spin(answer.done)
        finally:
            self.node.destroy_client(client)

    def finish(self, timeout: float = PATIENCE) -> FlightResult:
        """Let the flight end within `timeout` s of wall time, else kill it; return the result."""
        self.relay.let_go()
        ended = self.spin(lambda: False, timeout) or self.process.poll() is not None
        if not ended:
            self.process.kill()
        self.process.wait()
        left = leftovers(self._mark)
        self._out.seek(0)
        self._said.seek(0)
        text = self._out.read()
        return FlightResult(
            self.process.returncode if ended else None,
            json.loads(text) if text else {},
            self._said.read(),
            self.relay.states.touched + self.relay.commands.touched,
            left,
            self.facts,
        )

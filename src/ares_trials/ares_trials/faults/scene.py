# SPDX-License-Identifier: Apache-2.0
"""A real flight in processes of its own, looked at and touched from outside."""

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
from types import TracebackType
from typing import Any, Self

import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from ares_bringup.discovery import apply_discovery_settings
from ares_bringup.fly import MODULES
from ares_bringup.held import all_pids, clear, shared_memory
from ares_bringup.keeper import GUIDANCE, SIMULATOR
from ares_node.domains import claimed_domain
from ares_node.key import new_key
from ares_node.membership import AGREED, Role
from ares_trials.faults.relay import GUIDANCE_ARGUMENTS, SIMULATOR_ARGUMENTS, Relay

#: Names the processes of a trial in their environment.
MARK = "ARES_FAULT_TRIAL"
#: Wall time in s after which whatever a trial waits for does not come any more.
PATIENCE = 120.0
#: Wall time in s for processes that were told to end to be gone.
LEFT_TIMEOUT = 5.0
LOOK_PERIOD = 0.01
#: What is flown: Ares V with a navigation state each second, as campaigns do.
FLOWN: Mapping[str, Any] = {"mission": "ares_v", "record": False, "navigation_period_s": 1.0}


@dataclass
class Flown:
    """What came of the flight.

    Attributes:
        status: exit status; None: it hung and was killed.
        summary: what `ares fly --json` prints; empty if nothing came.
        said: standard error.
        touched: messages that the relay did not just hand on.
        left: command lines of processes that outlived it.
        facts: what else a row has found out: besides what it looks at itself, `must_reach` and
            `can_be_told` (True unless it says otherwise), and what takes the place of `says` and
            `unaffected` of the row.
    """

    status: int | None
    summary: dict[str, Any]
    said: str
    touched: int = 0
    left: list[str] = field(default_factory=list)
    facts: dict[str, Any] = field(default_factory=dict)


def marked(mark: str) -> dict[int, str]:
    """Processes of a trial that run: command lines by process id."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            # it may have ended meanwhile, or be another user's
            with suppress(OSError):
                if f"{MARK}={mark}".encode() in (entry / "environ").read_bytes():
                    words = (entry / "cmdline").read_bytes().replace(b"\0", b" ")
                    found[int(entry.name)] = words.decode(errors="replace")
    return found


def leftovers(mark: str) -> list[str]:
    """Processes of a trial that do not end; they are killed."""
    deadline = time.monotonic() + LEFT_TIMEOUT
    while (found := marked(mark)) and time.monotonic() < deadline:
        time.sleep(LOOK_PERIOD)
    for pid in found:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    return list(found.values())


class Scene:
    """One flight with a relay in it. The flight holds wherever the script of a row wants it to.

    Attributes:
        folder: of files; removed in the end.
        relay: between simulator and guidance.
        node: for further endpoints.
        facts: what a row wants to be judged by besides the flight.
    """

    def __init__(
        self,
        options: Mapping[str, Any] | None = None,
        arguments: Mapping[str, Sequence[str]] | None = None,
        modules: Mapping[str, str] | None = None,
        program: str = "ares_trials.faults.flight",
        relay: Callable[[Node], Relay] = Relay,
    ) -> None:
        """Nothing runs yet.

        Args:
            options: of FlyOptions, besides FLOWN; a bag is a name in `folder`.
            arguments: further ones of nodes.
            modules: in place of the nodes' own.
            program: module that flies.
            relay: makes what is between simulator and guidance.
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
        """Begin the flight; the relay makes it wait for itself."""
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
            # the relay is one of those who have it
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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End whatever still runs; what is killed cannot clear its shared memory."""
        mapped = shared_memory(marked(self._mark))
        self._out.close()
        self._said.close()
        self._held.close()
        clear(mapped - shared_memory(all_pids()))

    # ---- looking

    @property
    def bag(self) -> Path:
        """Folder of the bag."""
        return Path(self._options["bag"])

    def spin(self, until: Callable[[], bool], timeout: float = PATIENCE) -> bool:
        """Let the flight go on until something is so; False if it ended, or never was."""
        deadline = time.monotonic() + timeout
        while not until():
            if self.process.poll() is not None or time.monotonic() > deadline:
                return False
            self.executor.spin_once(timeout_sec=LOOK_PERIOD)
        return True

    def fly_to(self, time_s: float) -> bool:
        """Let it fly to the first navigation state at or after a flight time, and hold it there."""
        self.relay.let_go(time_s)
        return self.spin(lambda: self.relay.holding)

    def fly_past(self, time_s: float) -> bool:
        """Let it fly by a flight time."""
        self.relay.let_go()
        return self.spin(lambda: self.relay.now >= time_s)

    def pid(self, name: str) -> int:
        """Process id of a node; 0 if it does not run."""
        word = MODULES[name]
        pids = [pid for pid, line in marked(self._mark).items() if f"child {word} " in line]
        return pids[0] if pids else 0

    def guidances(self) -> set[int]:
        """Identities of the guidances that have agreed to the flight and not left it."""
        ready = self.relay.membership.others(Role.GUIDANCE, *AGREED)
        return {int(member.member_id) for member in ready}

    # ---- touching

    def keep(self, process: subprocess.Popen[bytes]) -> None:
        """End another process with the trial."""
        self._held.callback(process.wait)
        self._held.callback(process.kill)

    def signal(self, name: str, number: int) -> None:
        """Send a signal to a node that runs."""
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

    def finish(self, timeout: float = PATIENCE) -> Flown:
        """Let the flight come to its end, for so many s of wall time; what came of it."""
        self.relay.let_go()
        ended = self.spin(lambda: False, timeout) or self.process.poll() is not None
        if not ended:
            self.process.kill()
        self.process.wait()
        left = leftovers(self._mark)
        self._out.seek(0)
        self._said.seek(0)
        text = self._out.read()
        return Flown(
            self.process.returncode if ended else None,
            json.loads(text) if text else {},
            self._said.read(),
            self.relay.states.touched + self.relay.commands.touched,
            left,
            self.facts,
        )

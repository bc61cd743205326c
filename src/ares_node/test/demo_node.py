# SPDX-License-Identifier: Apache-2.0
"""A node with every way to end, run as a process by test_run.py."""

import ctypes
import hashlib
import sys
import time
from typing import Any

from rclpy.executors import Executor

from ares_node.diagnostics import Level
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import Parameter
from ares_node.run import run_node

MODES = (
    "run", "finish", "refuse", "refuse_activation", "defect", "defect_in_callback", "slow_start",
    "stuck_start", "wrapped_start", "disposable", "stuck_end", "stuck_freeing", "locked_freeing",
    "warn", "refuse_later",
)  # fmt: skip


def hold() -> None:
    """Stay for minutes in compiled code, where Python handles no signal."""
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)


class DemoNode(FlightNode):
    """Report on /diagnostics until told to stop."""

    stuck = locked = False

    def __init__(self, **kwargs: Any) -> None:
        mode = Parameter("mode", "run", "How to behave.", choices=MODES)
        super().__init__("demo", parameters=[mode], **kwargs)
        if not self.values["autostart"]:
            self.first = self.create_timer(0.001, self.say_idle)

    def say_idle(self) -> None:
        """Run once, inside the loop."""
        self.first.cancel()
        print("idle", flush=True)

    def configure(self) -> None:
        mode = self.values["mode"]
        if mode == "refuse":
            raise NodeError("the tank\nis empty")
        if mode == "defect":
            raise KeyError("lost")
        if mode == "slow_start":
            print("starting", flush=True)
            time.sleep(60.0)
        if mode == "wrapped_start":
            # as Python 3.11 wraps an exception of a `__set_name__`
            try:
                print("starting", flush=True)
                time.sleep(60.0)
            except BaseException as error:
                raise RuntimeError("of the library's own") from error
        if mode == "stuck_start":
            print("starting", flush=True)
            hold()
        self.ticks = 0
        self.stuck, self.locked = mode == "stuck_freeing", mode == "locked_freeing"
        self.disposable = mode in ("disposable", "stuck_end")

    def activate(self) -> None:
        if self.values["mode"] == "refuse_later" and self.ticks:
            raise NodeError("once is enough")
        if self.values["mode"] == "refuse_activation":
            raise NodeError("the valve is shut")
        self.timer = self.create_timer(0.01, self.tick)

    def tick(self) -> None:
        self.ticks += 1
        self.diagnostics.report(Level.OK, "alive", self.ticks, {"ticks": self.ticks})
        if self.ticks == 1:
            print("running", flush=True)
        if self.values["mode"] == "defect_in_callback":
            raise KeyError("lost in a callback")
        if self.values["mode"] == "warn":
            self.diagnostics.report(Level.WARN, "the tank\nleaks", self.ticks)
        if self.values["mode"] == "disposable":
            hold()
        if self.values["mode"] == "finish" and self.ticks == 5:
            self.finish(3)

    def deactivate(self) -> None:
        self.destroy_timer(self.timer)
        print("deactivated", flush=True)

    def cleanup(self) -> None:
        print("cleaned up", flush=True)
        if self.values["mode"] == "stuck_end":
            hold()

    def destroy_node(self) -> None:
        if self.stuck:
            hold()
        if self.locked:
            # with Python's lock: no thread of Python runs
            ctypes.PyDLL(None).sleep(600)
        super().destroy_node()

    def abandon(self) -> None:
        if self.values["mode"].endswith("_start"):
            print("abandoned", flush=True)

    def drain(self, executor: Executor) -> None:
        print(f"drained {self.context.ok()}", flush=True)


if __name__ == "__main__":
    sys.exit(run_node(DemoNode, name="demo"))

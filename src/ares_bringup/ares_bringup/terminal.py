# SPDX-License-Identifier: Apache-2.0
"""Show a flight on the terminal while it flies: its state and guidance's prediction."""

import time
from collections import deque
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from ares_bringup.insertion import judgement
from ares_bringup.observed import GuidanceSample
from ares_bringup.report import BLANK, number, small
from ares_bringup.summary import FlightSummary
from ares_msgs.msg import VehicleState
from ares_node.qos import LATEST, VEHICLE_STATE
from ares_node.states import Unreadable, message_of
from ares_node.time import seconds_from_stamp

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

    from ares_bringup.monitor import FlightMonitor

#: Wall time in s over which the real-time factor is averaged.
RATE_WINDOW = 2.0
#: Wall time in s after which a state is shown as old.
OLD_AFTER = 1.0
#: Errors with a column: name in `insertion_error`, heading.
ERRORS = {
    "radius_m": "radius, m",
    "speed_m_s": "speed, m/s",
    "flight_path_angle_deg": "path angle, deg",
    "inclination_deg": "inclination, deg",
}


class TerminalView:
    """Draw the flight ten times a second, in place; remove it when the flight is over.

    It reads only the last state, and only when it draws: the flight does not wait for it.
    """

    def __init__(self, out: Console) -> None:
        """Draw nothing yet.

        Args:
            out: a terminal.
        """
        self._live = Live(
            console=out,
            auto_refresh=False,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=True,
        )
        self._monitor: FlightMonitor | None = None
        self._input: Subscription | None = None
        self._raw: bytes | None = None
        self._heard = 0.0
        self._passed: deque[tuple[float, float]] = deque()

    def __enter__(self) -> Self:
        """Return the view; it appears when the flight has begun."""
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the terminal."""
        self._live.stop()

    def show(self, monitor: "FlightMonitor") -> None:
        """Draw the latest state."""
        if self._monitor is None:
            self._monitor = monitor
            self._input = monitor.node.create_subscription(
                VehicleState, VEHICLE_STATE, self._on_state, LATEST, raw=True
            )
        if self._raw is None or not monitor.summary.started:
            return
        try:
            state = message_of(self._raw, VehicleState)
        except Unreadable:
            # unreadable, or of another version of the type
            return
        if state.flight_id != monitor.summary.flight_id:
            return
        if not self._live.is_started:
            self._live.start()
        silent = time.monotonic() - self._heard
        self._live.update(picture(monitor.summary, state, self._rate(state), silent), refresh=True)

    def _on_state(self, raw: bytes) -> None:
        self._raw = raw
        self._heard = time.monotonic()

    def _rate(self, state: VehicleState) -> float | None:
        """Return flight time over wall time, averaged over RATE_WINDOW."""
        self._passed.append((time.monotonic(), seconds_from_stamp(state.stamp)))
        while self._passed[-1][0] - self._passed[0][0] > RATE_WINDOW:
            self._passed.popleft()
        (wall, flight), (now, then) = self._passed[0], self._passed[-1]
        return (then - flight) / (now - wall) if now > wall else None


def picture(
    summary: FlightSummary, state: VehicleState, rate: float | None, silent_s: float
) -> Table:
    """Compose the lines on a flight, at most 80 columns wide.

    Args:
        summary: of the flight so far.
        state: its last true state.
        rate: real-time factor; None: unknown.
        silent_s: wall time since that state arrived.
    """
    now = seconds_from_stamp(state.stamp)
    lines = Table.grid(padding=(0, 0))
    lines.add_row(_headline(summary, state, now, rate, silent_s))
    lines.add_row(_figures(summary, state, now))
    lines.add_row(_prediction(summary))
    if summary.events:
        last = summary.timeline[-1]
        line = f"last event: {last.text} at {number(last.time_s, 2)} s"
        lines.add_row(Text(line, style="dim", overflow="ellipsis"))
    return lines


def _headline(
    summary: FlightSummary, state: VehicleState, now: float, rate: float | None, silent_s: float
) -> Text:
    arcs = summary.facts.arcs
    phase = arcs[state.arc] if state.arc < len(arcs) else f"arc {state.arc}"
    line = Text.assemble(
        (f"{summary.facts.name}: {phase}", "bold"), f"   t {number(now, 1)} s", overflow="ellipsis"
    )
    if silent_s > OLD_AFTER:
        line.append(f"   nothing heard for {silent_s:.0f} s", style="bold yellow")
    elif rate is not None:
        line.append(f"   {number(rate, 1)} times real time", style="dim")
    return line


def _figures(summary: FlightSummary, state: VehicleState, now: float) -> Table:
    status = summary.last_converged
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    speed = sum(component * component for component in state.velocity) ** 0.5
    shown = {
        "altitude, km": number(state.altitude / 1e3, 2),
        "speed, m/s": number(speed, 1),
        "mass, kg": number(state.mass, 1),
    }
    if summary.boosts:
        shown["Mach"] = number(state.mach, 2)
        shown["dynamic pressure, kPa"] = number(state.dynamic_pressure / 1e3, 2)
    else:
        shown["time to go, s"] = number(status.cutoff_time - now, 1) if status else BLANK
        shown["last solution, s ago"] = number(max(now - status.time, 0.0), 1) if status else BLANK
    for heading in shown:
        table.add_column(heading, justify="right")
    table.add_row(*shown.values())
    return table


def _prediction(summary: FlightSummary) -> Table | Text:
    status: GuidanceSample | None = summary.last_converged
    if summary.boosts:
        return Text("guidance flies the boost programme", style="dim")
    if status is None:
        return Text("guidance has no solution yet", style="yellow")
    errors = judgement(summary.facts, status.predicted_position, status.predicted_velocity).errors
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("predicted minus target", style="dim")
    shown = {key: heading for key, heading in ERRORS.items() if key in errors}
    for heading in shown.values():
        table.add_column(heading, justify="right")
    table.add_row("", *(small(errors[key]) for key in shown))
    return table

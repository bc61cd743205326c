# SPDX-License-Identifier: Apache-2.0
"""Inject faults into a flight, at times and in sizes drawn by a generator."""

import copy
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from rosgraph_msgs.msg import Clock

from ares_bags.errors import BagError
from ares_bags.reader import open_bag
from ares_bags.repair import repair
from ares_bags.verify import verify
from ares_bringup.keeper import GUIDANCE, OPTIMIZER, RECORDER, SIMULATOR
from ares_msgs.msg import FlightEvent, FlightMember, ThrustCommand
from ares_node.membership import Role, State
from ares_node.qos import (
    CLOCK,
    CLOCK_QOS,
    EVENTS,
    FLIGHT,
    FLIGHT_EVENT,
    FLIGHT_MEMBER,
    MEMBER,
    NAV_STATE,
    SOLVE_TRAJECTORY,
    THRUST_COMMAND,
)
from ares_node.time import ns_from_seconds, ns_from_stamp, stamp_from_seconds
from ares_trials.faults import tampering
from ares_trials.faults.control import Control
from ares_trials.faults.relay import Channel
from ares_trials.faults.scene import FlightResult, Scene

#: Injects a fault, drawn by a generator, into a flight whose undisturbed course is the control.
Act = Callable[[Scene, Control, Generator], None]

#: Flight time in s for the vehicle to recover; longest fault, s.
TIME_TO_RECOVER = 30.0
LONGEST = 20.0
#: Fractions of the messages affected by a bad link.
SHARES = [0.01, 0.1, 0.5]
#: Duration of a bad link, s of flight time.
BAD_LINK = 100.0
#: Pace without guidance: 20 s of flight pass before a successor has started.
PACE = 20.0
#: Pace of a flight on a busy machine; lag in s that it need not report: the lag that it catches up,
#: and the time of a message.
FAST = 200.0
UNSAID = 1.0
#: Wall time in s for a forged message to be received and contradicted.
HEARD_AFTER = 0.3
#: Wall time in s after which the recorder has flushed all received messages.
FLUSHED_AFTER = 1.2


def _some_time(control: Control, rng: Generator, before_cutoff_s: float = 2.0) -> float:
    return float(rng.uniform(control.begin_s + 2.0, control.cutoff_s - before_cutoff_s))


def _note_end(
    scene: Scene, control: Control, end_s: float, recovery_s: float = TIME_TO_RECOVER
) -> None:
    """Record whether the target must be reached, given the end of the fault."""
    scene.facts["must_reach"] = control.cutoff_s - end_s >= recovery_s


# ---- processes


def kill_guidance(scene: Scene, control: Control, rng: Generator) -> None:
    """Kill guidance; its successor takes over 0 to 20 s of flight later, however slow its start."""
    at = _some_time(control, rng)
    without = float(rng.uniform(0.0, LONGEST))
    _note_end(scene, control, at + without)
    if not scene.fly_to(at):
        return
    former = scene.guidances()
    scene.set_simulator(pace=PACE)
    scene.signal(GUIDANCE, signal.SIGKILL)
    scene.fly_past(at + without)
    scene.set_simulator(paused=True)
    scene.spin(lambda: bool(scene.guidances() - former))
    scene.set_simulator(pace=0.0, paused=False)


def stop_guidance(scene: Scene, control: Control, rng: Generator) -> None:
    """Stop guidance for 1 to 20 s of flight; the states of that time queue up for it."""
    at = _some_time(control, rng)
    without = float(rng.uniform(1.0, LONGEST))
    _note_end(scene, control, at + without)
    if not scene.fly_to(at):
        return
    scene.set_simulator(pace=PACE)
    scene.signal(GUIDANCE, signal.SIGSTOP)
    scene.fly_past(at + without)
    scene.set_simulator(paused=True)
    scene.signal(GUIDANCE, signal.SIGCONT)
    relay = scene.relay
    scene.spin(lambda: _answered(relay.last_command) >= relay.now - 1e-6)
    scene.set_simulator(pace=0.0, paused=False)


def _answered(command: ThrustCommand | None) -> float:
    """Return the flight time of the state that a command answers, s."""
    return ns_from_stamp(command.nav_stamp) / 1e9 if command is not None else -np.inf


def signal_optimizer(name: str) -> Act:
    """Send the optimizer a signal, as soon as its service is up or in flight."""

    def act(scene: Scene, control: Control, rng: Generator) -> None:
        early = rng.random() < 0.5
        at = _some_time(control, rng)
        if early:
            scene.spin(lambda: scene.node.count_services(SOLVE_TRAJECTORY) > 0)
        else:
            scene.fly_to(at)
        scene.signal(OPTIMIZER, signal.Signals[name])

    return act


def answer_falsely(scene: Scene, control: Control, rng: Generator) -> None:
    """Do nothing: the false optimizer runs in place of the true one from the start."""
    del scene, control, rng


# ---- the bag


def _fly_to_flushed(scene: Scene, control: Control, rng: Generator) -> bool:
    """Fly to a random time and wait until the recorder has flushed; False if the flight ended."""
    if not scene.fly_to(_some_time(control, rng)):
        return False
    scene.facts["flushed"] = int(scene.relay.now - control.begin_s)
    scene.spin(lambda: False, FLUSHED_AFTER)
    return True


def kill_recorder(scene: Scene, control: Control, rng: Generator) -> None:
    """Kill the recorder."""
    if _fly_to_flushed(scene, control, rng):
        scene.signal(RECORDER, signal.SIGKILL)


def fill_disk(scene: Scene, control: Control, rng: Generator) -> None:
    """Limit the size of the recorder's files from a random time on."""
    if _fly_to_flushed(scene, control, rng):
        size = max(path.stat().st_size for path in scene.bag.iterdir())
        limit = size + int(rng.integers(1, 4096))
        resource.prlimit(scene.pid(RECORDER), resource.RLIMIT_FSIZE, (limit, limit))


def remove_folder(scene: Scene, control: Control, rng: Generator) -> None:
    """Remove the bag's folder."""
    if scene.fly_to(_some_time(control, rng)):
        shutil.rmtree(scene.bag)


def what_was_flushed_is_there(scene: Scene, _flown: FlightResult) -> str:
    """Check that the bag is whole and holds each navigation state before the fault; "" if so."""
    return _what_is_missing(scene, scene.bag)


def what_was_flushed_is_saved(scene: Scene, _flown: FlightResult) -> str:
    """Check the same of the bag, repaired if it is not whole."""
    try:
        if not verify(scene.bag).findings:
            return _what_is_missing(scene, scene.bag)
        return _what_is_missing(scene, repair(scene.bag, scene.folder / "saved").path)
    except BagError as error:
        return str(error)


def _what_is_missing(scene: Scene, bag: Path) -> str:
    try:
        findings = verify(bag).findings
        states = open_bag(bag).topics[f"/ares/{NAV_STATE}"].count
    except (BagError, KeyError) as error:
        return f"{type(error).__name__}: {error}"
    if states < scene.facts["flushed"]:
        return (
            f"{states} navigation states in the bag of {scene.facts['flushed']} that were flushed"
        )
    return "; ".join(map(str, findings))


# ---- the link


def tamper_link(channel: str, kind: str, worse: bool) -> Act:
    """Affect a fraction of the messages in one direction for BAD_LINK s.

    Args:
        channel: of the relay.
        kind: `lost`, `doubled`, `delayed` or other: late by up to 1 s and out of order.
        worse: affect half of the messages, not a tenth at most. Delays reach 3 s, not 1 s, and
            affect up to a half of them.
    """

    def act(scene: Scene, control: Control, rng: Generator) -> None:
        share = float(rng.choice(SHARES[: 2 + worse] if kind == "delayed" or not worse else [0.5]))
        at = _some_time(control, rng, 10.0)
        scene.facts["must_reach"] = not worse
        link: Channel = getattr(scene.relay, channel)
        link.begin, link.end = at, at + BAD_LINK
        if kind == "lost":
            link.tamper = tampering.lose(rng, share)
        elif kind == "doubled":
            link.tamper = tampering.double(rng, share)
        elif kind == "delayed":
            link.tamper = tampering.delay(rng, share, 3.0 if worse else 1.0)
        else:
            link.tamper = tampering.delay(rng, share, 1.0)
            link.after = True

    return act


# ---- navigation


DRIFT, FROZEN = "drifts slowly", "frozen"
#: Flight time in s that surely contains a navigation state.
A_STATE = 2.0
NAVIGATION_FAULTS: dict[str, Callable[[Any, Any, float, Generator], None]] = {
    "not a number": tampering.not_a_number,
    "infinite": tampering.infinite,
    "zero": tampering.zero,
    "sign flipped": tampering.flipped,
    FROZEN: tampering.frozen,
    "50 km off": tampering.far_off,
    "of another mission": tampering.of_another_mission,
    DRIFT: tampering.drifting,
}
#: Flight time in s to recover from a drift, which guidance accepts as true. True navigation is then
#: refused for a window of 20 s, the first solutions after it turn the thrust by more than the gate
#: allows, and in the last 10 s the steering is held. Flights recover from all drifts of 12 to 20 s
#: that end 37 s or more before cut-off, but not from some that end 36 s before.
RECOVERY_FROM_DRIFT = 40.0
#: Velocity error of a drift, m/s, above which its end must be reported: slightly more than the
#: navigation gate allows per second.
TOLD_FROM = 2.0


def recovery(kind: str) -> float:
    """Return the flight time in s after wrong navigation within which the flight must recover."""
    return RECOVERY_FROM_DRIFT if kind == DRIFT else TIME_TO_RECOVER


def tamper_navigation(kind: str) -> Act:
    """Make the navigation wrong for 1 to 20 s."""

    def act(scene: Scene, control: Control, rng: Generator) -> None:
        at = _some_time(control, rng)
        end = at + float(rng.uniform(1.0, LONGEST))
        _note_end(scene, control, end, recovery(kind))
        relay = scene.relay
        last: list[Any] = []
        if kind == DRIFT:
            # the last wrong state is less than a second before the end, followed by a true one
            told = tampering.DRIFT * (end - at - 1.0) > TOLD_FROM and end < control.cutoff_s - 2.0
            scene.facts["can_be_told"] = told

        def wrong(now: float, data: bytes) -> bytes:
            def change(record: Any) -> None:
                if now < at:
                    last[:] = [record.copy()]
                else:
                    NAVIGATION_FAULTS[kind](record, last[0] if last else record, now - at, rng)

            return relay.changed(data, change)

        # frozen navigation repeats the last true state
        relay.states.begin = at - A_STATE if kind == FROZEN else at
        relay.states.end = end
        relay.states.tamper = tampering.change(wrong)

    return act


#: Largest error of a stamp, s.
FAR_STAMP = 60.0


def _wrong_stamp(kind: str, now: float, begin: float, rng: Generator) -> float:
    """Return the wrong stamp of a state, s; stamps are wrong from flight time `begin` on."""
    return {
        "ahead": now + FAR_STAMP,
        "behind": now - FAR_STAMP,
        "frozen": begin - 1.0,
        "jumping": now + float(rng.choice([-1.0, 1.0]) * rng.uniform(1.0, FAR_STAMP)),
    }[kind]


def tamper_stamps(kind: str) -> Act:
    """Make the stamps of one state, or of those of 1 to 20 s, wrong."""

    def act(scene: Scene, control: Control, rng: Generator) -> None:
        at = _some_time(control, rng)
        end = at + float(rng.choice([1.0, rng.uniform(1.0, LONGEST)]))
        _note_end(scene, control, end)
        relay = scene.relay

        def wrong(now: float, data: bytes) -> bytes:
            return relay.restamped(data, ns_from_seconds(_wrong_stamp(kind, now, at, rng)))

        relay.states.begin, relay.states.end = at, end
        relay.states.tamper = tampering.change(wrong)

    return act


# ---- commands


def _not_unit(command: ThrustCommand, rng: Generator) -> None:
    command.direction = command.direction * rng.choice([0.0, 0.9, 1.001, 2.0])


def _not_a_number(command: ThrustCommand, rng: Generator) -> None:
    name = rng.choice(["direction", "direction_rate", "reference_time"])
    if name == "reference_time":
        command.reference_time = np.nan
    else:
        values = np.array(getattr(command, name))
        values[rng.integers(3)] = rng.choice([np.nan, np.inf])
        setattr(command, name, values)


def _cutoff_in_the_past(command: ThrustCommand, rng: Generator) -> None:
    command.cutoff_time = _answered(command) - float(rng.uniform(2.0, 500.0))


def _jettison_too_early(command: ThrustCommand, _rng: Generator) -> None:
    command.jettison = 0
    command.jettison_time = _answered(command)


COMMAND_FAULTS: dict[str, Callable[[ThrustCommand, Generator], None]] = {
    "not unit": _not_unit,
    "not a number": _not_a_number,
    "cut-off in the past": _cutoff_in_the_past,
    "jettison above the limit": _jettison_too_early,
}


def tamper_commands(kind: str) -> Act:
    """Make the commands wrong for 1 to 20 s; a wrong jettison is commanded far too early."""

    def act(scene: Scene, control: Control, rng: Generator) -> None:
        too_late = control.cutoff_s - control.jettison_s + 100.0
        at = _some_time(control, rng, too_late if "jettison" in kind else 2.0)
        end = at + float(rng.uniform(1.0, LONGEST))
        _note_end(scene, control, end)

        def wrong(_now: float, command: ThrustCommand) -> ThrustCommand:
            changed = copy.deepcopy(command)
            COMMAND_FAULTS[kind](changed, rng)
            return changed

        scene.relay.commands.begin, scene.relay.commands.end = at, end
        scene.relay.commands.tamper = tampering.change(wrong)

    return act


def second_publisher(scene: Scene, control: Control, rng: Generator) -> None:
    """Publish competing answers: as another guidance, for another flight, late, or unidentified."""
    at = _some_time(control, rng)
    end = at + float(rng.uniform(1.0, LONGEST))
    kind = rng.choice(["another guidance", "another flight", "late", "nobody"])
    out = scene.node.create_publisher(ThrustCommand, THRUST_COMMAND, FLIGHT)

    def answer(command: ThrustCommand) -> None:
        if not at <= _answered(command) < end:
            return
        false = copy.deepcopy(command)
        false.direction = -command.direction
        if kind == "another guidance":
            false.guidance_id += 1
        elif kind == "nobody":
            false.guidance_id = 0
        elif kind == "another flight":
            false.flight_id += 1
        else:
            false.nav_stamp = stamp_from_seconds(_answered(command) - float(rng.integers(1, 100)))
        scene.relay.commands.touched += 1
        out.publish(false)

    scene.relay.on_command = answer


# ---- forged messages


def _forged_word(scene: Scene, role: Role, state: State) -> FlightMember:
    """Make a member's last announcement, with another state and no digest."""
    known = [word for word in scene.relay.membership.others(role) if word.state != State.LEFT]
    return FlightMember(
        flight_id=scene.relay.membership.flight_id,
        member_id=known[-1].member_id,
        role=int(role),
        state=int(state),
        guidance_id=known[-1].guidance_id,
        mission=known[-1].mission,
        node=known[-1].node,
        words=known[-1].words + 1000,
    )


def _say_forged(
    scene: Scene, control: Control, rng: Generator, out: Any, message_at: Callable[[float], Any]
) -> None:
    """Publish a forged message at a random time, once it has a subscription."""
    at = _some_time(control, rng)
    _note_end(scene, control, at)
    if not scene.fly_to(at):
        return
    scene.spin(lambda: out.get_subscription_count() > 0)
    out.publish(message_at(at))
    out.wait_for_all_acked()
    scene.spin(lambda: False, HEARD_AFTER)


def forge_word(role: Role, state: State) -> Act:
    """Announce another state under the identity of a member."""

    def act(scene: Scene, control: Control, rng: Generator) -> None:
        out = scene.node.create_publisher(FlightMember, FLIGHT_MEMBER, MEMBER)
        _say_forged(scene, control, rng, out, lambda _at: _forged_word(scene, role, state))

    return act


def forge_end(scene: Scene, control: Control, rng: Generator) -> None:
    """Publish, under the simulator's identity, that the flight is complete."""

    def complete(at: float) -> FlightEvent:
        return FlightEvent(
            stamp=stamp_from_seconds(at),
            flight_id=scene.relay.membership.flight_id,
            time=at,
            type=FlightEvent.FLIGHT_COMPLETE,
            position=[6.5e6, 0.0, 0.0],
            velocity=[0.0, 7.8e3, 0.0],
            mass=float(rng.uniform(1e5, 2e5)),
        )

    out = scene.node.create_publisher(FlightEvent, FLIGHT_EVENT, EVENTS)
    _say_forged(scene, control, rng, out, complete)


def forge_commands(scene: Scene, control: Control, rng: Generator) -> None:
    """Answer the next state under guidance's identity, with a rotated thrust direction."""
    at = _some_time(control, rng)
    end = at + float(rng.uniform(1.0, LONGEST))
    # without a key, the true answer cannot be distinguished
    scene.facts["must_reach"] = False
    out = scene.node.create_publisher(ThrustCommand, THRUST_COMMAND, FLIGHT)

    def answer(command: ThrustCommand) -> None:
        if not at <= _answered(command) < end:
            return
        false = copy.deepcopy(command)
        turned = np.array(command.direction) + rng.normal(0.0, 0.02, 3)
        false.direction = turned / np.linalg.norm(turned)
        false.nav_stamp = false.stamp = stamp_from_seconds(_answered(command) + 1.0)
        scene.relay.commands.touched += 1
        out.publish(false)

    scene.relay.on_command = answer


# ---- the clock


def stand_still(scene: Scene, control: Control, rng: Generator) -> None:
    """Stop the clock and repeat the answers given, with the thrust reversed."""
    given: list[ThrustCommand] = []
    scene.relay.on_command = given.append
    if not scene.fly_to(_some_time(control, rng)):
        return
    scene.set_simulator(paused=True)
    scene.relay.let_go()
    relay = scene.relay
    scene.spin(lambda: _answered(relay.last_command) >= relay.now - 1e-6)
    out = scene.node.create_publisher(ThrustCommand, THRUST_COMMAND, FLIGHT)
    scene.spin(lambda: out.get_subscription_count() > 0)
    for command in given[-20:]:
        again = copy.deepcopy(command)
        again.direction = -command.direction
        out.publish(again)
    out.wait_for_all_acked()
    scene.set_simulator(paused=False)


def jump_back(scene: Scene, control: Control, rng: Generator) -> None:
    """Publish a past time on another clock, and repeat the states of then."""
    back = float(rng.uniform(2.0, 100.0))
    at = _some_time(control, rng, 10.0)
    _note_end(scene, control, at)
    if at - back <= control.begin_s:
        # a repetition of the first state is a new start of the flight, as in a replay
        scene.facts["says"] = ("the flight begins again", "command refused: nav_stamp")
        scene.facts["unaffected"] = False
    kept: list[bytes] = []

    def keep(now: float, data: bytes) -> list[tuple[float, bytes]]:
        if at - back <= now < at:
            kept.append(data)
            return [(0.0, data)]
        return [*((0.0, old) for old in kept[:5]), (0.0, data)]

    scene.relay.states.begin, scene.relay.states.end = at - back, at + 1.0
    scene.relay.states.tamper = keep
    clock = scene.node.create_publisher(Clock, CLOCK, CLOCK_QOS)
    if scene.fly_to(at):
        clock.publish(Clock(clock=stamp_from_seconds(at - back)))


def restart_simulator(scene: Scene, control: Control, rng: Generator) -> None:
    """Kill the simulator; its launcher starts it again."""
    scene.fly_past(_some_time(control, rng, 100.0))
    scene.signal(SIMULATOR, signal.SIGKILL)


# ---- the machine


def load_cores(scene: Scene, control: Control, rng: Generator) -> None:
    """Run two busy processes; in half of the trials, set a pace at a random time."""
    at = _some_time(control, rng, 400.0)
    paced = bool(rng.random() < 0.5)
    for _ in range(2):
        scene.keep(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
    if not (scene.fly_to(at) and paced):
        return
    scene.set_simulator(pace=FAST)
    begun, since = time.monotonic(), scene.relay.now

    def look(_command: ThrustCommand) -> None:
        behind = time.monotonic() - begun - (scene.relay.now - since) / FAST
        scene.facts["behind_s"] = max(behind, scene.facts.get("behind_s", 0.0))

    scene.relay.on_command = look


def what_was_missed_is_said(scene: Scene, flown: FlightResult) -> str:
    """Check that a flight reported a lag beyond UNSAID; return a complaint or ""."""
    behind = scene.facts.get("behind_s", 0.0)
    if behind > UNSAID and "behind its pace by" not in flown.said:
        return f"{behind:.1f} s behind its pace, and not said"
    return ""

# SPDX-License-Identifier: Apache-2.0
"""Define the rows of the campaign: faults, and expected behaviour of the flight."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from numpy.random import Generator

from ares_bringup.keeper import OPTIMIZER, SIMULATOR
from ares_node.membership import Role, State
from ares_trials.faults import acts, signals
from ares_trials.faults.scene import FlightResult, Scene

#: Arguments of a simulator that must not wait long for lost answers.
IMPATIENT = {SIMULATOR: ("-p", "command_timeout_s:=0.1")}
RECORDED = {"record": True, "bag": "bag"}
FALSE_OPTIMIZER = {OPTIMIZER: "ares_trials.faults.false_optimizer"}


@dataclass(frozen=True)
class FaultKind:
    """Define one kind of fault.

    Attributes:
        name: short, for the table.
        expected: behaviour of the flight, for people.
        act: injects the fault, at random.
        says: texts that the flight must report if the fault took effect.
        statuses: valid exit statuses of a flight that reaches the target.
        by_relay: the fault acts on messages and may by chance affect none; then it has no effect.
        unaffected: the flight ends with exactly the mass of the undisturbed one.
        options: of the flight.
        arguments: of its nodes.
        modules: in place of its nodes.
        drawn: node that gets a seed; "": none.
        after: checks the remains; returns a complaint or "".
        program: module that flies.
        alone: runs the whole trial without a watched flight; returns a complaint or "".
    """

    name: str
    expected: str
    act: acts.Act = lambda _scene, _control, _rng: None
    says: tuple[str, ...] = ()
    statuses: tuple[int, ...] = (1,)
    by_relay: bool = False
    unaffected: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    arguments: Mapping[str, Sequence[str]] = field(default_factory=dict)
    modules: Mapping[str, str] = field(default_factory=dict)
    drawn: str = ""
    after: Callable[[Scene, FlightResult], str] = lambda _scene, _flown: ""
    program: str = "ares_trials.faults.flight"
    alone: Callable[[Generator], str] | None = None


REACHED = f"target reached if {acts.TIME_TO_RECOVER:.0f} s are left, said, status 1"
UNAFFECTED = "flight unaffected to the last bit"
REFUSED = f"refused, counted, said; target reached if {acts.TIME_TO_RECOVER:.0f} s are left"
NO_ANSWER = ("flown without an answer from guidance",)
CHANNELS = {"navigation": "states", "commands": "commands"}


def _links() -> list[FaultKind]:
    """List lost, doubled, late and reordered messages; up to a tenth of them, and half."""
    rows = []
    for what, channel in CHANNELS.items():
        for kind in ("lost", "doubled", "delayed", "re-ordered"):
            doubled = kind == "doubled"
            for worse in (False, True):
                share = ("to 50 %" if kind == "delayed" else "50 %") if worse else "to 10 %"
                late = (", to 3 s" if worse else ", to 1 s") if kind == "delayed" else ""
                rows.append(
                    FaultKind(
                        f"{what} {kind}, {share}{late}",
                        "may miss, never diverges, says so" if worse else "target reached, said",
                        acts.tamper_link(channel, kind, worse),
                        ("command refused",) if doubled else NO_ANSWER,
                        (0,) if doubled else (1,),
                        by_relay=True,
                        arguments=IMPATIENT,
                    )
                )
    return rows


def _navigation() -> list[FaultKind]:
    return [
        FaultKind(
            f"navigation {kind}",
            "refused where it can be told, counted, said; last good solution held; "
            f"target reached if {acts.recovery(kind):.0f} s are left",
            acts.tamper_navigation(kind),
            ("guidance: navigation",),
            (0, 1),
            by_relay=True,
        )
        for kind in acts.NAVIGATION_FAULTS
    ]


def _stamps() -> list[FaultKind]:
    return [
        FaultKind(
            f"stamps {kind}",
            "refused, said, the next good one taken; "
            f"target reached if {acts.TIME_TO_RECOVER:.0f} s are left, status 1",
            acts.tamper_stamps(kind),
            ("guidance: navigation refused", *NO_ANSWER),
            by_relay=True,
            arguments=IMPATIENT,
        )
        for kind in ("ahead", "behind", "frozen", "jumping")
    ]


def _commands() -> list[FaultKind]:
    return [
        FaultKind(
            f"commands {kind}", REFUSED, acts.tamper_commands(kind), (said,), (0, 1), by_relay=True
        )
        for kind, said in (
            ("not unit", "command refused: direction has length"),
            ("not a number", "command refused: "),
            ("cut-off in the past", "command refused: cutoff_time"),
            ("jettison above the limit", "command refused: jettison"),
        )
    ]


#: Forged messages by name in a row.
FORGERIES: Mapping[str, acts.Act] = {
    "guidance has left": acts.forge_word(Role.GUIDANCE, State.LEFT),
    "guidance is through": acts.forge_word(Role.GUIDANCE, State.OVER),
    "the flight is over": acts.forge_word(Role.VEHICLE_SIM, State.OVER),
    "the flight is complete": acts.forge_end,
    "commands one state ahead": acts.forge_commands,
}


def _forged() -> list[FaultKind]:
    """List the forged messages, in a flight without a key and in one with a key."""
    return [
        FaultKind(
            f"forged, {where}: {name}",
            (f"refused, said; {UNAFFECTED}" if sealed else "contradicted, said; target reached")
            + ", status 1",
            act,
            ("forged: ",),
            by_relay=name.startswith("commands"),
            unaffected=sealed,
            options={"sealed": sealed},
        )
        for sealed, where in ((False, "no key"), (True, "sealed"))
        for name, act in FORGERIES.items()
    ]


ROWS = (
    FaultKind("guidance killed", REACHED, acts.kill_guidance, (*NO_ANSWER, "restarted (1 of 3)")),
    FaultKind("guidance stopped", REACHED, acts.stop_guidance, NO_ANSWER, arguments=IMPATIENT),
    FaultKind(
        "optimizer killed",
        UNAFFECTED,
        acts.signal_optimizer("SIGKILL"),
        ("optimizer was killed by SIGKILL",),
        (0,),
        options={"initial_guess": "analytic"},
    ),
    FaultKind(
        "optimizer hung",
        "target reached, said",
        acts.signal_optimizer("SIGSTOP"),
        ("optimizer",),
        (0,),
        options={"initial_guess": "analytic"},
    ),
    FaultKind(
        "optimizer answers nonsense",
        "refused, said; target reached",
        acts.answer_falsely,
        ("guidance: optimizer: unusable answer",),
        (0,),
        options={"initial_guess": "analytic"},
        arguments={OPTIMIZER: ("-p", "kind:=nonsense")},
        modules=FALSE_OPTIMIZER,
        drawn=OPTIMIZER,
    ),
    FaultKind(
        "optimizer plans wrongly",
        "refused where it can be told; target reached",
        acts.answer_falsely,
        (),
        (0,),
        options={"initial_guess": "analytic"},
        arguments={OPTIMIZER: ("-p", "kind:=wrong plan")},
        modules=FALSE_OPTIMIZER,
        drawn=OPTIMIZER,
    ),
    FaultKind(
        "optimizer plans another vehicle",
        "refused, said; target reached",
        acts.answer_falsely,
        ("guidance: optimizer: unusable answer",),
        (0,),
        options={"initial_guess": "analytic"},
        arguments={
            OPTIMIZER: (
                "-p",
                "kind:=another vehicle",
                "-p",
                "mission:=saturn_v_as506",
                "-p",
                "method:=indirect",
            )
        },
        modules=FALSE_OPTIMIZER,
    ),
    FaultKind(
        "recorder killed",
        f"{UNAFFECTED}; what was flushed is saved, said, status 1",
        acts.kill_recorder,
        ("recorder was killed by SIGKILL in flight: the bag is incomplete", "ares bag repair"),
        unaffected=True,
        options=RECORDED,
        after=acts.what_was_flushed_is_saved,
    ),
    FaultKind(
        "disk full",
        f"{UNAFFECTED}; what was flushed is a whole bag, said, status 1",
        acts.fill_disk,
        ("recorder", "messages are in it"),
        unaffected=True,
        options=RECORDED,
        after=acts.what_was_flushed_is_there,
    ),
    FaultKind(
        "bag's folder removed",
        f"{UNAFFECTED}; said, status 1",
        acts.remove_folder,
        ("recorder", "incomplete"),
        unaffected=True,
        options=RECORDED,
    ),
    *_links(),
    *_navigation(),
    *_stamps(),
    *_commands(),
    *_forged(),
    FaultKind(
        "commands from a second publisher",
        f"refused, counted, said; {UNAFFECTED}",
        acts.second_publisher,
        ("command refused",),
        (0,),
        by_relay=True,
        unaffected=True,
    ),
    FaultKind(
        "clock stands still",
        f"old answers refused, said; {UNAFFECTED}",
        acts.stand_still,
        ("command refused",),
        (0,),
        unaffected=True,
    ),
    FaultKind(
        "clock jumps back",
        f"old states are not answered, said; {UNAFFECTED}",
        acts.jump_back,
        ("navigation state older than one before it: not answered",),
        (0,),
        unaffected=True,
    ),
    FaultKind(
        "simulator restarted",
        "a new flight, which guidance takes up by itself: target reached",
        acts.restart_simulator,
        (),
        (0,),
        unaffected=True,
        program="ares_trials.faults.by_hand",
    ),
    *(
        FaultKind(
            f"signal to {verb}",
            "ends within 2 s, status right, bag readable, nothing left",
            alone=partial(signals.interrupt, verb),
        )
        for verb in signals.VERBS
    ),
    FaultKind(
        "both cores loaded",
        f"{UNAFFECTED}; a paced flight says what it misses",
        acts.load_cores,
        (),
        (0,),
        unaffected=True,
        after=acts.what_was_missed_is_said,
    ),
)

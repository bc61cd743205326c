# SPDX-License-Identifier: Apache-2.0
"""Compare every command and status of a recorded flight with those of the present guidance.

The recorded navigation states are given to a fresh guidance, run by the code of its node in this
process, without a graph.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message

from ares_bags.errors import BagError
from ares_bags.reader import Bag, open_bag
from ares_bags.types import check_installed
from ares_bags.writer import GUIDANCE_KEY, INCOMPLETE_KEY
from ares_bringup.flown_mission import FlownMission, flown_mission, told_of
from ares_bringup.options import CannotStart, refusals
from ares_guidance.laws import find_law
from ares_guidance.messages import ANSWER_TAKEN, ASKED_AT_NS, Answers
from ares_guidance.node import PARAMETERS
from ares_guidance.registry import law_names
from ares_models.mission import Mission
from ares_models.software import software
from ares_msgs.msg import GuidanceStatus, NavState, ThrustCommand
from ares_node.identity import MISSION_DIGEST, id_text
from ares_node.membership import FLIGHT_ID
from ares_node.requirements import unmet
from ares_node.time import NANOSECONDS, ns_from_stamp

#: Largest difference that counts as equal, relative to the number, or to the norm of its vector.
TOLERANCE = 1e-12

COMMAND = "thrust_command"
STATUS = "guidance_status"
KINDS = {COMMAND: ThrustCommand, STATUS: GuidanceStatus}
#: Fields that identify a message; they are not compared.
IDENTITIES = ("stamp", "flight_id", "guidance_id")
#: Beginning of guidance's report that it starts without the optimizer.
WITHOUT_ANSWER = "optimizer: "

#: Parameters of guidance, with their defaults.
SETTINGS = {item.name: item for item in PARAMETERS if item is not FLIGHT_ID}


@dataclass(frozen=True)
class Difference:
    """Hold a number that differs.

    Attributes:
        time_s: flight time.
        topic: `thrust_command` or `guidance_status`.
        field: `direction[2]`.
        recorded: value in the bag.
        now: value of the present guidance.
        relative: their difference over the size of the number, or over the norm of its vector; inf
            if one of them is NaN.
    """

    time_s: float
    topic: str
    field: str
    recorded: float
    now: float
    relative: float


@dataclass
class Comparison:
    """Hold the result of a comparison.

    Attributes:
        path: the bag.
        mission: flown mission.
        law: guidance law at the start.
        recorded_by: software of the flight; "": unknown.
        software: present software.
        notes: assumptions and known changes since the flight, one line each.
        compared: messages by topic.
        unanswered_s: times of navigation states without a command in the bag that now get one.
        unexpected_s: times of commands in the bag that guidance does not give now.
        cut: why the comparison stops before the end of the bag; "": it does not.
        first: first difference; None if there is none.
        largest: largest difference of each field that differs.
    """

    path: Path
    mission: str
    law: str
    recorded_by: str
    software: str
    notes: list[str] = field(default_factory=list)
    compared: dict[str, int] = field(default_factory=dict)
    unanswered_s: list[float] = field(default_factory=list)
    unexpected_s: list[float] = field(default_factory=list)
    cut: str = ""
    first: Difference | None = None
    largest: list[Difference] = field(default_factory=list)

    @property
    def equal(self) -> bool:
        """Return whether all commands and statuses agree within TOLERANCE and none is missing."""
        return self.first is None and not self.unanswered_s and not self.unexpected_s


@dataclass
class _Recorded:
    """Hold the messages of guidance in a bag, by stamp in ns.

    Attributes:
        states: stamp, sequence and CDR of each navigation state, in order.
        said: by topic, messages by stamp.
        otherwise: by topic, stamps at which one guidance has sent two different messages.
        reports: stamp and status of each report of guidance.
    """

    states: list[tuple[int, int, bytes]]
    said: dict[str, dict[int, Any]]
    otherwise: dict[str, list[int]]
    reports: list[tuple[int, Any]]


@dataclass(frozen=True)
class _Turn:
    """Hold the states that one guidance had to answer: indices from begin to end, exclusive."""

    guidance_id: int
    begin: int
    end: int


def check(path: Path, given: Mapping[str, str]) -> Comparison:
    """Give the recorded navigation to a fresh guidance and compare.

    Args:
        path: the bag.
        given: settings of guidance by name, in place of those recorded.

    Raises:
        CannotStart: it cannot be checked; one line.
    """
    with refusals(BagError):
        bag = open_bag(path)
        recorded = _read(bag)
    turns = _turns(recorded)
    found = flown_mission(path, bag.custom_data, given.get("mission"))
    flown = [_flown_by(bag, recorded, turn, given) for turn in turns]
    values, told, notes = flown[0]
    name = found.mission.name
    result = Comparison(
        path, name, values["law"], told.get("software", ""), software(), notes=notes
    )
    _note_software(result, told, found)
    if reason := bag.custom_data.get(INCOMPLETE_KEY):
        result.notes.append(f"the bag is incomplete: {reason}")
    answered: dict[str, dict[int, Any]] = {COMMAND: {}, STATUS: {}}
    with found.file() as file:
        for turn, (values, _, _) in zip(turns, flown, strict=True):
            values["mission"] = file
            _fly(recorded, turn, values, found.mission, result, answered)
    _compare(recorded, answered, result)
    return result


# ---- the bag


def _read(bag: Bag) -> _Recorded:
    """Read the messages to compare; raise BagError if one topic is missing or damaged."""
    for name in ("nav_state", *KINDS):
        check_installed(bag, bag.topics[bag.name_of(name)])
    states = []
    for _, _, data in bag.raw_messages(["nav_state"]):
        state = deserialize_message(data, NavState)
        states.append((ns_from_stamp(state.stamp), int(state.sequence), data))
    said: dict[str, dict[int, Any]] = {}
    otherwise: dict[str, list[int]] = {}
    for name, kind in KINDS.items():
        said[name], otherwise[name] = {}, []
        for _, _, data in bag.raw_messages([name]):
            message = deserialize_message(data, kind)
            stamp = ns_from_stamp(message.stamp)
            before = said[name].get(stamp)
            # an equal repetition is no fault: a state received twice is answered twice
            if before is not None and _contradicts(message, before):
                otherwise[name].append(stamp)
            said[name][stamp] = message
    if not states or not said[COMMAND]:
        what = COMMAND if states else "nav_state"
        raise BagError(f"bag {bag.path} cannot be checked: {what} is empty")
    reports = []
    if bag.holds("/diagnostics"):
        for _, message in bag.messages("/diagnostics"):
            at = ns_from_stamp(message.header.stamp)
            reports += [(at, s) for s in message.status if s.name.endswith("/guidance")]
    return _Recorded(states, said, otherwise, reports)


def _contradicts(message: Any, before: Any) -> bool:
    """Tell whether two messages of one guidance differ."""
    if message.guidance_id != before.guidance_id:
        return False
    for name in message.get_fields_and_field_types():
        now, then = _column([getattr(message, name)]), _column([getattr(before, name)])
        if not np.array_equal(now, then, equal_nan=True):
            return True
    return False


def _turns(recorded: _Recorded) -> list[_Turn]:
    """Assign each state to the guidance that had to answer it: one may have replaced another."""
    heard: dict[int, int] = {}
    for messages in recorded.said.values():
        for stamp, message in messages.items():
            identity = int(message.guidance_id)
            heard[identity] = min(stamp, heard.get(identity, stamp))
    order = sorted(heard, key=lambda identity: heard[identity])
    stamps = [stamp for stamp, _, _ in recorded.states]
    begins = [0, *(int(np.searchsorted(stamps, heard[identity])) for identity in order[1:])]
    ends = [*begins[1:], len(stamps)]
    return [_Turn(*turn) for turn in zip(order, begins, ends, strict=True)]


# ---- settings of the flight


def _flown_by(
    bag: Bag, recorded: _Recorded, turn: _Turn, given: Mapping[str, str]
) -> tuple[dict[str, Any], dict[str, Any], list[str]]:
    """Return the settings of a guidance, those recorded in the bag, and notes on assumed ones."""
    told = told_of(bag.path, bag.custom_data, GUIDANCE_KEY + id_text(turn.guidance_id))
    notes = []
    values = {name: item.default for name, item in SETTINGS.items()}
    for name in ("mission", "law"):
        if bag.custom_data.get(name):
            told.setdefault(name, bag.custom_data[name])
    if "law" not in told and "law" not in given and (law := _law_of(recorded, turn)):
        told["law"] = law
        notes.append(f"the bag does not say which law steered: {law}, by its guidance_status")
    values |= {name: value for name, value in told.items() if name in values}
    for name, text in given.items():
        values[name] = _parsed(name, text)
        if name in told and told[name] != values[name]:
            notes.append(f"{name} was {told[name]} in the flight, given is {values[name]}")
    unknown = [name for name in values if name not in told and name not in given]
    if unknown:
        assumed = ", ".join(f"{name} {_shown(values[name])}" for name in unknown)
        notes.append(f"assumed, since the bag does not say (--set gives another): {assumed}")
    return values, told, notes


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _law_of(recorded: _Recorded, turn: _Turn) -> str:
    """Return the law in a guidance's statuses; "" if none of ours."""
    codes = {
        int(status.law)
        for status in recorded.said[STATUS].values()
        if int(status.guidance_id) == turn.guidance_id
    }
    names = {find_law(name).code: name for name in law_names()}
    # peg has the lowest code and takes over when another law fails
    return next((names[code] for code in sorted(codes, reverse=True) if code in names), "")


def _parsed(name: str, text: str) -> Any:
    """Convert a setting given as text; raise CannotStart if it is invalid."""
    if name not in SETTINGS:
        raise CannotStart(f"setting is {name!r}; expected one of {', '.join(SETTINGS)}")
    item = SETTINGS[name]
    if item.choices and text not in item.choices:
        raise CannotStart(f"{name} is {text!r}; expected one of {', '.join(item.choices)}")
    try:
        return type(item.default)(text)
    except ValueError as error:
        kind = "an integer" if isinstance(item.default, int) else "a number"
        raise CannotStart(f"{name} is {text!r}; expected {kind}") from error


def _note_software(result: Comparison, told: Mapping[str, Any], found: FlownMission) -> None:
    """Note a changed mission or software."""
    if found.note:
        result.notes.append(found.note)
    if result.recorded_by == result.software:
        if (
            told.get(MISSION_DIGEST, found.mission.digest) != found.mission.digest
            and not found.note
        ):
            result.notes.append("guidance and simulator had different numbers in their missions")
    elif result.recorded_by:
        result.notes.append("flown by another version: last digits and the law itself may differ")


# ---- the present guidance


def _fly(
    recorded: _Recorded,
    turn: _Turn,
    values: Mapping[str, Any],
    mission: Mission,
    result: Comparison,
    answered: Mapping[str, dict[int, Any]],
) -> None:
    """Give the states of a turn to a guidance; add its answers by topic and stamp to `answered`."""
    with refusals():
        answers = Answers(mission, values)
    states = recorded.states[turn.begin : turn.end]
    heard = {
        stamp
        for messages in recorded.said.values()
        for stamp, message in messages.items()
        if int(message.guidance_id) == turn.guidance_id
    }
    if answers.wants_guess:
        # it ignored the states before its first answer
        states = [state for state in states if state[0] >= min(heard)]
        _start(recorded, answers, values, result)
    before: int | None = None
    for stamp, sequence, data in states:
        if before is not None and sequence != before + 1:
            result.cut = (
                f"navigation states {before + 1} to {sequence - 1} are missing in the bag: what "
                f"guidance knew from {stamp / NANOSECONDS:.3f} s on cannot be known"
            )
            return
        before = sequence
        if answers.law.steered and stamp not in heard:
            # it did not receive this one, else a cycle would have left its status
            result.unanswered_s.append(stamp / NANOSECONDS)
            continue
        due = answers.step(stamp, answers.read(data)[3])
        if answers.law.steered:
            answered[COMMAND][stamp] = answers.command()
        if due:
            answered[STATUS][stamp] = answers.status()


def _start(
    recorded: _Recorded, answers: Answers, values: Mapping[str, Any], result: Comparison
) -> None:
    """Repeat the flight's request to the optimizer, and start guidance from the answer."""
    if reason := unmet("ares_optimizer", "solve"):
        raise CannotStart(reason)
    from ares_optimizer.messages import RequestServer

    taken = [(at, status) for at, status in recorded.reports if status.message == ANSWER_TAKEN]
    refused = [s.message for _, s in recorded.reports if s.message.startswith(WITHOUT_ANSWER)]
    if refused and not taken and not answers.law.lacks_plan:
        result.notes.append(f"as in the flight, without the optimizer: {refused[0]}")
        return
    asked_at, method = recorded.states[0][0], "auto"
    if taken:
        told = {value.key: value.value for value in taken[0][1].values}
        asked_at, method = int(told[ASKED_AT_NS]), told["method"]
    else:
        result.notes.append(
            "assumed, since the bag does not say: the optimizer answered the first navigation "
            "state by its own method"
        )
    data = next((data for stamp, _, data in recorded.states if stamp == asked_at), None)
    if data is None:
        raise CannotStart(
            f"bag {result.path} cannot be checked: the navigation state at "
            f"{asked_at / NANOSECONDS:.3f} s, from which the optimizer was asked, is not in it"
        )
    request = answers.request(deserialize_message(data, NavState))
    request.method = request.method or method
    # no time limit: the answer came in time then, and this machine may be slower
    request.time_limit = 0.0
    answer = RequestServer(values["mission"], method, 600.0).answer(request)
    result.notes.append(f"the optimizer's answer was found again, by its method {answer.method}")
    try:
        if answer.error_code:
            raise ValueError(answer.message)
        answers.start_from(answer)
    except ValueError as error:
        raise CannotStart(
            f"bag {result.path} cannot be checked: the optimizer, asked again, gives no start: "
            f"{error}"
        ) from error


# ---- comparison


def _compare(
    recorded: _Recorded, answered: Mapping[str, Mapping[int, Any]], result: Comparison
) -> None:
    for topic, kind in KINDS.items():
        fresh, then = answered[topic], recorded.said[topic]
        stamps = sorted(fresh.keys() & then.keys())
        result.compared[topic] = len(stamps)
        missing = sorted(fresh.keys() - then.keys())
        result.unanswered_s += [stamp / NANOSECONDS for stamp in missing]
        last = max(fresh, default=0) if result.cut else math.inf
        extra = sorted(stamp for stamp in then.keys() - fresh.keys() if stamp <= last)
        extra += [stamp for stamp in recorded.otherwise[topic] if stamp <= last]
        result.unexpected_s += [stamp / NANOSECONDS for stamp in extra]
        for name in kind.get_fields_and_field_types():
            if name not in IDENTITIES and stamps:
                pair = [
                    _column([getattr(messages[stamp], name) for stamp in stamps])
                    for messages in (then, fresh)
                ]
                _compare_field(topic, name, stamps, pair, result)
    result.unanswered_s.sort()
    result.unexpected_s.sort()


def _column(values: Sequence[Any]) -> NDArray[np.float64]:
    """Convert a field of all messages to numbers, shape (n, m), padded with NaN."""
    if hasattr(values[0], "nanosec"):
        values = [ns_from_stamp(value) for value in values]
    rows = [np.atleast_1d(np.asarray(value, dtype=np.float64)) for value in values]
    width = max(len(row) for row in rows)
    column = np.full((len(rows), width), math.nan)
    for row, numbers in zip(column, rows, strict=True):
        row[: len(numbers)] = numbers
    return column


def _compare_field(
    topic: str,
    name: str,
    stamps: Sequence[int],
    pair: Sequence[NDArray[np.float64]],
    result: Comparison,
) -> None:
    width = max(column.shape[1] for column in pair)
    then, now = (
        np.pad(column, ((0, 0), (0, width - column.shape[1])), constant_values=math.nan)
        for column in pair
    )
    same = (then == now) | (np.isnan(then) & np.isnan(now))
    if same.all():
        return
    sizes = [np.linalg.norm(np.nan_to_num(column), axis=1, keepdims=True) for column in (then, now)]
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.abs(then - now) / np.maximum(*sizes)
    relative = np.where(same, 0.0, np.where(np.isfinite(relative), relative, math.inf))

    def at(row: int, k: int) -> Difference:
        return Difference(
            stamps[row] / NANOSECONDS,
            topic,
            f"{name}[{k}]" if width > 1 else name,
            float(then[row, k]),
            float(now[row, k]),
            float(relative[row, k]),
        )

    row, k = np.unravel_index(int(np.argmax(relative)), relative.shape)
    result.largest.append(at(int(row), int(k)))
    beyond = np.flatnonzero(np.max(relative, axis=1) > TOLERANCE)
    if len(beyond):
        first = at(int(beyond[0]), int(np.argmax(relative[beyond[0]])))
        if result.first is None or first.time_s < result.first.time_s:
            result.first = first

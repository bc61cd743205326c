# SPDX-License-Identifier: Apache-2.0
"""Test the greatest payload for a target."""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from ares_models.arrays import MissionArrays
from ares_models.mission import TEMPLATE, Mission, load_mission, parse_mission
from ares_optimizer import payload
from ares_optimizer.payload import PropellantMargin, greatest_payload
from ares_optimizer.solution import (
    OUT_OF_TIME,
    Check,
    ConstraintCheck,
    OptimizerError,
    Status,
    failed,
)
from ares_optimizer.solve import solve

KICK = Path(__file__).parent / "missions" / "solid_kick.yaml"


@dataclass(frozen=True)
class Found:
    """Stand for a solution of a last stage that is nearly all propellant."""

    flyable: bool
    constraints: tuple[ConstraintCheck, ...] = (
        ConstraintCheck(Check.PROPELLANT, "propellant", 1.0, 1e6, False, "kg", True),
    )


@pytest.mark.trial
def test_the_last_stage_just_runs_dry_with_the_greatest_payload() -> None:
    mission = load_mission(TEMPLATE)
    found = greatest_payload(mission)
    assert found.solution.status is Status.CONVERGED
    assert mission.payload_kg is not None and found.payload_kg > mission.payload_kg
    used = next(c for c in found.solution.constraints if c.key is Check.PROPELLANT)
    assert used.value == pytest.approx(used.limit, abs=0.01)
    # one kilogram more does not reach the target
    more = mission.model_copy(update={"payload_kg": found.payload_kg + 1.0})
    beyond = solve(more, "auto")
    assert beyond.status is Status.INFEASIBLE
    assert "propellant of the last stage" in beyond.reason


#: Masses by item of `solid_kick`, whose last stage is a solid that burns whole.
BY_ITEM = {
    "ignition_mass_kg: 9100.0": "dry_mass_kg: 1329.0\n    propellant_kg: 4371.0",
    "ignition_mass_kg: 3400.0": "dry_mass_kg: 300.0",
    "ignition_mass_kg: 600.0": "dry_mass_kg: 130.0\n    propellant_kg: 320.0",
    "environment:": "payload_kg: 150.0\nenvironment:",
    "burn_time_s: 40.0": "burn_time_s: depletion",
    "burn_time_s: 60.0": "burn_time_s: depletion",
}


def kick_by_item(payload_kg: float) -> Mission:
    text = KICK.read_text()
    for given, by_item in BY_ITEM.items():
        assert text.count(given) == 1
        text = text.replace(given, by_item)
    return parse_mission(text, "kick.yaml").model_copy(update={"payload_kg": payload_kg})


def test_below_a_solid_what_the_stage_with_the_free_burn_is_short_of_is_told() -> None:
    found = solve(kick_by_item(700.0), "auto")
    assert found.status is Status.INFEASIBLE
    assert "propellant of stage 1: " in found.reason


@pytest.mark.trial
def test_below_a_solid_the_stage_with_the_free_burn_runs_dry() -> None:
    mission = kick_by_item(150.0)
    found = greatest_payload(mission)
    assert found.solution.status is Status.CONVERGED, found.solution.reason
    used = next(c for c in found.solution.constraints if c.key is Check.SAVED_PROPELLANT)
    assert used.value == pytest.approx(2500.0, abs=0.01)
    # one kilogram more does not reach the target, and what is short is told
    more = mission.model_copy(update={"payload_kg": found.payload_kg + 1.0})
    beyond = solve(more, "auto")
    assert beyond.status is Status.INFEASIBLE
    assert "propellant of stage 1: " in beyond.reason


def test_a_payload_is_sought_only_where_masses_are_by_item() -> None:
    with pytest.raises(OptimizerError, match="payload_kg is missing; expected masses by item"):
        greatest_payload(load_mission("ares_v"))


def test_where_no_flight_is_found_a_smaller_payload_is_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried = []

    def left(_margin: PropellantMargin, mission: Mission) -> float:
        """Stand for a vehicle that carries 900 kg, and is not planned from 1,000 kg on."""
        assert mission.payload_kg is not None
        tried.append(mission.payload_kg)
        if mission.payload_kg >= 1000.0:
            raise payload.NoFlight("no flight")
        return 0.8 * (900.0 - mission.payload_kg)

    monkeypatch.setattr(PropellantMargin, "of", left)

    def solved(given: Mission | MissionArrays, *_args: object, **_settings: object) -> object:
        """Stand for a search that finds the flight only with propellant to spare."""
        return Found(flyable=not isinstance(given, Mission))

    monkeypatch.setattr(payload, "solve", solved)
    for first in (1200.0, 230.0, 950.0):
        mission = load_mission(TEMPLATE).model_copy(update={"payload_kg": first})
        greatest = greatest_payload(mission)
        assert greatest.payload_kg == pytest.approx(900.0, abs=0.01)
        # the table has the propellant of the mission
        (row,) = greatest.solution.constraints
        assert row.limit == mission.arrays().arcs[-1]["propellant"]
        assert row.active
        assert greatest.solution.flyable
    assert max(tried) >= 1000.0
    tried.clear()
    with pytest.raises(OptimizerError, match=r"payload_kg is 90,000\.0: no flight"):
        greatest_payload(load_mission(TEMPLATE).model_copy(update={"payload_kg": 90_000.0}))
    assert len(tried) == 5


def test_a_payload_beyond_which_no_flight_is_found_comes_with_what_it_leaves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def left(_margin: PropellantMargin, mission: Mission) -> float:
        """Stand for a vehicle that carries 900 kg, and is not planned from 700 kg on."""
        assert mission.payload_kg is not None
        if mission.payload_kg >= 700.0:
            raise payload.NoFlight("no flight")
        return 0.8 * (900.0 - mission.payload_kg)

    monkeypatch.setattr(PropellantMargin, "of", left)
    monkeypatch.setattr(payload, "solve", lambda *_args, **_settings: Found(flyable=True))
    greatest = greatest_payload(load_mission(TEMPLATE))
    assert 690.0 < greatest.payload_kg < 700.0
    assert greatest.left_kg == pytest.approx(0.8 * (900.0 - greatest.payload_kg))


@pytest.mark.trial
def test_a_search_that_runs_out_of_time_keeps_what_it_has_and_proves_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mission = load_mission(TEMPLATE)
    dropped, arc = mission.jettison_mass(1), mission.arrays().arcs[-1]
    known = solve(mission, "auto")

    def found(given: Mission | MissionArrays, *_args: object, **_settings: object) -> object:
        """Stand for a vehicle that carries 900 kg, and whose search takes long from 700 kg on."""
        if isinstance(given, Mission):
            return known
        carried = float(given.arcs["stack_mass"][-1] - arc["stack_mass"]) + 200.0
        if carried >= 700.0:
            return failed("collocation", OUT_OF_TIME)
        left = 0.8 * (900.0 - carried)
        burnt = float(arc["propellant"]) - left
        mass = float(given.arcs["stack_mass"][-1]) - dropped - burnt
        return replace(known, m_f_kg=mass)

    monkeypatch.setattr(payload, "solve", found)
    told = []
    greatest = greatest_payload(mission, better=lambda *pair: told.append(pair))
    assert 690.0 < greatest.payload_kg < 700.0
    assert greatest.left_kg == pytest.approx(0.8 * (900.0 - greatest.payload_kg))
    assert greatest.solution.status is Status.FEASIBLE
    assert "the time limit passed" in greatest.solution.reason
    payloads = [kg for kg, _left in told]
    assert payloads == sorted(payloads)
    assert told[-1] == (greatest.payload_kg, greatest.left_kg)


@pytest.mark.trial
def test_burns_of_fixed_length_that_give_too_much_say_so() -> None:
    last = "thrust_n: 25800.0\n        isp_s: 343.0\n        burn_time_s: free\n"
    post = """  - name: post-boost
    dry_mass_kg: 30.0
    propellant_kg: 40.0
    arcs: [{coast_s: free}, {thrust_n: 1000.0, isp_s: 300.0, burn_time_s: free}]
"""
    text = TEMPLATE.read_text().replace("payload_kg: 200.0", "payload_kg: 20.0")
    assert text.count(last) == 1
    mission = parse_mission(text.replace(last, last.replace("free", "280.0") + post), "post.yaml")
    found = solve(mission, "auto")
    assert found.converged
    assert found.last_burn_kg < 1.0
    assert "those of fixed length all but reach the target" in found.reason


def test_burns_of_fixed_length_that_give_too_much_carry_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def found(mission: Mission | MissionArrays, *_args: object, **_settings: object) -> object:
        """Stand for a vehicle that carries 900 kg, and is not flown with less than 150 kg."""
        arrays = mission.arrays() if isinstance(mission, Mission) else mission
        stack = float(arrays.arcs["stack_mass"][-1])
        carried = stack - own
        used = 2150.0 - 0.8 * (900.0 - carried)
        idle = carried < 150.0
        return SimpleNamespace(
            flyable=not idle,
            trajectory=None,
            last_burn_kg=0.0 if idle else used,
            m_f_kg=stack - dropped - used,
            reason="off by 9 km",
        )

    mission = load_mission(TEMPLATE)
    assert mission.payload_kg is not None
    own = float(mission.arrays().arcs["stack_mass"][-1]) - mission.payload_kg
    dropped = mission.jettison_mass(1)
    monkeypatch.setattr(payload, "solve", found)
    for first in (20.0, 300.0):
        given = mission.model_copy(update={"payload_kg": first})
        assert greatest_payload(given).payload_kg == pytest.approx(900.0, abs=0.01)

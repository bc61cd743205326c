# SPDX-License-Identifier: Apache-2.0
"""Test the greatest payload for a target."""

import pytest

from ares_models.mission import TEMPLATE, Mission, load_mission
from ares_optimizer import payload
from ares_optimizer.deadline import Deadline
from ares_optimizer.payload import greatest_payload
from ares_optimizer.solution import Check, OptimizerError, Status
from ares_optimizer.solve import solve


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


def test_a_payload_is_sought_only_where_masses_are_by_item() -> None:
    with pytest.raises(OptimizerError, match="payload_kg is missing; expected masses by item"):
        greatest_payload(load_mission("ares_v"))


def test_where_no_flight_is_found_a_smaller_payload_is_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried = []

    def left(mission: Mission, _deadline: Deadline) -> float:
        """Stand for a vehicle that carries 900 kg, and is not planned from 1,000 kg on."""
        assert mission.payload_kg is not None
        tried.append(mission.payload_kg)
        if mission.payload_kg >= 1000.0:
            raise payload.NoFlight("no flight")
        return 0.8 * (900.0 - mission.payload_kg)

    monkeypatch.setattr(payload, "propellant_left", left)
    monkeypatch.setattr(payload, "solve", lambda *_args, **_settings: None)
    for first in (1200.0, 230.0, 950.0):
        mission = load_mission(TEMPLATE).model_copy(update={"payload_kg": first})
        assert greatest_payload(mission).payload_kg == pytest.approx(900.0, abs=0.01)
    assert max(tried) >= 1000.0
    tried.clear()
    with pytest.raises(OptimizerError, match=r"payload_kg is 90,000\.0: no flight"):
        greatest_payload(load_mission(TEMPLATE).model_copy(update={"payload_kg": 90_000.0}))
    assert len(tried) == 5

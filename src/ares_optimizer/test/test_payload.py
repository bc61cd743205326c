# SPDX-License-Identifier: Apache-2.0
"""Test the greatest payload for a target."""

import pytest

from ares_models.mission import TEMPLATE, load_mission
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

# SPDX-License-Identifier: Apache-2.0
"""Method `analytic` among the optimizer's: found by name, ended and refused as the others are."""

from pathlib import Path

import pytest

from ares_models.mission import load_mission
from ares_optimizer.registry import METHODS, method_names
from ares_optimizer.solution import OUT_OF_TIME, Status, UnfitMethod
from ares_optimizer.solve import solve

MISSIONS = Path(__file__).parents[2] / "ares_optimizer" / "test" / "missions"


def test_it_is_found_by_its_name():
    assert "analytic" not in METHODS
    assert "analytic" in method_names()
    solution = solve(load_mission("ares_v"), "analytic")
    assert solution.status is Status.CONVERGED
    assert solution.to_json()["converged"]


def test_no_time_is_a_time_limit():
    solution = solve(load_mission("ares_v"), "analytic", time_limit_s=0.0)
    assert solution.status is Status.TIME_LIMIT
    assert solution.reason == OUT_OF_TIME.reason


def test_a_target_underground_is_infeasible():
    mission = load_mission("ares_v")
    arrays = mission.arrays()
    target = arrays.target.copy()
    target["radius"] = 6.0e6
    start = mission.start().navigation()
    solution = solve(arrays._replace(target=target), "analytic", state=start)
    assert solution.status is Status.INFEASIBLE


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        (
            "titan2_coast",
            "method is analytic; expected auto or collocation or indirect: arc . is free",
        ),
        ("solid_middle", "arc 2 has attitude: held"),
        (
            "limited_acceleration",
            "method is analytic; expected auto or collocation or indirect: arc ",
        ),
    ],
)
def test_missions_of_another_kind_are_refused(name, complaint):
    with pytest.raises(UnfitMethod, match=complaint):
        solve(load_mission(MISSIONS / f"{name}.yaml"), "analytic")

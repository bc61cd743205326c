# SPDX-License-Identifier: Apache-2.0
"""The guess of the thesis leads each of its methods to the optimum."""

import pytest

from ares_models.mission import load_mission
from ares_optimizer.solve import solve
from ares_thesis.guess import thesis_guess


@pytest.mark.parametrize("method", ["direct11", "direct14", "direct20", "jump"])
def test_from_the_guess_of_the_thesis(method):
    mission = load_mission("ares_v")
    guess = thesis_guess(mission.start().navigation()[0])
    assert guess.direction_rate == (1e-4,) * 3
    solution = solve(mission, method, guess=guess)
    assert solution.converged, solution.reason
    assert all(check.satisfied for check in solution.constraints)
    assert solution.m_f_kg == pytest.approx(174_183.1, abs=1.0)

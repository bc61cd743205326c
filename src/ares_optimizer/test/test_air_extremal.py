# SPDX-License-Identifier: Apache-2.0
"""Motion and costates of an extremal in the air."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ares_trials
from ares_models.jit import kernel
from ares_models.kernels.records import mission_records
from ares_models.mission import load_mission
from ares_optimizer.indirect.kernels import sample
from ares_optimizer.indirect.solver import TwoPointOptions, TwoPointSolver
from ares_optimizer.solution import OptimizerError
from ares_optimizer.solve import solve
from ares_optimizer.two_point.kernels.air import Extremal, rates
from ares_optimizer.two_point.kernels.gravity import field_of

SWEPT = Path(ares_trials.__file__).parent / "sweep" / "pad.yaml"
Array = NDArray[np.float64]
THRUST_SHARE, MASS_KG = 0.9, 50e3
P = np.array([0.5, 0.6, 0.2])
Q = np.array([-1e-3, 2e-3, 1e-3])


@kernel
def rates_of(
    mission: Any, arc: int, r: Any, v: Any, p: Any, q: Any, thrust: float, mass: float
) -> Extremal:
    records = mission_records(mission)
    field = field_of(records.environment)
    return rates(records.arcs[arc], Extremal(r, v, p, q), thrust, mass, field, records)


# The last has a limit of q alpha that acts, wind, axial and normal force: there the direction is
# the best one to first order in the normal force.
@pytest.mark.parametrize(
    ("name", "arc", "accuracy"),
    [
        ("delta_iii_pad", 0, 2e-6),
        ("falcon9_iss_pad", 1, 2e-6),
        (str(SWEPT), 1, 1e-3),
    ],
)
def test_costates_follow_the_gradient_of_the_hamiltonian(
    name: str, arc: int, accuracy: float
) -> None:
    mission = load_mission(name)
    arrays = mission.arrays()
    start = mission.start()
    up = start.position / np.linalg.norm(start.position)
    r = start.position + 9000.0 * up
    v = start.velocity + 250.0 * up + np.array([30.0, 200.0, 50.0])
    p = P + 0.5 * up
    thrust = THRUST_SHARE * float(arrays.arcs[arc]["thrust"])

    def at(r: Array, v: Array) -> Extremal:
        state = (tuple(map(float, part)) for part in (r, v, p, Q))
        return rates_of(arrays, arc, *state, thrust, MASS_KG)

    def pulled(r: Array, v: Array) -> float:
        return float(np.dot(p, at(r, v).v))

    here = at(r, v)
    by_r = [(pulled(r + d, v) - pulled(r - d, v)) / 2.0 for d in np.eye(3)]
    by_v = [(pulled(r, v + d) - pulled(r, v - d)) / 0.02 for d in 0.01 * np.eye(3)]
    assert here.r == pytest.approx(v)
    assert here.q == pytest.approx(by_r, abs=accuracy * np.abs(by_r).max())
    assert here.p == pytest.approx(Q - by_v, abs=accuracy * np.abs(Q - by_v).max())


@pytest.mark.trial
def test_the_two_point_problem_in_the_air_has_the_published_optimum() -> None:
    mission = load_mission("delta_iii_pad")
    arrays, start = mission.arrays(), mission.start().navigation()
    plan = solve(mission, "collocation")
    solver = TwoPointSolver(arrays, TwoPointOptions(in_air=True))
    root = solver.solve(start, plan.parameters, restart=False)
    assert root.converged
    # of the last burn 24 g are a millisecond
    assert root.cutoff_s == pytest.approx(924.1392, abs=1e-4)
    way = solver.sample(start, root.unknowns, 7.0)
    solver.shoot(start, root.unknowns)
    end = solver.work["state"][0]
    assert way[-1, sample.TIME] == root.cutoff_s
    # with other steps
    place = way[-1, sample.POSITION : sample.POSITION + 3]
    primer = way[-1, sample.LAMBDA_V : sample.LAMBDA_V + 3]
    assert np.linalg.norm(place - end[0:3]) < 10.0
    assert primer == pytest.approx(end[6:9], abs=1e-5)


@pytest.mark.trial
def test_a_tail_off_is_flown_above_the_air() -> None:
    mission = load_mission("saturn_v_as506_pad")
    arrays, start = mission.arrays(), mission.start().navigation()
    begin = 497.72
    assert arrays.arcs["tail_knots"].nonzero()[0][0] == 7
    solver = TwoPointSolver(arrays, TwoPointOptions(in_air=True, air_end_s=begin))
    unknowns = np.zeros(7)
    unknowns[0:3] = start["position"][0] / np.linalg.norm(start["position"][0])
    unknowns[6] = 690.0
    way = solver.sample(start, unknowns, 5.0)
    solver.shoot(start, unknowns)
    velocity = way[-1, sample.VELOCITY : sample.VELOCITY + 3]
    assert np.linalg.norm(velocity - solver.work["state"][0][3:6]) < 0.05


@pytest.mark.parametrize("changes", [{"gravity": "linear"}, {"propagator": "closed_form"}])
def test_only_the_exact_problem_knows_of_the_air(changes: Any) -> None:
    with pytest.raises(OptimizerError, match="in_air is True"):
        TwoPointOptions(in_air=True, **changes)

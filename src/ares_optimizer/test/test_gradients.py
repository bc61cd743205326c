# SPDX-License-Identifier: Apache-2.0
"""Compare exact derivatives with complex steps on a copy in plain NumPy.

The copy below shares only the order of events and the arrays of the problem with the kernels:
gravity, mass, steering and the Runge-Kutta-Nystroem scheme are written again for complex numbers.
"""

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.direct.kernels.evaluate import (
    evaluate,
    evaluate_with_gradients,
    make_point,
    make_scratch,
)
from ares_optimizer.direct.kernels.flight import gravity_gradient
from ares_optimizer.direct.kernels.jump import JUMP_INPUTS, JUMP_OUTPUTS, jump, jump_jacobian
from ares_optimizer.direct.kernels.lagrangian import (
    Multipliers,
    Workspace,
    estimate_multipliers,
    lagrangian_gradient,
)
from ares_optimizer.direct.kernels.quadratic import Frame, reduced_hessian
from ares_optimizer.direct.kernels.scratch import BREAKS, LATER_PEAKS
from ares_optimizer.direct.search import carry_over, find_direct, own_starts, run
from ares_optimizer.direct.transcription import transcribe
from ares_optimizer.kernels.terminal import MAX_ROWS, terminal_rows
from ares_optimizer.request import Heating

STEP = 1e-30
TIME, RATE = 100.0, 1e-3
C = (0.0, 0.1, 0.3, 0.7, 0.68, 1.0)
A = (
    (),
    (1 / 200,),
    (-1 / 2200, 1 / 22),
    (637 / 6600, -7 / 110, 7 / 33),
    (225437 / 1968750, -30073 / 281250, 65569 / 281250, -9367 / 984375),
    (151 / 2142, 5 / 116, 385 / 1368, 55 / 168, -6250 / 28101),
)
B = (151 / 2142, 25 / 522, 275 / 684, 275 / 252, -78125 / 112404, 1 / 12)


def size(x):
    return np.sqrt(x @ x)


def gravity(r, environment):
    square = r @ r
    k = float(environment["mu"]) / (square * np.sqrt(square))
    j2 = float(environment["j2"])
    q = 1.5 * j2 * float(environment["equatorial_radius"]) ** 2 / square
    w = 5.0 * r[2] ** 2 / square
    return -k * r * np.array([1 + q * (1 - w), 1 + q * (1 - w), 1 + q * (3 - w)])


def plain_flight(p, problem, times, breaks, count):
    """Return final position and velocity, and those at each free drop; complex if ``p`` is."""
    environment = problem.environment[0]
    r = problem.state[:3].astype(p.dtype)
    v = problem.state[3:].astype(p.dtype)
    direction, rate, law_time = np.zeros(3), np.zeros(3), 0.0
    thrust0 = thrust1 = flow0 = flow1 = anchor = dropped = 0.0
    mass0 = problem.profile[0, 5]
    drops = {}

    def at(b):
        what, index, column = breaks[b, :3]
        if column < 0:
            return times[b]
        return p[column] * TIME + (problem.tail[index, 0] if what == 4 else 0.0)

    def mass_at(t):
        s = t - anchor
        return mass0 - s * (flow0 + 0.5 * s * flow1) - dropped

    for b in range(count):
        what, index = breaks[b, :2]
        t = at(b)
        mass = mass_at(t)
        law = None
        if what == 0:
            anchor = t
            _, thrust0, thrust1, flow0, flow1, mass0 = problem.profile[index]
        elif what == 1:
            law = problem.laws[index]
        elif what == 2:
            drops[index] = np.concatenate((r, v))
            matching = [row for row in problem.laws if row[0] == 2 and row[1] == index]
            law = matching[0] if matching else None
        elif what == 4:
            anchor = t
            _, thrust0, thrust1, flow0, flow1 = problem.tail[index]
            mass0 = mass + dropped
        if law is not None:
            direction = direction + rate * (t - law_time)
            if law[3] < 0:
                thrust = thrust0 + thrust1 * (t - anchor)
                rest = mass - problem.drops[index, 0]
                x = np.concatenate((r, v, direction, rate, [thrust / mass, thrust / rest]))
                y = np.empty(JUMP_OUTPUTS, x.dtype)
                jump(x, environment, problem.atmosphere, y)
                direction, rate = y[:3], y[3:6]
            else:
                if law[2] >= 0:
                    direction = p[law[2] : law[2] + 3]
                rate = p[law[3] : law[3] + 3] * RATE
            law_time = t
        if what == 2:
            dropped += problem.drops[index, 0]
        steps = breaks[b, 3]
        if steps == 0:
            continue
        h = (at(b + 1) - t) / steps
        for i in range(steps):
            forces = []
            for c, row in zip(C, A, strict=True):
                ts = t + (i + c) * h
                shift = sum((w * f for w, f in zip(row, forces, strict=True)), np.zeros(3))
                steering = direction + rate * (ts - law_time)
                thrust = thrust0 + thrust1 * (ts - anchor)
                position = r + c * h * v + h * h * shift
                forces.append(
                    gravity(position, environment)
                    + thrust / mass_at(ts) * steering / size(steering)
                )
            r = r + h * v + h * h * sum(w * f for w, f in zip(A[5], forces, strict=False))
            v = v + h * sum(w * f for w, f in zip(B, forces, strict=True))
    return np.concatenate((r, v)), drops


@pytest.mark.parametrize(
    ("mission", "method", "j2"),
    [
        ("ares_v", "direct11", 0.0),
        ("ares_v", "direct14", 0.0),
        ("ares_v", "direct20", 0.0),
        ("ares_v", "jump", 0.0),
        ("ares_v", "direct20", 1.0826e-3),
        ("delta_iii", "direct11", 0.0),
        ("saturn_v_as506", "direct20", 0.0),
    ],
)
def test_tangents_agree_with_complex_step(mission, method, j2):
    mission = load_mission(mission)
    arrays = mission.arrays()
    arrays.environment["j2"] = j2
    problem = transcribe(arrays, mission.start().navigation()[0], method).problem
    n = problem.variables
    p = own_starts(transcribe(arrays, mission.start().navigation()[0], method), Deadline())[0]
    rng = np.random.default_rng(3)
    p[: n - 1 - len(problem.drops)] += 0.05 * rng.standard_normal(n - 1 - len(problem.drops))
    scratch = make_scratch(problem)
    evaluate_with_gradients(p, problem, scratch, make_point(problem))
    count = scratch.counts[BREAKS]

    exact = np.empty((6, n))
    at_drops = {d: np.empty((6, n)) for d in range(len(problem.drops))}
    for j in range(n):
        z = p.astype(complex)
        z[j] += 1j * STEP
        final, drops = plain_flight(z, problem, scratch.times, scratch.breaks, count)
        exact[:, j] = final.imag / STEP
        for d, state in drops.items():
            at_drops[d][:, j] = state.imag / STEP
    for found, wanted in [
        (scratch.final_tangents, exact),
        *((scratch.drop_tangents[d], wanted) for d, wanted in at_drops.items()),
    ]:
        scale = np.abs(wanted).max(axis=1, keepdims=True)
        assert np.abs((found - wanted) / scale).max() < 1e-8


def test_steps_are_fine_enough():
    # 0.05 kg of final mass are 0.17 ms of burning: 1.3 mm/s
    mission = load_mission("ares_v")
    start = mission.start().navigation()[0]
    coarse = transcribe(mission.arrays(), start, "direct11")
    fine = transcribe(mission.arrays(), start, "direct11", longest_step=1.0)
    p = own_starts(coarse, Deadline())[0]
    ends = []
    for problem in (coarse.problem, fine.problem):
        scratch = make_scratch(problem)
        evaluate(p, problem, scratch, make_point(problem))
        ends.append(scratch.final.copy())
    assert np.abs(ends[0][1:4] - ends[1][1:4]).max() < 0.05
    assert np.abs(ends[0][4:7] - ends[1][4:7]).max() < 1e-4
    assert ends[0][7] == pytest.approx(ends[1][7], abs=1e-9)


def test_constraint_rows_agree_with_differences():
    mission = load_mission("ares_v")
    arrays = mission.arrays()
    arrays.environment["density_factor"] = 2.1
    start = mission.start().navigation()[0]
    base = find_direct(arrays, start, "direct11")
    transcription = transcribe(arrays, start, "direct14", Heating.FROM_JETTISON)
    problem = transcription.problem
    p = carry_over(base, transcription)
    n = problem.variables
    scratch, point, other = make_scratch(problem), make_point(problem), make_point(problem)
    evaluate_with_gradients(p, problem, scratch, point)
    assert scratch.counts[LATER_PEAKS] == 1  # the heating rises again
    for j in range(n):
        values = []
        for step in (1e-5, -1e-5):
            q = p.copy()
            q[j] += step
            evaluate(q, problem, scratch, other)
            values.append(np.concatenate((other.equations, other.inequalities)))
        slope = (values[0] - values[1]) / 2e-5
        rows = np.concatenate((point.equation_rows[:, j], point.inequality_rows[:, j]))
        assert rows == pytest.approx(slope, rel=2e-6, abs=2e-6)


def test_gravity_gradient_with_j2():
    environment = load_mission("ares_v").arrays().environment
    environment["j2"] = 1.0826e-3
    r = np.array([-4.7e6, -3.0e6, 3.1e6])
    g, first, second = gravity_gradient(tuple(r), environment[0])
    assert np.array(g) == pytest.approx(gravity(r, environment[0]), rel=1e-14)
    matrix = [
        [first[0], first[1], first[2]],
        [first[1], second[0], second[1]],
        [first[2], second[1], second[2]],
    ]
    for j in range(3):
        z = r.astype(complex)
        z[j] += 1j * STEP
        exact = gravity(z, environment[0]).imag / STEP
        assert np.array(matrix)[:, j] == pytest.approx(exact, rel=1e-12, abs=1e-20)


def test_jump_jacobian_agrees_with_differences():
    arrays = load_mission("ares_v").arrays()
    x = np.array(
        [-4712742.0, -3042010.0, 3057430.0, 3564.8, -5100.4, -354.6]
        + [0.208, -0.802, 0.075, 8.1e-4, 7.4e-4, -5.7e-4, 4.597, 4.694]
    )
    jacobian = np.empty((JUMP_OUTPUTS, JUMP_INPUTS))
    jump_jacobian(x, arrays.environment[0], arrays.atmosphere, jacobian)
    for j in range(JUMP_INPUTS):
        h = 1e-6 * max(abs(x[j]), 1e-3)
        ends = []
        for step in (h, -h):
            moved = x.copy()
            moved[j] += step
            y = np.empty(JUMP_OUTPUTS)
            jump(moved, arrays.environment[0], arrays.atmosphere, y)
            ends.append(y)
        slope = (ends[0] - ends[1]) / (2 * h)
        scale = np.abs(slope) + 1e-6 * np.abs(jacobian).max(axis=1) + 1e-300
        assert np.abs((jacobian[:, j] - slope) / scale).max() < 1e-3


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_terminal_rows_agree_with_differences(kind):
    target = load_mission("delta_iii").arrays().target
    target["kind"] = kind
    target["radius"], target["speed"] = 6.6e6, 9.0e3
    target["flight_path_angle"] = 0.1
    mu = 3.986012e14
    state = np.array([2.1e6, -5.9e6, 1.9e6, 8.1e3, 4.2e3, -1.9e3])

    def rows(x):
        c, gradient = np.empty(MAX_ROWS), np.empty((MAX_ROWS, 6))
        count = terminal_rows(target[0], mu, tuple(x[:3]), tuple(x[3:]), c, gradient)
        return c[:count].copy(), gradient[:count].copy()

    values, gradient = rows(state)
    assert len(values) == (4, 5, 5)[kind]
    for j in range(6):
        h = 10.0 if j < 3 else 1e-2
        up, down = state.copy(), state.copy()
        up[j] += h
        down[j] -= h
        slope = (rows(up)[0] - rows(down)[0]) / (2 * h)
        assert gradient[:, j] == pytest.approx(slope, rel=1e-5, abs=1e-9 * np.abs(slope).max())


def test_equatorial_target_needs_two_rows_for_its_plane():
    target = load_mission("ares_v").arrays().target
    target["inclination"] = 0.0
    c, gradient = np.empty(MAX_ROWS), np.empty((MAX_ROWS, 6))
    r, v = (6.5e6, 0.0, 1e4), (100.0, 7.8e3, 5.0)
    count = terminal_rows(target[0], 3.986e14, r, v, c, gradient)
    assert count == 5
    assert np.linalg.matrix_rank(gradient[3:5]) == 2
    assert np.all(np.isfinite(gradient[:5]))


@pytest.mark.trial
def test_reduced_hessian_is_that_of_the_lagrangian():
    # along a direction of the null space, against second differences of the Lagrangian
    mission = load_mission("ares_v")
    transcription = transcribe(mission.arrays(), mission.start().navigation()[0], "direct14")
    found = run(transcription, own_starts(transcription, Deadline())[0], 1.0, Deadline())
    problem = transcription.problem
    p, n = found.variables, problem.variables
    scratch, point, other = make_scratch(problem), make_point(problem), make_point(problem)
    evaluate_with_gradients(p, problem, scratch, point)
    nu, mu = np.zeros(len(point.equations)), np.zeros(len(point.inequalities))
    estimate_multipliers(point, Multipliers(nu, mu))
    assert nu == pytest.approx(found.equations, rel=1e-6, abs=1e-8)
    base = np.empty(n)
    lagrangian_gradient(point, Multipliers(nu, mu), base)
    basis = np.linalg.svd(point.equation_rows)[2][len(nu) :].T.copy()
    z = basis.shape[1]
    workspace = Workspace(scratch, point, other)
    frame = Frame(basis, np.zeros(n), base)
    hessian, _ = reduced_hessian(p, problem, workspace, Multipliers(nu, mu), frame)

    def lagrangian(q):
        f = evaluate(q, problem, scratch, other)
        return f + nu @ other.equations + mu @ other.inequalities

    for k in range(z):
        h = 3e-4
        middle = lagrangian(p)
        bend = lagrangian(p + h * basis[:, k]) + lagrangian(p - h * basis[:, k]) - 2 * middle
        assert bend / h**2 == pytest.approx(hessian[k, k], rel=1e-2, abs=2e-5)

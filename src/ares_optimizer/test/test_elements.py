# SPDX-License-Identifier: Apache-2.0
"""Compare equivalent targets by elements, and test the elements left free."""

import math

import numpy as np
import pytest

from ares_models.mission import Mission, load_mission
from ares_models.orbits import Elements
from ares_optimizer.indirect.solve import solve_indirect
from ares_optimizer.indirect.solver import TwoPointOptions, TwoPointSolver
from ares_optimizer.kernels.terminal import MAX_ROWS, terminal_rows
from ares_optimizer.proof.physics import elements
from ares_optimizer.solution import Check
from ares_optimizer.solve import solve
from ares_optimizer.targets import figures_of, target_rows

MU = 3.986e14
EQUATOR = 6378140.0
GTO = {"perigee_altitude_m": 185e3, "apogee_altitude_m": 35786e3}
#: Each with the number of its rows.
TARGETS = (
    ({**GTO}, 2),
    ({**GTO, "inclination_deg": 28.5, "argument_of_perigee_deg": 140.0}, 4),
    ({**GTO, "ascending_node_deg": 114.0, "argument_of_perigee_deg": 140.0}, 4),
    (
        {
            **GTO,
            "inclination_deg": 28.5,
            "ascending_node_deg": 114.0,
            "argument_of_perigee_deg": 140.0,
            "true_anomaly_deg": 5.0,
        },
        6,
    ),
    ({**GTO, "inclination_deg": 28.5, "at": "apogee"}, 4),
    ({"perigee_altitude_m": 185e3, "c3_m2_s2": 0.0}, 2),
    ({"semi_major_axis_m": -4e8, "eccentricity": 1.02, "inclination_deg": 28.5}, 3),
    ({"apogee_altitude_m": 3e5, "true_anomaly_deg": 170.0}, 2),
    ({"semi_major_axis_m": 7e6}, 1),
    ({"perigee_altitude_m": 185e3}, 3),
    ({"perigee_altitude_m": 185e3, "apogee_altitude_m": 185e3, "ascending_node_deg": 114.0}, 4),
)


def aimed(name="ares_v", **target):
    return Mission.model_validate(load_mission(name).model_dump() | {"target": target})


def best(name="ares_v", **target):
    mission = aimed(name, **target)
    solution = solve_indirect(mission.arrays(), mission.start().navigation())
    assert solution.converged, solution.reason
    assert all(check.satisfied for check in solution.constraints)
    return solution


@pytest.mark.parametrize(("target", "count"), TARGETS)
def test_rows_agree_with_differences(target, count):
    record = aimed(**target).arrays().target
    state = np.array([-2.1e6, -5.9e6, 1.9e6, 8.1e3, -4.2e3, -1.9e3])

    def rows(x):
        c, gradient = np.empty(MAX_ROWS), np.empty((MAX_ROWS, 6))
        found = terminal_rows(record[0], MU, tuple(x[:3]), tuple(x[3:]), c, gradient)
        return c[:found].copy(), gradient[:found].copy()

    values, gradient = rows(state)
    assert len(values) == count == np.linalg.matrix_rank(gradient * ([1e6] * 3 + [1e3] * 3))
    for j in range(6):
        h = 10.0 if j < 3 else 1e-2
        up, down = state.copy(), state.copy()
        up[j] += h
        down[j] -= h
        slope = (rows(up)[0] - rows(down)[0]) / (2 * h)
        assert gradient[:, j] == pytest.approx(slope, rel=1e-5, abs=1e-8 * np.abs(gradient).max())


@pytest.mark.parametrize(
    "target", [target for target, _ in TARGETS if len(target) > 1 and "at" not in target]
)
def test_a_state_with_the_elements_meets_every_row(target):
    record = aimed(**target).arrays().target
    orbit = record[0]
    parameter = float(orbit["perigee_radius"] * (1.0 + orbit["eccentricity"]))
    anomaly = float(orbit["true_anomaly"]) if "true_anomaly_deg" in target else 0.6
    angles = (0.5, float(orbit["ascending_node"]), float(orbit["argument_of_perigee"]))
    if "inclination_deg" in target:
        angles = (float(orbit["inclination"]), *angles[1:])
    e = float(orbit["eccentricity"])
    if e == 1.0:
        # a parabola has no semi-major axis: nearly one
        e += 1e-12
    r, v = Elements(parameter / (1.0 - e * e), e, *angles, anomaly).state(MU)
    c = np.empty(MAX_ROWS)
    count = terminal_rows(orbit, MU, tuple(r), tuple(v), c, np.empty((MAX_ROWS, 6)))
    assert np.abs(c[:count]).max() < 1e-8
    # and the proof's own elements say the same
    proven = elements(r, v, MU)
    found = figures_of(orbit, r, v, MU)
    for row, figure in zip(target_rows(orbit), found, strict=True):
        wanted = float(orbit[row.key])
        wanted = math.degrees(wanted) if row.unit == "deg" else wanted
        size = abs(wanted) if abs(wanted) > 1.0 else 1e7
        assert figure == pytest.approx(wanted, abs=1e-8 * size)
        assert proven[row.key] % 360.0 == pytest.approx(figure % 360.0, abs=1e-8 * size)


def test_the_plane_of_the_equator_needs_two_rows():
    record = aimed(**GTO, inclination_deg=28.5).arrays().target
    record["inclination"] = 0.0
    c, gradient = np.empty(MAX_ROWS), np.empty((MAX_ROWS, 6))
    count = terminal_rows(record[0], MU, (6.5e6, 0.0, 1e4), (100.0, 7.8e3, 5.0), c, gradient)
    assert count == 4
    assert np.linalg.matrix_rank(gradient[2:4]) == 2


@pytest.mark.parametrize(
    "target",
    [
        {**GTO, "inclination_deg": 28.5},
        {**GTO},
        {"perigee_altitude_m": 185e3, "c3_m2_s2": 1e6, "true_anomaly_deg": 5.0},
        {"perigee_altitude_m": 185e3, "apogee_altitude_m": 185e3, "ascending_node_deg": 114.0},
    ],
)
def test_jacobian_at_the_root_agrees_with_differences(target):
    mission = aimed(**target)
    solver = TwoPointSolver(mission.arrays(), TwoPointOptions())
    start = mission.start().navigation()
    root = solver.solve(start)
    assert root.converged
    _, jacobian, _ = solver.shoot(start, root.unknowns)
    for c, h in enumerate((1e-6,) * 3 + (1e-9,) * 3 + (1e-4,)):
        sides = []
        for sign in (1.0, -1.0):
            moved = root.unknowns.copy()
            moved[c] += sign * h
            sides.append(solver.shoot(start, moved)[0])
        slope = (sides[0] - sides[1]) / (2.0 * h)
        assert jacobian[:, c] == pytest.approx(slope, abs=3e-5 * np.abs(jacobian[:, c]).max())


def test_a_circle_is_a_radius_a_speed_and_no_angle():
    radius = EQUATOR + 185e3
    state = {
        "radius_m": radius,
        "speed_m_s": math.sqrt(MU / radius),
        "flight_path_angle_deg": 0.0,
        "inclination_deg": 28.5,
    }
    same = best(**state).m_f_kg
    circle = {"apogee_altitude_m": 185e3, "inclination_deg": 28.5}
    assert best(perigee_radius_m=radius, **circle).m_f_kg == pytest.approx(same, abs=1e-9)
    # a perigee alone requires it too
    assert best(perigee_radius_m=radius, inclination_deg=28.5).m_f_kg == pytest.approx(same, 1e-12)
    # by its rows, in a named plane
    node = best(**state).verification.ascending_node_deg
    free = best(perigee_radius_m=radius, ascending_node_deg=node)
    assert free.m_f_kg == pytest.approx(same, abs=2e-3)


def test_the_thesis_target_by_elements():
    state = load_mission("ares_v").target
    orbit = Elements.from_state(
        *state_at(state.radius_m, state.speed_m_s, math.radians(state.flight_path_angle_deg)), MU
    )
    again = best(
        perigee_radius_m=orbit.perigee_radius,
        apogee_radius_m=orbit.apogee_radius,
        inclination_deg=28.5,
        true_anomaly_deg=math.degrees(orbit.true_anomaly),
    )
    assert again.m_f_kg == pytest.approx(174183.114, abs=0.1)
    assert again.m_f_kg == pytest.approx(best(**state.model_dump()).m_f_kg, abs=1e-3)


def state_at(radius, speed, angle):
    return [radius, 0.0, 0.0], [speed * math.sin(angle), speed * math.cos(angle), 0.0]


def test_perigee_is_a_radius_a_speed_and_no_angle():
    r, apogee = EQUATOR + 185e3, EQUATOR + 35786e3
    speed = math.sqrt(2.0 * MU * apogee / (r * (r + apogee)))
    state = best(radius_m=r, speed_m_s=speed, flight_path_angle_deg=0.0, inclination_deg=28.5)
    there = best(**GTO, inclination_deg=28.5, at="perigee")
    assert there.m_f_kg == pytest.approx(state.m_f_kg, abs=1e-3)


def test_delta_iii_in_other_words():
    known = load_mission("delta_iii")
    orbit = known.target
    a, e = orbit.semi_major_axis_m, orbit.eccentricity
    mu = known.environment.mu_m3_s2
    angles = {
        "inclination_deg": orbit.inclination_deg,
        "ascending_node_deg": orbit.ascending_node_deg,
        "argument_of_perigee_deg": orbit.argument_of_perigee_deg,
    }
    same = best("delta_iii", **orbit.model_dump()).m_f_kg
    assert same == pytest.approx(7529.712, abs=0.01)
    for sizes in (
        {"perigee_radius_m": a * (1.0 - e), "apogee_radius_m": a * (1.0 + e)},
        {"c3_m2_s2": -mu / a, "eccentricity": e},
        {"semi_major_axis_m": a, "perigee_radius_m": a * (1.0 - e)},
    ):
        assert best("delta_iii", **sizes, **angles).m_f_kg == pytest.approx(same, abs=1e-3)


def test_an_element_set_free_loses_no_mass():
    sizes = {"semi_major_axis_m": 24361140.0, "eccentricity": 0.7308}
    angles = {
        "inclination_deg": 28.5,
        "ascending_node_deg": 269.8,
        "argument_of_perigee_deg": 130.5,
    }
    # 0.1 deg from the end of the free optimum
    masses = [best("delta_iii", **sizes, **angles, true_anomaly_deg=6.883).m_f_kg]
    masses.append(best("delta_iii", **sizes, **angles).m_f_kg)
    for freed in ("argument_of_perigee_deg", "ascending_node_deg", "inclination_deg"):
        angles.pop(freed)
        masses.append(best("delta_iii", **sizes, **angles).m_f_kg)
    gains = np.diff(masses)
    assert gains.min() > -1e-6
    assert gains[0] > 1.0
    assert gains[1] > 0.05


def test_escape_by_energy_and_by_a_negative_axis():
    plane = {"inclination_deg": 28.5}
    c3 = 1.1e6
    one = best(perigee_altitude_m=185e3, c3_m2_s2=c3, **plane)
    other = best(perigee_altitude_m=185e3, semi_major_axis_m=-MU / c3, **plane)
    assert other.m_f_kg == pytest.approx(one.m_f_kg, abs=1e-3)
    # continuous from ellipse to hyperbola
    below, at, above = (
        best(perigee_altitude_m=185e3, c3_m2_s2=x, **plane).m_f_kg for x in (-1e4, 0.0, 1e4)
    )
    assert below - at == pytest.approx(at - above, rel=1e-2)
    assert below > at


def test_the_worth_of_an_element_is_what_the_mass_does():
    plane = {"inclination_deg": 28.5}
    middle = best(**GTO, **plane)
    worth = {check.key: check.multiplier for check in middle.constraints}
    for key, check, step in (
        ("perigee_altitude_m", Check.PERIGEE_RADIUS, 100.0),
        ("apogee_altitude_m", Check.APOGEE_RADIUS, 1e4),
    ):
        sides = [best(**GTO | {key: GTO[key] + x}, **plane).m_f_kg for x in (step, -step)]
        assert worth[check] == pytest.approx((sides[0] - sides[1]) / (2 * step), rel=1e-3)


@pytest.mark.parametrize("method", ["indirect", "direct11"])
@pytest.mark.parametrize(
    "target",
    [
        {**GTO, "inclination_deg": 28.5},
        {**GTO, "inclination_deg": 28.5, "argument_of_perigee_deg": 140.0},
        {"perigee_altitude_m": 185e3, "apogee_altitude_m": 200e3, "at": "perigee"},
        {"perigee_altitude_m": 185e3, "c3_m2_s2": 0.0, "inclination_deg": 28.5},
    ],
)
def test_both_methods_prove_the_same_optimum(method, target):
    solution = solve(aimed(**target), method)
    assert solution.converged, solution.reason
    # a linear-tangent law per arc comes within 1e-5
    assert solution.m_f_kg == pytest.approx(best(**target).m_f_kg, rel=1e-5)
    rows = {check.key for check in solution.constraints if check.active}
    assert {row.key for row in target_rows(aimed(**target).arrays().target[0])} <= rows


@pytest.mark.parametrize("apogee_altitude_m", [185.3e3, 188e3, 193e3, 215e3])
def test_a_nearly_circular_orbit_is_reached_from_a_longer_one(apogee_altitude_m):
    target = {"perigee_altitude_m": 185e3, "apogee_altitude_m": apogee_altitude_m}
    mission = aimed("delta_iii", **target)
    record = mission.arrays().target.copy()
    arrays = mission.arrays()
    found = solve_indirect(arrays, mission.start().navigation())
    assert found.converged, found.reason
    assert arrays.target == record
    circle = best("delta_iii", perigee_altitude_m=185e3).m_f_kg
    # to cut off above the perigee of a slightly longer orbit is a little better than a circle
    assert -1.0 < circle - found.m_f_kg < 60.0

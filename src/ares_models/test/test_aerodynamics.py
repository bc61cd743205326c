# SPDX-License-Identifier: Apache-2.0
"""Forces of the air on the body, by drag and lift or by axial and normal force."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ares_models.kernels.aerodynamics import body_force, body_force_with_gradient
from ares_models.kernels.environment import air_velocity, altitude_gradient
from ares_models.mission import MissionError, parse_mission

MISSION = """
name: body
title: made up
source: made up
payload_kg: 100.0
environment:
  mu_m3_s2: 3.986004418e14
  earth:
    equatorial_radius_m: 6378137.0
    polar_radius_m: 6356752.3
    rotation_rate_rad_s: 7.292115e-5
    zero_longitude_deg: 0.0
  atmosphere:
    model: us76
    wind_table: [[0.0, 5.0, 3.0], [12000.0, 40.0, -10.0]]
aerodynamics:
  reference_area_m2: 2.0
  {tables}
initial_state: {{time_s: 0.0, geodetic_latitude_deg: 5.0, longitude_deg: 10.0, altitude_m: 0.0}}
stages:
  - name: only
    dry_mass_kg: 500.0
    propellant_kg: 5000.0
    arcs:
      - {{thrust_n: 90000.0, isp_s: 300.0, burn_time_s: 60.0}}
      - {{coast_s: 10.0}}
      - {{thrust_n: 90000.0, isp_s: 300.0, burn_time_s: free}}
target: {{perigee_altitude_m: 200000.0, inclination_deg: 60.0}}
"""
FORMS = {
    "drag": "drag_table: [[0.0, 0.3], [1.0, 0.6], [3.0, 0.35]]",
    "drag and lift": """drag_table: [[0.0, 0.3], [1.0, 0.6], [3.0, 0.35]]
  lift_table: [[0.0, 2.5], [1.2, 3.5], [4.0, 2.0]]""",
    "axial": "axial_table: [[0.0, 0.3], [1.0, 0.6], [3.0, 0.35]]",
    "axial and normal": """axial_table: [[0.0, 0.3], [1.0, 0.6], [3.0, 0.35]]
  normal_table: [[0.0, 2.5], [1.2, 3.5], [4.0, 2.0]]
  power_off_table: [[0.0, 0.9]]""",
}
#: At 9 km and 1.1 times the speed of sound, thrust off the velocity.
POSITION = np.array([6_340_000.0, 600_000.0, 640_000.0])
VELOCITY = np.array([260.0, 620.0, 150.0])


def arrays(tables: str) -> Any:
    return parse_mission(MISSION.format(tables=tables), "x.yaml").arrays()


def force(made: Any, arc: int, r: Any, v: Any, u: Any) -> NDArray[np.float64]:
    state = (tuple(map(float, part)) for part in (r, v, u))
    return np.array(body_force(made.arcs[arc], *state, made.environment[0], made.atmosphere))


def stream_and_thrust(made: Any, angle_deg: float) -> tuple[Any, Any, Any]:
    """Return the velocity in the air, and the thrust at an angle off it, with a unit vector across.

    All of them are unit vectors but the first.
    """
    w = np.array(air_velocity(tuple(POSITION), tuple(VELOCITY), made.environment[0]))
    along = w / np.linalg.norm(w)
    across = np.cross(along, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    angle = math.radians(angle_deg)
    return w, math.cos(angle) * along + math.sin(angle) * across, across


@pytest.mark.parametrize("tables", FORMS.values(), ids=FORMS)
def test_gradients_are_those_of_differences(tables: str) -> None:
    made = arrays(tables)
    _, u, _ = stream_and_thrust(made, 11.0)
    place, velocity = tuple(POSITION.tolist()), tuple(VELOCITY.tolist())
    environment = made.environment[0]
    up = altitude_gradient(place, environment)
    found = body_force_with_gradient(
        made.arcs[0], place, velocity, tuple(u.tolist()), up, environment, made.atmosphere
    )
    assert found.force == pytest.approx(force(made, 0, POSITION, VELOCITY, u))
    given = {
        "position": (found.by_x, found.by_y, found.by_z),
        "velocity": (found.by_u, found.by_v, found.by_w),
        "direction": found.turned,
    }
    state = {"position": POSITION, "velocity": VELOCITY, "direction": u}
    for name, step in (("position", 1.0), ("velocity", 1e-3), ("direction", 1e-6)):
        for i in range(3):
            moved = []
            for side in (step, -step):
                there = {key: value.copy() for key, value in state.items()}
                there[name][i] += side
                moved.append(force(made, 0, *there.values()))
            difference = (moved[0] - moved[1]) / (2.0 * step)
            scale = np.abs(given[name]).max() + 1e-12
            assert given[name][i] == pytest.approx(difference, abs=2e-5 * scale)


def test_lift_is_across_the_air_and_drag_along_it() -> None:
    plain, lifted = arrays(FORMS["drag"]), arrays(FORMS["drag and lift"])
    w, u, across = stream_and_thrust(lifted, 10.0)
    drag = force(plain, 0, POSITION, VELOCITY, u)
    lift = force(lifted, 0, POSITION, VELOCITY, u) - drag
    assert drag == pytest.approx(-np.linalg.norm(drag) * w / np.linalg.norm(w))
    assert lift @ w == pytest.approx(0.0, abs=1e-6)
    # to the side to which the body points
    assert lift @ across == pytest.approx(np.linalg.norm(lift))
    _, twice, _ = stream_and_thrust(
        lifted, math.degrees(math.asin(2.0 * math.sin(math.radians(10.0))))
    )
    assert np.linalg.norm(force(lifted, 0, POSITION, VELOCITY, twice) - drag) == pytest.approx(
        2.0 * np.linalg.norm(lift)
    )


def test_axial_force_is_along_the_body_and_normal_force_across_it() -> None:
    bare, whole = arrays(FORMS["axial"]), arrays(FORMS["axial and normal"])
    w, u, across = stream_and_thrust(whole, 10.0)
    axial = force(bare, 0, POSITION, VELOCITY, u)
    assert axial == pytest.approx(-np.linalg.norm(axial) * u)
    normal = force(whole, 0, POSITION, VELOCITY, u) - axial
    assert normal @ u == pytest.approx(0.0, abs=1e-6)
    # away from where the air comes from: with the nose up, upwards
    assert normal @ across > 0.0
    along, _, _ = (part / np.linalg.norm(part) for part in (w, u, across))
    head_on = force(arrays(FORMS["drag"]), 0, POSITION, VELOCITY, along)
    assert force(whole, 0, POSITION, VELOCITY, along) == pytest.approx(head_on)


def test_coast_is_along_the_air_with_its_own_table() -> None:
    made = arrays(FORMS["axial and normal"])
    w, u, _ = stream_and_thrust(made, 10.0)
    coasting = force(made, 1, POSITION, VELOCITY, u)
    burning = force(arrays(FORMS["drag"]), 0, POSITION, VELOCITY, u)
    assert coasting == pytest.approx(-np.linalg.norm(coasting) * w / np.linalg.norm(w))
    # 0.9 in a coast; near Mach 2 the other table is monotone between 0.6 and 0.35
    share = np.linalg.norm(coasting) / np.linalg.norm(burning)
    assert 0.9 / 0.6 < share < 0.9 / 0.35


@pytest.mark.parametrize(
    ("tables", "told"),
    [
        ("lift_table: [[0, 2]]", "aerodynamics.drag_table is missing; expected a table"),
        (
            "drag_table: [[0, 0.3]]\n  axial_table: [[0, 0.3]]",
            "aerodynamics.drag_table is a list of 1; expected no such key beside axial_table",
        ),
        (
            "drag_table: [[0, 0.3]]\n  normal_table: [[0, 2]]",
            "normal_table is .*; expected no such key beside drag_table",
        ),
        (
            "axial_table: [[0, 0.3]]\n  normal_table: [[1, 2], [0.5, 3]]",
            "normal_table.* expected",
        ),
        ("axial_table: [[0, 0.3]]\n  power_off_table: [[0, 200]]", "power_off_table.* to 100"),
    ],
)
def test_wrong_tables_are_refused(tables: str, told: str) -> None:
    with pytest.raises(MissionError, match=told):
        arrays(tables)

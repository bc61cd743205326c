# SPDX-License-Identifier: Apache-2.0
"""Frames, rotations and the path, without ROS."""

import numpy as np
import pytest

from ares_view.standard.frames import quaternion, start_axes, turn_rate, vehicle_axes
from ares_view.standard.trail import Trail

SECOND = 1_000_000_000


def rotated(vector, q):
    """Rotate a vector into the parent, by the definition of the quaternion product."""
    *axis, w = q
    axis = np.array(axis)
    return vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector)


def random_rotations():
    rng = np.random.default_rng(5)
    for _ in range(100):
        q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        yield q * np.sign(np.linalg.det(q))
    # half turns, where three of four components are zero
    for k in range(3):
        signs = [-1.0, -1.0, -1.0]
        signs[k] = 1.0
        yield np.diag(signs)
    yield np.eye(3)


def test_a_quaternion_turns_as_its_matrix():
    for matrix in random_rotations():
        q = quaternion(matrix)
        assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-14)
        assert q[3] >= 0.0
        for vector in np.eye(3):
            assert rotated(vector, q) == pytest.approx(matrix @ vector, abs=1e-12)


def test_the_vehicle_flies_along_x_with_z_up():
    # over the equator, eastward, thrust 30 deg above the horizon
    thrust = np.array([0.5, np.sqrt(0.75), 0.0])
    axes = vehicle_axes([7e6, 0.0, 0.0], [100.0, 7000.0, 0.0], thrust)
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[:, 0] == pytest.approx(thrust)
    assert axes[:, 1] == pytest.approx([0.0, 0.0, 1.0])
    assert axes[:, 2] @ [1.0, 0.0, 0.0] > 0.8


@pytest.mark.parametrize("thrust", [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
def test_every_direction_of_thrust_has_axes(thrust):
    axes = vehicle_axes([7e6, 0.0, 0.0], [0.0, 7000.0, 0.0], thrust)
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-14)
    assert axes[:, 0] == pytest.approx(thrust)


def test_the_start_looks_east_north_up():
    east, north, up = start_axes(0.0, 90.0).T
    assert east == pytest.approx([-1.0, 0.0, 0.0], abs=1e-15)
    assert north == pytest.approx([0.0, 0.0, 1.0], abs=1e-15)
    assert up == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)


def test_the_turn_of_a_direction():
    x, y = np.eye(3)[:2]
    assert turn_rate(x, y, 2.0) == pytest.approx([0.0, 0.0, np.pi / 4])
    assert not turn_rate(x, x, 2.0).any()
    assert not turn_rate(x, y, 0.0).any()


def test_a_trail_is_bounded_and_goes_all_the_way():
    trail = Trail(100)
    for step in range(100_000):
        trail.offer(step * SECOND // 10, lambda step=step: step / 10)
        assert len(trail.points) <= 100
    assert trail.points[0] == 0.0
    assert trail.points[-1] > 9_700.0
    gaps = np.diff(trail.points)
    assert len(trail.points) > 45
    assert gaps == pytest.approx(gaps[0])


def test_a_trail_takes_a_point_a_second_first():
    trail = Trail(1000)
    taken = [trail.offer(step * SECOND // 4, lambda: 0) for step in range(9)]
    assert taken == [True, False, False, False] * 2 + [True]

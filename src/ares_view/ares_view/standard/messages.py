# SPDX-License-Identifier: Apache-2.0
"""Convert states and events of a flight to standard ROS messages."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import (
    Point,
    PoseStamped,
    Quaternion,
    TransformStamped,
    TwistStamped,
    Vector3,
)
from nav_msgs.msg import Path
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import ColorRGBA, Header
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from ares_models.earth import Earth
from ares_models.frames import Matrix, earth_fixed_from_inertial
from ares_models.geodesy import earth_fixed_place, geodetic
from ares_node.time import NANOSECONDS, stamp_from_ns
from ares_view.standard.frames import EARTH, Array, Frames, quaternion, start_axes, vehicle_axes

#: Lengths in the 3D view, m: arrow along the thrust, letters of an event.
ARROW_LENGTH = 400e3
LETTERS = 50e3

_OCEAN = ColorRGBA(r=0.16, g=0.35, b=0.55, a=1.0)
_FLAME = ColorRGBA(r=1.0, g=0.55, b=0.1, a=1.0)
_COAST = ColorRGBA(r=0.65, g=0.65, b=0.65, a=1.0)
_INK = ColorRGBA(r=0.95, g=0.95, b=0.95, a=1.0)


def header(stamp_ns: int, frame: str) -> Header:
    """Make a header with a flight time in ns."""
    return Header(stamp=stamp_from_ns(stamp_ns), frame_id=frame)


def _vector(values: Sequence[float] | Array) -> Vector3:
    x, y, z = (float(value) for value in values)
    return Vector3(x=x, y=y, z=z)


def _point(values: Sequence[float] | Array) -> Point:
    x, y, z = (float(value) for value in values)
    return Point(x=x, y=y, z=z)


def _rotation(matrix: Matrix) -> Quaternion:
    x, y, z, w = quaternion(matrix)
    return Quaternion(x=x, y=y, z=z, w=w)


def _transform(
    stamp_ns: int, parent: str, child: str, origin: Sequence[float] | Array, axes: Matrix
) -> TransformStamped:
    """Make the transform of a frame: its origin and axes in components of the parent."""
    message = TransformStamped(header=header(stamp_ns, parent), child_frame_id=child)
    message.transform.translation = _vector(origin)
    message.transform.rotation = _rotation(axes)
    return message


def moving_frames(frames: Frames, stamp_ns: int, state: Any, earth: Earth) -> TFMessage:
    """Make the transforms of the inertial frame in the Earth's, and of the vehicle in the inertial.

    Args:
        frames: names of the flight's frames.
        stamp_ns: flight time, ns.
        state: record with the fields of VehicleState.
        earth: of the mission.
    """
    turned = earth_fixed_from_inertial(
        stamp_ns / NANOSECONDS, earth.rotation_rate, earth.angle_at_zero
    )
    axes = vehicle_axes(state["position"], state["velocity"], state["thrust_direction"])
    return TFMessage(
        transforms=[
            _transform(stamp_ns, EARTH, frames.eci, (0.0, 0.0, 0.0), turned),
            _transform(stamp_ns, frames.eci, frames.vehicle, state["position"], axes),
        ]
    )


def fixed_frames(frames: Frames, stamp_ns: int, state: Any, earth: Earth) -> TFMessage:
    """Make the transform of the launch frame from the first state; see `moving_frames`."""
    place = fix(frames, stamp_ns, state, earth)
    origin = earth_fixed_place(place.latitude, place.longitude, 0.0, earth)
    axes = start_axes(place.latitude, place.longitude)
    return TFMessage(transforms=[_transform(stamp_ns, EARTH, frames.start, origin, axes)])


def pose(frames: Frames, stamp_ns: int, state: Any) -> PoseStamped:
    """Make the position and axes of the vehicle in the inertial frame."""
    message = PoseStamped(header=header(stamp_ns, frames.eci))
    axes = vehicle_axes(state["position"], state["velocity"], state["thrust_direction"])
    message.pose.position = _point(state["position"])
    message.pose.orientation = _rotation(axes)
    return message


def twist(frames: Frames, stamp_ns: int, state: Any, turn: Array) -> TwistStamped:
    """Make the inertial velocity and the rate of the thrust axis, in inertial components.

    Args:
        frames: names of the flight's frames.
        stamp_ns: flight time, ns.
        state: record with the fields of VehicleState.
        turn: angular velocity, shape (3,), rad/s.
    """
    message = TwistStamped(header=header(stamp_ns, frames.eci))
    message.twist.linear = _vector(state["velocity"])
    message.twist.angular = _vector(turn)
    return message


def fix(frames: Frames, stamp_ns: int, state: Any, earth: Earth) -> NavSatFix:
    """Make the geodetic position on the mission's ellipsoid; its covariance is unknown."""
    time, position = np.array([stamp_ns / NANOSECONDS]), np.array([state["position"]])
    place = geodetic(time, position, earth)
    return NavSatFix(
        header=header(stamp_ns, frames.vehicle),
        status=NavSatStatus(status=NavSatStatus.STATUS_FIX, service=NavSatStatus.SERVICE_GPS),
        latitude=float(place.latitude_deg[0]),
        longitude=float(place.longitude_deg[0]),
        altitude=float(place.height_m[0]),
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_UNKNOWN,
    )


def path(frames: Frames, stamp_ns: int, points: Sequence[PoseStamped]) -> Path:
    """Make the trajectory so far, in the inertial frame."""
    return Path(header=header(stamp_ns, frames.eci), poses=list(points))


# ---- markers


def _marker(stamp_ns: int, frame: str, space: str, number: int, kind: int) -> Marker:
    message = Marker(header=header(stamp_ns, frame), ns=space, id=number, type=kind)
    message.action = Marker.ADD
    message.pose.orientation.w = 1.0
    message.frame_locked = True
    return message


def nothing(frames: Frames, stamp_ns: int) -> Marker:
    """Make a marker that deletes all markers of a previous flight."""
    return Marker(header=header(stamp_ns, frames.eci), action=Marker.DELETEALL)


def globe(stamp_ns: int, earth: Earth) -> Marker:
    """Make the marker of the mission's ellipsoid."""
    message = _marker(stamp_ns, EARTH, "earth", 0, Marker.SPHERE)
    wide, high = 2.0 * earth.equatorial_radius, 2.0 * earth.polar_radius
    message.scale = _vector((wide, wide, high))
    message.color = _OCEAN
    return message


def arrow(frames: Frames, stamp_ns: int, burns: bool) -> Marker:
    """Make the marker of the vehicle: an arrow along its thrust, grey while no engine burns."""
    message = _marker(stamp_ns, frames.vehicle, "vehicle", 0, Marker.ARROW)
    message.scale = _vector((ARROW_LENGTH, 0.15 * ARROW_LENGTH, 0.15 * ARROW_LENGTH))
    message.color = _FLAME if burns else _COAST
    return message


def label(
    frames: Frames, stamp_ns: int, number: int, position: Sequence[float], text: str
) -> Marker:
    """Make the marker of an event: its text at its position."""
    message = _marker(stamp_ns, frames.eci, "events", number, Marker.TEXT_VIEW_FACING)
    message.pose.position = _point(position)
    message.scale.z = LETTERS
    message.color = _INK
    message.text = text
    return message

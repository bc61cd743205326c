# SPDX-License-Identifier: Apache-2.0
"""Locate the peaks of the heating after the jettison."""

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.environment import log_heating
from ares_models.kernels.vectors import Vector, add, axpy, load, scale, sub
from ares_optimizer.direct.kernels.scratch import N_ACCELERATION, N_POSITION, N_TIME, N_VELOCITY
from ares_optimizer.kernels.algebra import Array

_BISECTIONS = 40


@kernel
def _cubic(x: float, a: Vector, b: Vector, c: Vector, d: Vector) -> Vector:
    """Return a + b x + c x^2 + d x^3."""
    return axpy(x, axpy(x, axpy(x, d, c), b), a)


@kernel
def between_nodes(a: Array, b: Array, x: float) -> tuple[Vector, Vector, Vector]:
    """Interpolate position, velocity and acceleration within a step by a quintic.

    Args:
        a: node at the begin of the step, shape (N_COLUMNS,); its state is met exactly.
        b: node at the end, likewise.
        x: fraction of the step.
    """
    h = b[N_TIME] - a[N_TIME]
    r0 = load(a[N_POSITION:])
    v0 = scale(h, load(a[N_VELOCITY:]))
    a0 = scale(0.5 * h * h, load(a[N_ACCELERATION:]))
    v1 = scale(h, load(b[N_VELOCITY:]))
    a1 = scale(h * h, load(b[N_ACCELERATION:]))
    # error of the quadratic from the left at the right node
    e0 = sub(load(b[N_POSITION:]), add(r0, add(v0, a0)))
    e1 = sub(v1, add(v0, scale(2.0, a0)))
    e2 = sub(a1, scale(2.0, a0))
    c3 = add(scale(10.0, e0), add(scale(-4.0, e1), scale(0.5, e2)))
    c4 = add(scale(-15.0, e0), add(scale(7.0, e1), scale(-1.0, e2)))
    c5 = add(scale(6.0, e0), add(scale(-3.0, e1), scale(0.5, e2)))
    position = add(r0, scale(x, add(v0, scale(x, _cubic(x, a0, c3, c4, c5)))))
    velocity = add(
        v0, scale(x, _cubic(x, scale(2.0, a0), scale(3.0, c3), scale(4.0, c4), scale(5.0, c5)))
    )
    acceleration = _cubic(x, scale(2.0, a0), scale(6.0, c3), scale(12.0, c4), scale(20.0, c5))
    return position, scale(1.0 / h, velocity), scale(1.0 / (h * h), acceleration)


@kernel
def heating_at_node(node: Array, environment: Record, atmosphere: Array) -> tuple[float, float]:
    """Return log heating and its rate, 1/s, at a node."""
    return log_heating(
        load(node[N_POSITION:]),
        load(node[N_VELOCITY:]),
        environment,
        atmosphere,
        load(node[N_ACCELERATION:]),
    )


@kernel
def heating_peaks(
    nodes: Array,
    count: int,
    after: float,
    environment: Record,
    atmosphere: Array,
    peaks: Array,
) -> int:
    """Find the times of the local maxima of the heating after a given time.

    Args:
        nodes: shape (k, N_COLUMNS), ends of the integration steps.
        count: nodes in use.
        after: s, same clock as the nodes.
        environment, atmosphere: of the mission.
        peaks: shape (p,), written: times, s, ascending. The end of the flight is a peak if the
            heating rises there. Peaks after the first p are left out.

    Returns:
        number of peaks.
    """
    found = 0
    for i in range(count):
        if nodes[i, N_TIME] < after:
            continue
        if found == peaks.size:
            break
        _, slope = heating_at_node(nodes[i], environment, atmosphere)
        if slope <= 0.0:
            continue
        if i == count - 1:
            peaks[found] = nodes[i, N_TIME]
            found += 1
            break
        if nodes[i + 1, N_TIME] <= nodes[i, N_TIME]:
            # two nodes at an event: the heating may peak at the discontinuity
            _, next_slope = heating_at_node(nodes[i + 1], environment, atmosphere)
            if next_slope <= 0.0:
                peaks[found] = nodes[i, N_TIME]
                found += 1
            continue
        _, next_slope = heating_at_node(nodes[i + 1], environment, atmosphere)
        if next_slope > 0.0:
            continue
        low = 0.0
        high = 1.0
        for _ in range(_BISECTIONS):
            x = 0.5 * (low + high)
            r, v, a = between_nodes(nodes[i], nodes[i + 1], x)
            _, slope = log_heating(r, v, environment, atmosphere, a)
            if slope > 0.0:
                low = x
            else:
                high = x
        peaks[found] = nodes[i, N_TIME] + low * (nodes[i + 1, N_TIME] - nodes[i, N_TIME])
        found += 1
    return found

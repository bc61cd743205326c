# SPDX-License-Identifier: Apache-2.0
"""Measured thrust and mass flow over the mission's, from one cycle to the next."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import Onboard
from ares_models.arrays import BURN, Record
from ares_models.jit import kernel
from ares_models.kernels.throttle import FULL, throttle_regime
from ares_models.kernels.thrust_curve import start_length, tail_length
from ares_models.kernels.vectors import load, norm, store, sub

#: Shortest measurement, s; noise dominates a shorter one.
SHORTEST = 0.5
#: Latest full thrust after the ignition command, s, with a delayed start.
LATEST = 3.0
#: Deviation of a ratio from 1 that is rounding.
SAME = 2e-5
#: A larger change of a ratio is a failure and taken at once; a smaller one is filtered.
STEP = 0.03
GAIN = 0.3
LOWEST, HIGHEST = 0.2, 2.0


@kernel
def burns_steadily(nav: Record, since: float, arcs: NDArray[Any]) -> bool:
    """Return whether only the present arc has burnt, at full thrust, since time ``since``, s."""
    arc = arcs[nav.arc]
    begun = nav.arc_start_time
    if math.isfinite(arc.max_acceleration):
        kind, _ = throttle_regime(arc, (arc.exhaust_velocity, arc.mass_flow), nav.mass)
        if kind != FULL:
            return False
    if arc.kind != BURN or since < begun + max(LATEST, start_length(arc)):
        return False
    return nav.arc == 0 or since >= begun + tail_length(arcs[nav.arc - 1])


@kernel
def filter_ratio(before: float, measured: float) -> float:
    """Filter a ratio with a new measurement."""
    if not LOWEST <= measured <= HIGHEST:
        return before
    if abs(measured - 1.0) < SAME:
        measured = 1.0
    if abs(measured - before) > STEP or measured == 1.0:
        return measured
    return before + GAIN * (measured - before)


@kernel
def begin_stage(arcs: NDArray[Any], onboard: Onboard) -> None:
    """Set the ratios to 1 where none is known of the present stage.

    Args: as in :func:`watch_engines`.
    """
    state = onboard.state
    if state.thrust_ratio == 0.0 or arcs[onboard.navigation.arc].stage != state.engines.stage:
        state.thrust_ratio = 1.0
        state.flow_ratio = 1.0


@kernel
def measures_one_burn(arcs: NDArray[Any], onboard: Onboard) -> bool:
    """Return whether one arc alone has burnt, at full thrust, since the last measurement.

    Args: as in :func:`watch_engines`.
    """
    nav = onboard.navigation
    engines = onboard.state.engines
    return bool(
        engines.mass > 0.0
        and nav.jettisoned == engines.jettisoned
        and nav.arc == engines.arc
        and 0.0 < nav.mass < engines.mass
        and burns_steadily(nav, engines.time, arcs)
    )


@kernel
def note_engines(arcs: NDArray[Any], onboard: Onboard) -> None:
    """Keep the navigation state that the next measurement begins with.

    Args: as in :func:`watch_engines`.
    """
    nav = onboard.navigation
    engines = onboard.state.engines
    engines.time = nav.time
    engines.mass = nav.mass
    engines.arc = nav.arc
    engines.stage = arcs[nav.arc].stage
    engines.jettisoned = nav.jettisoned
    store(engines.sensed_delta_v, load(nav.sensed_delta_v))


@kernel
def watch_engines(arcs: NDArray[Any], onboard: Onboard) -> None:
    """Measure thrust and mass flow of the present burn against the mission's.

    From mass and sensed velocity at both ends: thrust = gain flow / ln(m0 / m1).

    Args:
        arcs: dtype ARC.
        onboard: state of guidance. ``thrust_ratio``, ``flow_ratio`` and ``engines`` of its
            state are updated.
    """
    nav = onboard.navigation
    state = onboard.state
    engines = state.engines
    span = nav.time - engines.time
    if engines.mass > 0.0 and 0.0 <= span < SHORTEST:
        return
    # a burn of length 0 exists only after an engine failure
    unforeseen = arcs[nav.arc].kind == BURN and arcs[nav.arc].duration == 0.0
    engines.jumped = 1 if unforeseen and nav.arc != engines.arc else 0
    begin_stage(arcs, onboard)
    if measures_one_burn(arcs, onboard):
        arc = arcs[nav.arc]
        flow = (engines.mass - nav.mass) / span
        gain = norm(sub(load(nav.sensed_delta_v), load(engines.sensed_delta_v)))
        thrust = gain * flow / math.log(engines.mass / nav.mass)
        before = state.thrust_ratio
        state.thrust_ratio = filter_ratio(before, thrust / arc.thrust)
        engines.jumped = 1 if abs(state.thrust_ratio - before) > STEP else 0
        state.flow_ratio = filter_ratio(state.flow_ratio, flow / arc.mass_flow)
    note_engines(arcs, onboard)


@kernel
def present_engine(arc: Record, stage: int, state: Record) -> tuple[float, float]:
    """Return exhaust velocity m/s and mass flow kg/s of an arc; in stage ``stage`` as measured."""
    if arc.stage != stage or state.thrust_ratio == 0.0:
        return arc.exhaust_velocity, arc.mass_flow
    ratio = state.thrust_ratio / state.flow_ratio
    return ratio * arc.exhaust_velocity, state.flow_ratio * arc.mass_flow

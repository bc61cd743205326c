# SPDX-License-Identifier: Apache-2.0
"""Thrust and mass from one break of a flight to the next."""

from typing import NamedTuple

from ares_models.jit import kernel
from ares_optimizer.direct.kernels.breaks import CUTOFF, DROP, PIECE, TAIL, Break
from ares_optimizer.direct.kernels.problem import (
    D_MASS,
    P_FLOW,
    P_FLOW_SLOPE,
    P_MASS,
    P_THRUST,
    P_THRUST_SLOPE,
)
from ares_optimizer.kernels.algebra import Array


class Engine(NamedTuple):
    """Hold thrust and mass from a break on.

    Attributes:
        anchor: time at which the values hold, s after the start.
        thrust, thrust_slope: N, N/s.
        flow, flow_slope: kg/s, kg/s2.
        mass: kg, free drops aboard.
        dropped: kg.
        in_tail: true after the cut-off.
        cutoff_flow: kg/s, just before the cut-off.
    """

    anchor: float
    thrust: float
    thrust_slope: float
    flow: float
    flow_slope: float
    mass: float
    dropped: float
    in_tail: bool
    cutoff_flow: float


@kernel
def mass_at(engine: Engine, t: float) -> float:
    """Return the mass, kg, at ``t`` s after the start."""
    tau = t - engine.anchor
    burnt = tau * (engine.flow + 0.5 * tau * engine.flow_slope)
    return engine.mass - burnt - engine.dropped


@kernel
def engine_from(row: Array, at: Break, mass: float, engine: Engine) -> Engine:
    """Return the engine after a break, thrust and flow from a row of profile or tail.

    Args:
        row: P_THRUST to P_FLOW_SLOPE are read.
        at: the break.
        mass: kg, free drops aboard.
        engine: before the break.
    """
    return Engine(
        at.time,
        row[P_THRUST],
        row[P_THRUST_SLOPE],
        row[P_FLOW],
        row[P_FLOW_SLOPE],
        mass,
        engine.dropped,
        at.kind == TAIL,
        engine.cutoff_flow,
    )


@kernel
def replaced_engine(engine: Engine, dropped: float, cutoff_flow: float) -> Engine:
    """Return the engine with another dropped mass, kg, and cut-off flow, kg/s."""
    return Engine(
        engine.anchor,
        engine.thrust,
        engine.thrust_slope,
        engine.flow,
        engine.flow_slope,
        engine.mass,
        dropped,
        engine.in_tail,
        cutoff_flow,
    )


@kernel
def change_engine(at: Break, engine: Engine, profile: Array, tail: Array, drops: Array) -> Engine:
    """Return the engine from a break on."""
    if at.kind == PIECE:
        piece = profile[at.number]
        return engine_from(piece, at, piece[P_MASS], engine)
    if at.kind == TAIL:
        # the tail begins at the cut-off with the mass at that time
        mass = mass_at(engine, at.time) + engine.dropped
        return engine_from(tail[at.number], at, mass, engine)
    if at.kind == DROP:
        dropped = engine.dropped + drops[at.number, D_MASS]
        return replaced_engine(engine, dropped, engine.cutoff_flow)
    if at.kind == CUTOFF:
        flow = engine.flow + (at.time - engine.anchor) * engine.flow_slope
        return replaced_engine(engine, engine.dropped, flow)
    return engine

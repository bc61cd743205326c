# SPDX-License-Identifier: Apache-2.0
"""Write the optimality conditions at the ends of free arcs.

Along an arc the Hamiltonian is H = lambda_r . V + lambda_v . g + |lambda_v| T/m - (mu + c) b, with
b the mass flow, mu the mass costate and c the price of propellant, for free burns only;
lambda_v . w replaces |lambda_v| where the direction w is held (``held_burns``). H does not depend
on time, so H = 0 at the end of an arc of free length; the last free burn determines c. mu is 0 at
the end of the flight and where a stage is dropped. It rises by the integral of |lambda_v| T/m^2
(lambda_v . w T/m^2), or as (mu + c) b/m in a burn throttled to constant acceleration. An arc at its
longest has H >= 0, at its shortest H <= 0. In a burn that ends with depletion H = 0 determines mu,
which holds for the earlier burns of its stage.

Source: Bryson and Ho, *Applied Optimal Control*, sections 3.5 and 3.6.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import dot
from ares_optimizer.kernels.timetable import COLUMN_CUTOFF, ends_by_plan, free_count, segment_flow
from ares_optimizer.two_point.arrays import (
    AT_LONGEST,
    AT_ONCE,
    AT_SHORTEST,
    DRY,
    HELD,
    NOT_HELD,
    Gravity,
)
from ares_optimizer.two_point.kernels.costates import (
    thrust_acceleration_tangents,
)
from ares_optimizer.two_point.kernels.gravity import gravity_terms
from ares_optimizer.two_point.kernels.held_burns import along_by_direction, along_thrust

_LENGTH_UNIT = 100.0  # s, scale of the equations that fix a length


@kernel
def last_is_free(arcs: NDArray[Any]) -> bool:
    """Return true if guidance ends the last burn."""
    return arcs[arcs.shape[0] - 1].duration == np.inf


@kernel
def find_switches(start: Record, arcs: NDArray[Any], work: Record) -> None:
    """List the arcs with free ends in ``work``; the last arc of the mission comes last."""
    count = free_count(start, arcs)
    work.planned = 1 if count > 0 or not last_is_free(arcs) else 0
    f = 0
    for k in range(start.arc, arcs.shape[0]):
        if ends_by_plan(k, arcs):
            work.switches[f].arc = k
            f += 1
    work.switches[f].arc = arcs.shape[0] - 1


@kernel
def store_switch(f: int, i: int, gravity: Gravity, work: Record) -> None:
    """Store the Hamiltonian at the end of an arc, without mass costate and price.

    Args:
        f: index into ``work.switches``, written.
        i: last segment of the arc; its end is in ``work.state`` and ``work.tangent``.
        gravity: the field.
        work: record WORK.
    """
    segment = work.segments[i]
    switch = work.switches[f]
    state = work.state
    tangent = work.tangent
    length = segment.end - segment.start
    acceleration = thrust_acceleration_tangents(segment, length, 1.0, work.columns, work.thrust)
    r = (state[0], state[1], state[2])
    v = (state[3], state[4], state[5])
    p = (state[6], state[7], state[8])
    q = (state[9], state[10], state[11])
    g, gradient_p = gravity_terms(r, gravity, p)
    size, u = along_thrust(segment, p, work)
    switch.segment = i
    switch.flow = segment_flow(segment, segment.end)
    switch.value = -dot(q, v) + dot(p, g) + size * acceleration
    for c in range(work.columns_wanted):
        switch.value_by[c] = 0.0
        switch.flow_by[c] = 0.0
    if segment.fading > 0.0:
        kept = segment.fading * math.exp(-segment.fading * length)
        for c in range(COLUMN_CUTOFF, work.columns_wanted):
            k = c - COLUMN_CUTOFF
            longer = segment.end_by[k] - segment.start_by[k]
            fallen = segment.mass_by[k] - segment.mass * segment.fading * longer
            switch.flow_by[c] = kept * fallen
    for c in range(work.columns):
        dr = (tangent[c, 0], tangent[c, 1], tangent[c, 2])
        dv = (tangent[c, 3], tangent[c, 4], tangent[c, 5])
        dp = (tangent[c, 6], tangent[c, 7], tangent[c, 8])
        dq = (tangent[c, 9], tangent[c, 10], tangent[c, 11])
        switch.value_by[c] = (
            dot(gradient_p, dr)
            + dot(g, dp)
            + acceleration * (dot(u, dp) + along_by_direction(c, segment, p, work))
            + size * work.thrust[c]
            - dot(q, dv)
            - dot(v, dq)
        )


@kernel
def store_segment(i: int, arcs: NDArray[Any], gravity: Gravity, work: Record) -> None:
    """Store costate rise and Hamiltonian of segment ``i``, just flown."""
    work.rises[i] = work.costate_rise
    for c in range(work.columns_wanted):
        work.rises_by[i, c] = work.costate_rise_by[c] if c < work.columns else 0.0
    segment = work.segments[i]
    f = 0
    while work.switches[f].arc < segment.arc:
        f += 1
    if segment.end_arc >= 0:
        store_switch(f, i, gravity, work)
    elif segment.arc == arcs.shape[0] - 1 and segment.after_cutoff == 0:
        # overwritten by later segments of the last arc
        store_switch(f, i, gravity, work)


@kernel
def _clear_costate(columns: int, work: Record) -> None:
    """Set the mass costate to 0: end of flight, or stage dropped."""
    costate = work.mass_costate
    costate.value = 0.0
    costate.priced = 0.0
    for c in range(columns):
        costate.value_by[c] = 0.0
        costate.priced_by[c] = 0.0


@kernel
def _subtract_mass_costate(switch: Record, work: Record) -> None:
    """Subtract the mass costate term from the Hamiltonian at the end of an arc.

    At depletion the term is unknown instead, and H = 0 sets the mass costate.
    """
    costate = work.mass_costate
    flow = switch.flow
    if switch.hold == DRY:
        switch.cost = flow
        costate.value = switch.value / flow
        costate.priced = -1.0
        for c in range(work.columns_wanted):
            switch.cost_by[c] = switch.flow_by[c]
            costate.value_by[c] = (switch.value_by[c] - costate.value * switch.flow_by[c]) / flow
            costate.priced_by[c] = 0.0
        return
    switch.cost = flow * (1.0 + costate.priced)
    switch.value -= costate.value * flow
    for c in range(work.columns_wanted):
        switch.cost_by[c] = switch.flow_by[c] * (1.0 + costate.priced) + flow * costate.priced_by[c]
        switch.value_by[c] -= costate.value_by[c] * flow + costate.value * switch.flow_by[c]


@kernel
def _costate_over_segment(i: int, arcs: NDArray[Any], work: Record) -> None:
    """Propagate the mass costate from the end of segment ``i`` to its start."""
    costate = work.mass_costate
    segment = work.segments[i]
    if segment.fading == 0.0:
        costate.value -= work.rises[i]
        for c in range(work.columns_wanted):
            costate.value_by[c] -= work.rises_by[i, c]
        return
    # mu' = (mu + c) b / m; c applies to free burns only
    pays = 1.0 if arcs[segment.arc].duration == np.inf else 0.0
    kept = math.exp(-segment.fading * (segment.end - segment.start))
    for c in range(work.columns_wanted):
        shrinks = 0.0
        if c >= COLUMN_CUTOFF:
            k = c - COLUMN_CUTOFF
            shrinks = -segment.fading * (segment.end_by[k] - segment.start_by[k])
        costate.value_by[c] = kept * (costate.value_by[c] + shrinks * costate.value)
        costate.priced_by[c] = kept * (costate.priced_by[c] + shrinks * (costate.priced + pays))
    costate.value *= kept
    costate.priced = kept * (costate.priced + pays) - pays


@kernel
def add_mass_costate(count: int, arcs: NDArray[Any], work: Record) -> None:
    """Subtract the mass costate terms from the Hamiltonians, backwards in time.

    Args:
        count: number of free arcs before the last.
        arcs: dtype ARC.
        work: record WORK; ``value`` and ``cost`` of the switches are written.
    """
    _clear_costate(work.columns_wanted, work)
    f = count
    for i in range(work.segment_count - 1, -1, -1):
        following = work.segments[min(i + 1, work.segment_count - 1)]
        if arcs[following.arc].stage != arcs[work.segments[i].arc].stage:
            _clear_costate(work.columns_wanted, work)
        while f >= 0 and work.switches[f].segment == i:
            _subtract_mass_costate(work.switches[f], work)
            f -= 1
        _costate_over_segment(i, arcs, work)


@kernel
def bound_of(switch: Record, arcs: NDArray[Any]) -> float:
    """Return the length, s, that the active constraint of an arc prescribes."""
    arc = arcs[switch.arc]
    if switch.hold == AT_SHORTEST:
        return max(arc.shortest, AT_ONCE)
    if switch.hold == AT_LONGEST:
        return arc.longest
    if switch.hold == HELD:
        return switch.length
    # otherwise the last burn, of fixed length
    return arc.duration


@kernel
def longest_burn(k: int, arcs: NDArray[Any], work: Record) -> float:
    """Return the length of burn ``k``, s, at which its stage is depleted."""
    arc = arcs[k]
    begin = work.layout.begins[k]
    left = arc.propellant - begin.used
    length = arc.start_loss - arc.tail_gain
    if not arc.max_acceleration < np.inf:
        return length + left / arc.mass_flow
    limit = arc.thrust / arc.max_acceleration
    upper = min(begin.mass, limit)
    full = min(left, begin.mass - upper)
    lower = min(upper, max(arc.min_throttle * limit, begin.mass - left))
    length += full / arc.mass_flow
    if left > full and lower > 0.0:
        length += math.log(upper / lower) * arc.exhaust_velocity / arc.max_acceleration
        rest = left - (begin.mass - lower)
        if rest > 0.0 and arc.min_throttle > 0.0:
            length += rest / (arc.min_throttle * arc.mass_flow)
    return length


@kernel
def length_margins(
    f: int, arcs: NDArray[Any], x: NDArray[np.float64], work: Record
) -> tuple[float, float]:
    """Return the margins of a free arc's length to its shortest and its longest, s.

    Args:
        f: index into ``work.switches``.
        arcs: dtype ARC.
        x: unknowns, for which ``work`` holds the begins of the arcs.
        work: record WORK.
    """
    k = work.switches[f].arc
    arc = arcs[k]
    length = x[work.first_free + f] - work.layout.begins[k].time
    longest = arc.longest
    if arc.kind == BURN:
        longest = min(longest, longest_burn(k, arcs, work))
    return length - max(arc.shortest, AT_ONCE), longest - length


@kernel
def lengths_inside(start: Record, arcs: NDArray[Any], x: NDArray[np.float64], work: Record) -> bool:
    """Return true if all unconstrained free arcs are between their bounds.

    Arguments: see :func:`length_margins`.
    """
    for f in range(free_count(start, arcs)):
        if work.switches[f].hold != NOT_HELD:
            continue
        shorter, longer = length_margins(f, arcs, x, work)
        if shorter < 0.0 or longer < 0.0:
            return False
    return True


@kernel
def dry_row(row: int, switch: Record, arcs: NDArray[Any], work: Record) -> None:
    """Write the equation of a burn that ends with depletion of its stage."""
    arc = arcs[switch.arc]
    begin = work.layout.begins[switch.arc]
    size = 1.0 / (arc.mass_flow * _LENGTH_UNIT)
    tail = arc.tail_gain * arc.mass_flow
    work.residual[row] = size * (begin.used_end + tail - arc.propellant)
    for c in range(work.columns_wanted):
        by = begin.used_end_by[c - COLUMN_CUTOFF] if c >= COLUMN_CUTOFF else 0.0
        work.jacobian[row, c] = size * by


@kernel
def hold_row(
    row: int, column: int, switch: Record, arcs: NDArray[Any], x: float, work: Record
) -> None:
    """Write the equation that fixes the length of an arc.

    Args:
        row: of residual and Jacobian, written.
        column: of the arc's end.
        switch: record SWITCH.
        arcs: dtype ARC.
        x: the arc's end, s.
        work: record WORK.
    """
    begin = work.layout.begins[switch.arc]
    work.residual[row] = (x - begin.time - bound_of(switch, arcs)) / _LENGTH_UNIT
    for c in range(work.columns_wanted):
        by = 1.0 if c == column else 0.0
        if c >= COLUMN_CUTOFF:
            by -= begin.time_by[c - COLUMN_CUTOFF]
        work.jacobian[row, c] = by / _LENGTH_UNIT


@kernel
def switch_rows(
    start: Record,
    mission: MissionRecords,
    unknowns: NDArray[np.float64],
    first: int,
    work: Record,
) -> bool:
    """Write residuals, Jacobian rows and switching functions of the free ends.

    Args:
        start: record NAVIGATION.
        mission: its records.
        unknowns: see ``shooting.shoot``.
        first: column and row of the first free end.
        work: record WORK, the flight just flown.

    Returns:
        False if no free burn determines the price of propellant.
    """
    arcs = mission.arcs
    count = free_count(start, arcs)
    add_mass_costate(count, arcs, work)
    payer = -1
    for f in range(count + 1):
        switch = work.switches[f]
        free = switch.hold == NOT_HELD and (f < count or last_is_free(arcs))
        if free and switch.cost > 0.0:
            payer = f
    if payer < 0:
        return False
    paid = work.switches[payer]
    work.price = paid.value / paid.cost
    last = arcs[arcs.shape[0] - 1]
    size = last.stack_mass / last.thrust
    row = first
    for f in range(count + 1):
        switch = work.switches[f]
        switch.worth = switch.value - work.price * switch.cost
        if f == payer:
            continue
        column = first + f if f < count else COLUMN_CUTOFF
        if switch.hold == NOT_HELD and (f < count or last_is_free(arcs)):
            work.residual[row] = size * switch.worth
            for c in range(work.columns_wanted):
                price_by = (paid.value_by[c] - work.price * paid.cost_by[c]) / paid.cost
                work.jacobian[row, c] = size * (
                    switch.value_by[c] - work.price * switch.cost_by[c] - switch.cost * price_by
                )
        elif switch.hold == DRY:
            dry_row(row, switch, arcs, work)
        else:
            hold_row(row, column, switch, arcs, unknowns[column], work)
        row += 1
    return True

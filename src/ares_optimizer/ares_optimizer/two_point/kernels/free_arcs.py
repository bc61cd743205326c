"""Conditions at the ends of free arcs: what a second more of each is worth.

Along an arc the Hamiltonian is H = lambda_r . V + lambda_v . g + |lambda_v| T/m - (mu + c) b
with b the mass flow, mu the mass costate and c the price of propellant, which the free burns
pay. Nothing depends on the date, so that an arc whose length is free has H = 0 at its end; the
last free burn of all gives c. mu is 0 at the end of the flight and where a stage is dropped,
and rises by the integral of |lambda_v| T/m^2. An arc that is held at a bound has H >= 0 at its
longest and H <= 0 at its shortest. A burn that ends with the propellant of its stage has
H = 0 for a mu of its own, that of the burns before it.

Source: Bryson and Ho, *Applied Optimal Control*, sections 3.5 and 3.6.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import dot, norm, scale
from ares_optimizer.kernels.timetable import COLUMN_CUTOFF, ends_by_plan, free_count
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
    gravity_terms,
    thrust_acceleration_tangents,
)

_LENGTH_UNIT = 100.0  # s, of the rows that hold an arc


@kernel
def last_is_free(arcs: NDArray[Any]) -> bool:
    """Whether the last burn ends by guidance."""
    return arcs[arcs.shape[0] - 1].duration == np.inf


@kernel
def find_switches(start: Record, arcs: NDArray[Any], work: Record) -> None:
    """Which arcs end freely, into ``work``; the last one closes the list."""
    count = free_count(start, arcs)
    work.planned = 1 if count > 0 or not last_is_free(arcs) else 0
    f = 0
    for k in range(start.arc, arcs.shape[0]):
        if ends_by_plan(k, arcs):
            work.switches[f].arc = k
            f += 1
    work.switches[f].arc = arcs.shape[0] - 1


@kernel
def note_switch(f: int, i: int, gravity: Gravity, work: Record) -> None:
    """Hamiltonian of the arc that segment ``i`` ends, without mass costate and cost.

    Args:
        f: index into ``work.switches``, written.
        i: segment; its end is in ``work.state`` and ``work.tangent``.
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
    g, bend = gravity_terms(r, gravity, p)
    size = norm(p)
    u = scale(1.0 / size, p)
    switch.segment = i
    switch.flow = segment.flow + segment.flow_slope * length
    switch.value = -dot(q, v) + dot(p, g) + size * acceleration
    for c in range(work.columns_wanted):
        switch.value_by[c] = 0.0
    for c in range(work.columns):
        dr = (tangent[c, 0], tangent[c, 1], tangent[c, 2])
        dv = (tangent[c, 3], tangent[c, 4], tangent[c, 5])
        dp = (tangent[c, 6], tangent[c, 7], tangent[c, 8])
        dq = (tangent[c, 9], tangent[c, 10], tangent[c, 11])
        switch.value_by[c] = (
            dot(bend, dr)
            + dot(g, dp)
            + acceleration * dot(u, dp)
            + size * work.thrust[c]
            - dot(q, dv)
            - dot(v, dq)
        )


@kernel
def note_segment(i: int, arcs: NDArray[Any], gravity: Gravity, work: Record) -> None:
    """What the conditions need of segment ``i``, just flown."""
    work.rises[i] = work.costate_rise
    for c in range(work.columns_wanted):
        work.rises_by[i, c] = work.costate_rise_by[c] if c < work.columns else 0.0
    segment = work.segments[i]
    f = 0
    while work.switches[f].arc < segment.arc:
        f += 1
    if segment.end_arc >= 0:
        note_switch(f, i, gravity, work)
    elif segment.arc == arcs.shape[0] - 1 and segment.after_cutoff == 0:
        # the last of its segments has the last word
        note_switch(f, i, gravity, work)


@kernel
def add_mass_costate(count: int, arcs: NDArray[Any], work: Record) -> None:
    """Take the mass costate's part off the Hamiltonians, from the end of the flight back.

    Args:
        count: number of free arcs before the last.
        arcs: dtype ARC.
        work: record WORK; ``value`` and ``cost`` of the switches are written.
    """
    by = work.mass_costate_by
    costate = 0.0
    # a part of it that is the price itself: what is burnt now is not burnt before the end
    priced = 0.0
    for c in range(work.columns_wanted):
        by[c] = 0.0
    f = count
    for i in range(work.segment_count - 1, -1, -1):
        following = work.segments[min(i + 1, work.segment_count - 1)]
        if arcs[following.arc].stage != arcs[work.segments[i].arc].stage:
            costate = 0.0
            priced = 0.0
            for c in range(work.columns_wanted):
                by[c] = 0.0
        while f >= 0 and work.switches[f].segment == i:
            switch = work.switches[f]
            if switch.hold == DRY:
                switch.cost = switch.flow
                costate = switch.value / switch.flow
                priced = -1.0
                for c in range(work.columns_wanted):
                    by[c] = switch.value_by[c] / switch.flow
            else:
                switch.cost = switch.flow * (1.0 + priced)
                switch.value -= costate * switch.flow
                for c in range(work.columns_wanted):
                    switch.value_by[c] -= by[c] * switch.flow
            f -= 1
        costate -= work.rises[i]
        for c in range(work.columns_wanted):
            by[c] -= work.rises_by[i, c]


@kernel
def bound_of(switch: Record, arcs: NDArray[Any], work: Record) -> float:
    """Length at which an arc is held, s."""
    arc = arcs[switch.arc]
    if switch.hold == AT_SHORTEST:
        return max(arc.shortest, AT_ONCE)
    if switch.hold == AT_LONGEST:
        return arc.longest
    if switch.hold == HELD:
        return switch.length
    if switch.hold == DRY:
        return longest_burn(switch.arc, arcs, work)
    # the last burn, of fixed length
    return arc.duration


@kernel
def longest_burn(k: int, arcs: NDArray[Any], work: Record) -> float:
    """Length of burn ``k`` with which its stage runs dry, s."""
    arc = arcs[k]
    left = arc.propellant - work.layout.begins[k].used
    return left / arc.mass_flow + arc.start_loss - arc.tail_gain


@kernel
def hold_row(
    row: int, column: int, switch: Record, arcs: NDArray[Any], x: float, work: Record
) -> None:
    """The equation that holds the end of an arc.

    Args:
        row: of residual and Jacobian, written.
        column: of the arc's end.
        switch: record SWITCH.
        arcs: dtype ARC.
        x: the arc's end, s.
        work: record WORK.
    """
    begin = work.layout.begins[switch.arc]
    work.residual[row] = (x - begin.time - bound_of(switch, arcs, work)) / _LENGTH_UNIT
    for c in range(work.columns_wanted):
        by = 1.0 if c == column else 0.0
        if c >= COLUMN_CUTOFF:
            by -= begin.time_by[c - COLUMN_CUTOFF]
            if switch.hold == DRY:
                by += begin.used_by[c - COLUMN_CUTOFF] / arcs[switch.arc].mass_flow
        work.jacobian[row, c] = by / _LENGTH_UNIT


@kernel
def switch_rows(
    start: Record,
    mission: MissionRecords,
    unknowns: NDArray[np.float64],
    first: int,
    work: Record,
) -> bool:
    """Residuals and Jacobian rows of the free ends; what each is worth.

    Args:
        start: record NAVIGATION.
        mission: what is flown.
        unknowns: see ``shooting.shoot``.
        first: column of the first free end, and its row.
        work: record WORK, the flight just flown.

    Returns:
        False if no free burn is left to set the price of propellant.
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
            part = switch.cost / paid.cost
            for c in range(work.columns_wanted):
                work.jacobian[row, c] = size * (switch.value_by[c] - part * paid.value_by[c])
        else:
            hold_row(row, column, switch, arcs, unknowns[column], work)
        row += 1
    return True

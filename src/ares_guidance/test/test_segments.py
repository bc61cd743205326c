# SPDX-License-Identifier: Apache-2.0
"""Thrust integrals against quadrature, on plans with staging, drops and coasts."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from ares_guidance.arrays import Onboard, blank_onboard
from ares_guidance.kernels.monitors.shortfall import lacking_speed
from ares_guidance.kernels.prediction.segments import (
    burn_time_to_go,
    plan_segments,
    thrust_integrals,
)
from ares_guidance.settings import LawSettings
from ares_models.arrays import (
    ARC,
    BURN,
    COAST,
    ENVIRONMENT,
    HEATING_LIMIT,
    JETTISON,
    MISSION_TIME,
    NAVIGATION,
    TARGET,
    TIME_AFTER_IGNITION,
    MissionRecords,
)


def three_stage_plan(jettison_time=math.inf, **changes):
    """Return a burn, a coast with a staging before it, two burns of one stage, a free burn.

    Changes: fields of the arcs.
    """
    arcs = np.zeros(5, ARC)
    arcs["kind"] = [BURN, COAST, BURN, BURN, BURN]
    arcs["stage"] = [0, 1, 1, 1, 2]
    arcs["begins_stage"] = [1, 1, 0, 0, 1]
    arcs["thrust"] = [5.0e6, 0.0, 9.0e5, 6.0e5, 2.0e5]
    arcs["exhaust_velocity"] = [4000.0, 1.0, 4300.0, 4350.0, 4500.0]
    arcs["mass_flow"] = arcs["thrust"] / arcs["exhaust_velocity"]
    arcs["duration"] = [120.0, 15.0, 200.0, 80.0, math.inf]
    arcs["stack_mass"] = [300e3, 110e3, 110e3, 110e3, 40e3]
    arcs["propellant"] = [160e3, 60e3, 60e3, 60e3, 30e3]
    arcs["max_acceleration"] = math.inf
    for name, values in changes.items():
        arcs[name] = values
    jettisons = np.zeros(3, JETTISON)
    jettisons["mass"] = [1500.0, 700.0, 300.0]
    jettisons["criterion"] = [HEATING_LIMIT, MISSION_TIME, TIME_AFTER_IGNITION]
    jettisons["value"] = [1135.0, 60.0, 25.0]
    jettisons["stage"] = [1, 0, 1]
    nav = np.zeros(1, NAVIGATION)
    nav["time"] = 10.0
    nav["mass"] = 300e3 - 10.0 * arcs["mass_flow"][0]
    onboard = blank_onboard(LawSettings().record())
    onboard.navigation[0] = nav[0]
    onboard.state["solution"]["jettison_time"] = jettison_time
    blank = (np.zeros(1, ENVIRONMENT)[0], np.zeros((2, 5)))
    mission = MissionRecords(*blank, arcs, jettisons, np.zeros(1, TARGET)[0])
    plan_segments(mission, Onboard(*(array[0] for array in onboard[:4])))
    return arcs, jettisons, nav, onboard.state


def acceleration(segments, t):
    """Return the thrust acceleration of the plan at ``t``, m/s2."""
    for segment in segments:
        into = t - segment["start"]
        if 0.0 <= into < segment["duration"]:
            if segment["acceleration"] > 0.0:
                return segment["acceleration"]
            return segment["exhaust_velocity"] / (segment["tau"] - into)
    return 0.0


def direction_time(segments, t):
    """Return the time at which the steering has the direction of the thrust at ``t``, s."""
    for segment in segments:
        if (
            0.0 <= t - segment["start"] < segment["duration"]
            and segment["held_at"] == (segment["held_at"])
        ):
            return segment["held_at"]
    return t


CHANGES = {
    "plain": {},
    "throttled": {
        "max_acceleration": [20.0, 0.0, 10.0, 8.0, 12.0],
        "min_throttle": [0.9, 0.0, 0.0, 1.0, 0.5],
    },
    "held": {"held": [1, 0, 0, 1, 0]},
}


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
@pytest.mark.parametrize("until", [5.0, 49.0, 90.0, 113.0, 130.0, 250.0, 400.0, 470.0, 600.0])
def test_integrals_agree_with_quadrature(until, changes):
    _, _, _, state = three_stage_plan(jettison_time=300.0, **changes)
    segments = state[0]["segments"][: state[0]["segment_count"]]
    edges = [e for s in segments for e in (s["start"], s["start"] + s["duration"]) if e < until]

    def integral(weight):
        at = sorted({0.0, *edges, until})
        return sum(
            quad(lambda t: acceleration(segments, t) * weight(t), a, b, epsabs=1e-9, epsrel=1e-12)[
                0
            ]
            for a, b in pairwise(at)
        )

    def turned(t):
        return direction_time(segments, t)

    l_sum, j_sum, s_sum, q_sum, p_sum, h_sum = thrust_integrals(state[0], until, math.inf)
    # int int a s^n ds dt = int a(s) s^n (T - s) ds
    expected = [
        (l_sum, integral(lambda _: 1.0)),
        (j_sum, integral(turned)),
        (h_sum, integral(lambda t: turned(t) ** 2)),
        (s_sum, integral(lambda t: until - t)),
        (q_sum, integral(lambda t: turned(t) * (until - t))),
        (p_sum, integral(lambda t: turned(t) ** 2 * (until - t))),
    ]
    for got, want in expected:
        assert got == pytest.approx(want, rel=1e-9, abs=1e-6)


def test_a_drift_after_the_cutoff_only_moves_on():
    _, _, _, state = three_stage_plan()
    l_sum, j_sum, s_sum, q_sum, p_sum, h_sum = thrust_integrals(state[0], 450.0, math.inf)
    later = thrust_integrals(state[0], 460.0, 450.0)
    assert later == pytest.approx(
        (
            l_sum,
            j_sum,
            s_sum + 10.0 * l_sum,
            q_sum + 10.0 * j_sum,
            p_sum + 10.0 * h_sum,
            h_sum,
        ),
        rel=1e-12,
    )


def test_plan_drops_mass_where_the_mission_says():
    arcs, _, _, state = three_stage_plan(jettison_time=300.0)
    segments = state[0]["segments"][: state[0]["segment_count"]]
    starts = segments["start"] + 10.0
    # core, core after the timed drop, coast, ring at 25 s, heating drop, second burn, third stage
    assert starts == pytest.approx([10.0, 60.0, 135.0, 160.0, 300.0, 335.0, 415.0])
    masses = segments["tau"] * arcs["mass_flow"][segments["arc"]]
    assert masses[0] - masses[1] == pytest.approx(50.0 * arcs["mass_flow"][0] + 700.0)
    assert masses[2] == pytest.approx(110e3)
    assert masses[3] == pytest.approx(110e3 - 25.0 * arcs["mass_flow"][2] - 300.0)
    assert masses[4] == pytest.approx(masses[3] - 140.0 * arcs["mass_flow"][2] - 1500.0)
    assert masses[-1] == pytest.approx(40e3)
    assert math.isinf(segments["duration"][-1])


def test_a_fairing_that_stays_on_rides_to_the_next_stage():
    _, _, _, state = three_stage_plan(jettison_time=math.inf)
    last = state[0]["segments"][state[0]["segment_count"] - 1]
    assert last["tau"] * 2.0e5 / 4500.0 == pytest.approx(40e3 + 1500.0)
    assert last["capacity"] == pytest.approx(30e3 / (2.0e5 / 4500.0))


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
@pytest.mark.parametrize("delta_v", [100.0, 2500.0, 5000.0, 9000.0])
def test_burn_time_inverts_the_first_integral(delta_v, changes):
    _, _, _, state = three_stage_plan(**changes)
    t_go, _ = burn_time_to_go(state[0], delta_v)
    assert thrust_integrals(state[0], t_go, math.inf)[0] == pytest.approx(delta_v, rel=1e-12)


def test_stretches_of_a_throttled_burn():
    arcs, _, _, state = three_stage_plan(**CHANGES["throttled"])
    segments = state[0]["segments"][: state[0]["segment_count"]]
    last = segments[segments["arc"] == 4]
    # the fairing rides on: 41,500 kg at 4.8 m/s2, the limit at 16,667 kg, the least thrust at half
    assert list(last["acceleration"]) == [0.0, 12.0, 0.0]
    flow = arcs["mass_flow"][4]
    upper = 2.0e5 / 12.0
    assert last["duration"][0] == pytest.approx((41_500.0 - upper) / flow)
    assert last["duration"][1] == pytest.approx(4500.0 / 12.0 * math.log(2.0))
    assert last["tau"][2] == pytest.approx(upper / flow)
    # another burn that is below the limit at once, and cannot be throttled
    (third,) = segments[segments["arc"] == 3]
    assert third["acceleration"] == 0.0
    assert third["duration"] == 80.0


def test_lacking_speed_of_a_throttled_burn():
    _, _, _, state = three_stage_plan(**CHANGES["throttled"])
    limited = state[0]["segments"][int(state[0]["segment_count"]) - 2]
    # the mass is 11,500 kg when the propellant is gone, before the least thrust is reached
    assert limited["capacity"] == pytest.approx(4500.0 / 12.0 * math.log(2.0e5 / 12.0 / 11_500.0))
    reach = thrust_integrals(state[0], limited["start"] + limited["capacity"], math.inf)[0]
    for beyond in (-300.0, 0.0, 250.0):
        state[0]["solution"]["time_to_go"], _ = burn_time_to_go(state[0], reach + beyond)
        assert lacking_speed(state[0]) == pytest.approx(beyond, abs=1e-6)


def test_lacking_speed_is_what_the_propellant_cannot_give():
    _, _, _, state = three_stage_plan()
    end = state[0]["segments"][int(state[0]["segment_count"]) - 1]
    empty = end["start"] + end["capacity"]
    reach = thrust_integrals(state[0], empty, math.inf)[0]
    for beyond in (-300.0, 0.0, 250.0):
        state[0]["solution"]["time_to_go"], _ = burn_time_to_go(state[0], reach + beyond)
        assert lacking_speed(state[0]) == pytest.approx(beyond, abs=1e-6)

# SPDX-License-Identifier: Apache-2.0
"""The abort map: ends, optima, and a coarse map of two missions."""

import dataclasses
import json
import math

import numpy as np
import pytest

from ares_models.failures import Failure, FailureKind
from ares_models.judge import End
from ares_models.mission import TEMPLATE, load_mission, parse_mission, read_mission
from ares_optimizer.foreknown import foreknown
from ares_optimizer.solution import OptimizerError, UnfitMethod
from ares_optimizer.solve import solve
from ares_studies import closed_loop
from ares_studies.aborts import abort_map
from ares_studies.aborts.abort_map import LATE_S, MapMaker, MapSettings, _flown_way
from ares_studies.aborts.ends import NOWHERE, Judge, Reached, better
from ares_studies.aborts.optimum import Optimizer, plan_in_air
from ares_studies.aborts.report import make_report, render
from ares_studies.aborts.rows import failure_rows
from ares_trials.testing.samples import one_in

MISSIONS = ("ares_v", "saturn_v_as506")
#: Between the failures of a map.
STEP_S = 100.0


def optimizer_of(name):
    mission = load_mission(name)
    return mission, Optimizer(mission, Judge(mission))


def made_of(mission, step_s):
    maker = MapMaker(MapSettings(mission, "peg", step_s))
    work = maker.make()
    done = 0
    while True:
        try:
            assert done <= (done := next(work)) <= maker.count
        except StopIteration as over:
            return over.value


@pytest.fixture(scope="module", params=one_in(2, MISSIONS))
def made(request):
    return made_of(load_mission(request.param), STEP_S)


@pytest.fixture(scope="module")
def planned():
    mission = load_mission("delta_iii_pad")
    return mission, solve(mission, "auto")


@pytest.fixture(scope="module")
def from_pad(planned):
    mission, plan = planned
    plans = iter([plan])
    names = ("thrust at 90 %, flow as before", "shut down early", "jettison stuck")

    def some_rows(*args):
        return tuple(row for row in failure_rows(*args) if row.name in names)

    # one plan serves all points
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(abort_map, "failure_rows", some_rows)
        for module in (abort_map, closed_loop):
            patch.setattr(module, "plan_solution", lambda *_, **__: next(plans))
        return made_of(mission, 450.0)


def test_every_failure_has_its_row(made):
    names = [row.name for row in made.rows]
    assert names[0] == "one engine lost" and len(names) == 8
    assert names[-2:] == ["ignition failed", "jettison stuck"]
    for row in made.rows[:4]:
        assert all(point.at_s % STEP_S == 0.0 for point in row.points)
    assert len(made.rows[-1].points) == {"ares_v": 1, "saturn_v_as506": 3}[made.mission.name]


def test_who_knows_more_does_no_worse(made):
    assert not made.wrong
    for point in made.points:
        assert point.optimum.end.rank <= point.told.end.rank
        if point.optimum.end is End.TARGET is point.told.end:
            assert point.told.m_f_kg <= point.optimum.m_f_kg + 1.0


def test_the_earlier_the_costlier(made):
    for row in made.rows[:3]:
        masses = [p.optimum.m_f_kg for p in row.points if p.optimum.end is End.TARGET]
        assert masses[0] < masses[-1]
        assert max(masses) < made.nominal.m_f_kg + 1.0


def test_a_map_can_be_told(made):
    said = json.loads(json.dumps(made.to_json(), allow_nan=False))
    assert said["points"] == sum(len(row["points"]) for row in said["rows"])
    told = [row["within"] for row in said["rows"]]
    assert sum(told) == said["within"]["all"]["count"]
    page = render(make_report(made, {"mission": made.mission.name, "guidance": made.law}))
    assert page.count('class="strip"') == 3 * len(made.rows)
    assert ("Where it falls" in page) == (made.outside.of > 0)


def test_each_fall_is_a_place_on_the_globe(made):
    falls = make_report(made, {}).falls
    nominal, *places = falls.globe.flights
    assert len(nominal.ways) == 1
    assert len(places) == made.outside.of
    fallen = [point.flown for point in made.points if point.flown.falls]
    for shown, reached in zip(places, fallen, strict=True):
        at = (*shown.latitude_deg, *shown.longitude_deg)
        assert at == pytest.approx(reached.impact_deg, abs=0.006)
        assert shown.role == ("thesis" if reached.area else "here")
        assert shown.name.endswith(f", in {reached.area}") == bool(reached.area)
    assert len(falls.globe.areas) == len(made.areas)
    assert falls.globe.land
    # where all reach an orbit there is no globe
    high = dataclasses.replace(made.nominal, end=End.TARGET)
    rows = [
        dataclasses.replace(
            row, points=tuple(dataclasses.replace(point, flown=high) for point in row.points)
        )
        for row in made.rows
    ]
    page = render(
        make_report(dataclasses.replace(made, rows=tuple(rows)), {"mission": "", "guidance": ""})
    )
    assert "Where it falls" not in page
    assert "<canvas" not in page


def test_no_figure_is_empty(made):
    chapters = make_report(made, {}).chapters
    assert [chapter.number for chapter in chapters] == list(range(1, len(chapters) + 1))
    names = []
    for item in (item for chapter in chapters for item in chapter.items):
        names.append(item.name)
        if item.kind == "figure":
            # none of its lines either
            assert item.content.series
            assert all(any(y is not None for y in one.y) for one in item.content.series)
    assert len(set(names)) == len(names)
    # a map without a single orbit has no masses to draw, and so no chapter of them
    low = dataclasses.replace(made.points[0].flown, end=End.SUBORBITAL, m_f_kg=math.nan)
    lost = [
        dataclasses.replace(
            row,
            points=tuple(
                dataclasses.replace(point, flown=low, optimum=low, told=low) for point in row.points
            ),
        )
        for row in made.rows
    ]
    titles = [
        c.title for c in make_report(dataclasses.replace(made, rows=tuple(lost)), {}).chapters
    ]
    assert "Final mass" not in titles
    assert "Ends" in titles


def test_who_falls_does_so_somewhere(made):
    fallen = [point.flown for point in made.points if point.flown.falls]
    assert fallen
    assert all(reached.end is End.SUBORBITAL for reached in fallen)
    inside = [reached for reached in fallen if reached.area]
    assert {reached.area for reached in inside} <= set(made.areas)
    assert made.outside.count == len(fallen) - len(inside)


def test_low_propellant_lowers_the_target():
    mission, optimizer = optimizer_of("saturn_v_as506")
    known = None
    for time_s in np.arange(540.0, 348.0, -2.0):
        failure = Failure(FailureKind.EARLY_SHUTDOWN, float(time_s))
        reached = optimizer.knew(failure)
        if reached.end is End.LOWERED:
            known = foreknown(mission.arrays(), mission.start().navigation(), failure)
            break
    assert known is not None
    assert reached.lacking_m_s > 0.0
    empty = mission.stages[-1].ignition_mass_kg - mission.propellant(1)
    assert reached.m_f_kg == pytest.approx(empty, abs=1.0)
    # another method finds that so much of the target takes all that there is
    target = known.arrays.target.copy()
    target["speed"] -= reached.lacking_m_s
    lower = known.arrays._replace(target=target)
    other = solve(lower, "direct14", state=mission.start().navigation())
    assert other.m_f_kg == pytest.approx(empty, abs=20.0)


@pytest.mark.parametrize("time_s", [650.0, 760.0])
def test_a_shutdown_of_the_last_burn_fixes_the_end(time_s):
    _, optimizer = optimizer_of("ares_v")
    for before in np.arange(766.0, time_s, -2.0):
        optimizer.knew(Failure(FailureKind.EARLY_SHUTDOWN, float(before)))
    reached = optimizer.knew(Failure(FailureKind.EARLY_SHUTDOWN, time_s))
    assert reached.end is not End.TARGET
    assert reached.time_s <= time_s + 2e-3
    assert reached.lacking_m_s > 0.0


def test_the_best_safe_orbit_is_above_the_limit():
    _, optimizer = optimizer_of("ares_v")
    reached = optimizer.knew(Failure(FailureKind.EARLY_SHUTDOWN, 765.0))
    assert reached.end is End.SAFE_ORBIT
    assert reached.perigee_altitude_m == pytest.approx(120_000.0, abs=100.0)
    assert all(math.isnan(angle) for angle in reached.impact_deg)


def test_nobody_flies_below_the_ground():
    mission, optimizer = optimizer_of("ares_v")
    way = _flown_way(mission, "peg")
    ends = {}
    for time_s in np.arange(330.0, 282.0, -2.0):
        i = int(np.searchsorted(way["time"], time_s, side="right")) - 1
        failure = Failure(FailureKind.EARLY_SHUTDOWN, float(time_s))
        ends[time_s] = optimizer.told(failure, way[i : i + 1])
    assert ends[300.0].end is End.TARGET
    # the two-point problem has an answer there, 70 km deep
    assert ends[284.0].end is End.SUBORBITAL
    assert math.isnan(ends[284.0].m_f_kg)


def test_the_target_may_be_dear_at_the_very_end(made):
    for point in made.points:
        if point.exact is not None:
            assert point.at_s > made.nominal.time_s - LATE_S
            assert point.told is point.optimum
        assert point.within_told or not point.near


def test_a_fall_has_a_place():
    mission, optimizer = optimizer_of("ares_v")
    reached = optimizer.knew(Failure(FailureKind.FAILED_IGNITION, arc=1))
    assert reached.end is End.SUBORBITAL
    latitude, longitude = reached.impact_deg
    # down-range of Florida and the core's burn-out, along an orbit of 28.5 deg
    assert 20.0 < latitude < 29.0
    assert -80.0 <= longitude <= -50.0
    assert mission.name == "ares_v"


def test_an_engine_of_its_burn_is_lost():
    rows = failure_rows(load_mission("saturn_v_as506"), 695.2, (167.0, 192.3, 197.9), 1.0)
    lost = {failure.time_s: failure.thrust_ratio for failure in rows[0].failures}
    assert lost[300.0] == pytest.approx(4 / 5)
    assert lost[500.0] == pytest.approx(3 / 4)
    assert max(lost) == 548.0
    assert len(rows[1].failures) == len([t for t in range(163, 696) if t != 549])
    throttled = failure_rows(load_mission("space_shuttle_sts121"), 507.0, (), 1.0)
    assert "throttle stuck" in [row.name for row in throttled]


@pytest.mark.trial
def test_a_plan_of_arcs_has_no_map():
    with pytest.raises(UnfitMethod, match="expected only the last arc to be"):
        MapMaker(MapSettings(load_mission("delta_iii_coast"), "peg", 60.0))


# ---- from the pad


@pytest.mark.trial
def test_failures_from_the_pad_begin_at_lift_off(from_pad):
    for row in from_pad.rows[:2]:
        assert [point.at_s for point in row.points] == [450.0 * k for k in range(3)]
    stuck = from_pad.rows[-1]
    assert (stuck.name, [point.at_s for point in stuck.points]) == ("jettison stuck", [75.2, 150.4])


@pytest.mark.trial
def test_the_optima_from_the_pad_know_of_the_air(from_pad):
    # the published optimum; without the air it is 8,206 kg
    assert from_pad.nominal.m_f_kg == pytest.approx(7529.712, abs=0.01)
    test_who_knows_more_does_no_worse(from_pad)
    weak = from_pad.rows[0].points[0]
    assert weak.failure.thrust_ratio == 0.9
    # at lift-off both know as much
    assert weak.told.lacking_m_s == pytest.approx(weak.optimum.lacking_m_s, abs=0.1)


@pytest.mark.trial
@pytest.mark.trial
def test_guidance_from_the_pad_is_near_the_optimizer_that_was_told(from_pad):
    share = from_pad.shares(told=True)["all"]
    assert share.count >= 0.9 * share.of
    late = [p for p in from_pad.points if p.at_s >= 300.0 and p.told.end is End.TARGET]
    assert late
    assert all(p.flown.m_f_kg == pytest.approx(p.told.m_f_kg, rel=1e-3) for p in late)


def test_where_no_flight_is_found_the_map_says_so(from_pad):
    nowhere = [point for point in from_pad.points if math.isnan(point.told.m_f_kg)]
    assert from_pad.to_json()["unfound"] == len(nowhere) > 0
    assert all(point.flown.end is End.SUBORBITAL for point in nowhere)


def test_the_optimum_in_the_air_is_that_of_collocation(planned):
    mission, plan = planned
    optimizer = Optimizer(mission, Judge(mission), plan_in_air(mission, plan))
    lost = Failure(FailureKind.ENGINE_OUT, 50.0, thrust_ratio=8 / 9)
    start = mission.start().navigation()
    known = foreknown(mission.arrays(), start, lost)
    other = solve(known.arrays, "collocation", state=start)
    assert optimizer.knew(lost).m_f_kg == pytest.approx(other.m_f_kg, rel=1e-6)


@pytest.mark.trial
def test_a_limit_of_the_dynamic_pressure_is_no_hindrance():
    mission = load_mission(TEMPLATE)
    plan = solve(mission, "auto")
    optimizer = Optimizer(mission, Judge(mission), plan_in_air(mission, plan))
    assert optimizer.nominal.m_f_kg == pytest.approx(plan.m_f_kg, rel=1e-4)
    reached = optimizer.knew(Failure(FailureKind.THRUST_LOW, 60.0, thrust_ratio=0.9))
    assert reached.end is End.TARGET
    assert reached.m_f_kg < plan.m_f_kg


def test_a_map_whose_optimum_is_not_the_plan_is_refused(planned, monkeypatch):
    mission, plan = planned
    heavy = dataclasses.replace(plan, m_f_kg=1.001 * plan.m_f_kg)
    monkeypatch.setattr(abort_map, "plan_solution", lambda *_, **__: heavy)
    with pytest.raises(OptimizerError, match=r"comes to 7,529.7 kg and the plan to 7,537.2 kg"):
        made_of(mission, 500.0)


def test_what_the_optimizer_in_the_air_does_not_steer_is_refused(planned):
    with pytest.raises(UnfitMethod, match="programme is given; expected none"):
        plan_in_air(load_mission("saturn_v_as506_flown"), planned[1])
    _, text = read_mission("delta_iii_pad")
    burn = "    burn_time_s: 261.0\n"
    held = parse_mission(text.replace(burn, burn + "    attitude: held\n"), "held.yaml")
    with pytest.raises(UnfitMethod, match="arc 0 has attitude: held; expected guided"):
        plan_in_air(held, planned[1])


def test_of_two_lowered_targets_the_nearer_is_better():
    one = Reached(End.LOWERED, 100.0, 500.0, 10.0, 2e5, 3e5)
    nearer = dataclasses.replace(one, m_f_kg=90.0, lacking_m_s=5.0)
    assert better(one, nearer) is better(nearer, one) is nearer
    heavier = dataclasses.replace(one, m_f_kg=101.0, lacking_m_s=10.5)
    assert better(one, heavier) is better(heavier, one) is heavier


def test_a_point_whose_optimizer_missed_a_flight_is_wrong(from_pad):
    point = next(p for p in from_pad.points if p.told.end is p.flown.end is End.TARGET)
    lost = dataclasses.replace(point, optimum=NOWHERE, flown=NOWHERE)
    assert lost.wrong.startswith("the optimizer that was told came to target, which")
    low = dataclasses.replace(point.told, end=End.LOWERED, lacking_m_s=20.0)
    lower = dataclasses.replace(low, lacking_m_s=50.0)
    further = dataclasses.replace(point, optimum=lower, told=low, flown=lower)
    assert further.wrong.endswith("came 30.0 m/s nearer than the optimizer that knew found")


def test_an_optimum_that_was_told_later_counts_for_who_knew_too(monkeypatch):
    def one_row(*args):
        return failure_rows(*args)[:1]

    monkeypatch.setattr(abort_map, "failure_rows", one_row)
    monkeypatch.setattr(Optimizer, "knew", lambda *_: NOWHERE)
    points = made_of(load_mission("ares_v"), STEP_S).points
    assert {point.told.end for point in points} == {End.TARGET}
    for point in points:
        assert point.optimum == (point.exact or point.told)

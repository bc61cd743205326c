# SPDX-License-Identifier: Apache-2.0
"""Campaigns: flights by number, judgement, folder, engines, output."""

import json
import math
import os
import pickle
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from contextlib import ExitStack
from functools import partial

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ares_models.mission import MISSION, Mission, load_mission, parse_mission
from ares_models.mission_target import target_record
from ares_models.orbits import Elements
from ares_studies.closed_loop import fly_compiled
from ares_studies.montecarlo import engines, flights
from ares_studies.montecarlo.campaign import CampaignPlan, fly_campaign, missing
from ares_studies.montecarlo.engines import (
    EngineError,
    fly_chunk,
    fly_here,
    fly_on_cluster,
    fly_on_cores,
)
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_studies.montecarlo.reach import reaches
from ares_studies.montecarlo.report import drawn_name, make_report, perigee_apogee, render
from ares_studies.montecarlo.statistics import Tally, bound_rank, flights_needed, summarize
from ares_studies.montecarlo.store import GROUP, Store, StoreError
from ares_studies.montecarlo.table import Verdict, make_table
from ares_studies.montecarlo.ways import make_ways, sampled
from ares_vehicle_sim.dispersions import Dispersions, load_dispersions
from ares_vehicle_sim.simulator import CAMPAIGN, SimulatorOptions


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


@pytest.fixture(scope="module")
def standard(ares_v):
    return Settings(ares_v, load_dispersions("standard"))


@pytest.fixture(scope="module")
def hundred(standard):
    """Fly a campaign of 100 flights in this thread."""
    flyer = FlightRange(standard)
    names = standard.mission.jettison_names
    return make_table(flyer.fly(0, 100), flyer.columns, names, flyer.pieces)


def fly(plan, folder, engine=fly_here, watch=lambda _: None):
    with Store(folder, plan.settings) as store:
        count = fly_campaign(plan, store, engine, watch)
        return count, pq.read_table(store.flights)


# ---- a flight


def test_a_flight_is_that_of_the_nodes_two_steps(standard, ares_v):
    results = FlightRange(standard).fly(3, 2).results
    for k, flight in enumerate((3, 4)):
        alone = fly_compiled(
            ares_v, options=CAMPAIGN, dispersions=standard.dispersions, flight=flight
        ).plant
        assert results["mass"][k] == alone["mass"]
        assert results["end_time"][k] == alone["time"]
        assert results["propellant_used"][k] == alone["propellant_used"]


def test_a_flight_does_not_depend_on_those_before_it(standard):
    many = FlightRange(standard).fly(0, 20)
    alone = FlightRange(standard).fly(13, 1)
    assert many.results[13].tobytes() == alone.results[0].tobytes()


@pytest.mark.parametrize("name", ["ares_v", "saturn_v_as506", "delta_iii"])
def test_campaigns_step_finely_enough(name):
    """Compare steps of 1 s with steps of 0.05 s, under the widest dispersions."""
    dispersions = load_dispersions("wide_start" if name == "ares_v" else "standard")
    settings = Settings(load_mission(name), dispersions)
    fine = Settings(settings.mission, dispersions, options=SimulatorOptions(1.0, 0.05))
    one, two = (FlightRange(given).fly(0, 20).results for given in (settings, fine))
    assert one["mass"] == pytest.approx(two["mass"], abs=2e-5)
    assert one["end_time"] == pytest.approx(two["end_time"], abs=1e-7)
    assert one["jettison_time"] == pytest.approx(two["jettison_time"], abs=1e-6, nan_ok=True)


def test_standard_dispersions_all_arrive(hundred):
    assert hundred.num_rows == 100
    for name in ("terminal_accuracy", "fairing_off", "heating_kept", "succeeded"):
        assert all(hundred[name].to_pylist()), name
    assert set(hundred["outcome"].to_pylist()) == {Verdict.SUCCESS}
    assert hundred["failure"].null_count == 100
    assert np.max(hundred["heating_at_jettison_w_m2"].to_numpy()) <= 1135.0


def test_a_campaign_to_elements_is_judged_and_told():
    mission = load_mission("ares_v")
    target = {
        "perigee_altitude_m": 185e3,
        "apogee_altitude_m": 35786e3,
        "inclination_deg": 28.5,
    }
    mission = Mission.model_validate(mission.model_dump() | {"target": target})
    row = only_flight(mission)
    assert row["succeeded"], row["failure"]
    assert row["radius_error_m"] is None
    assert abs(row["perigee_radius_error_m"]) < 100.0
    assert abs(row["apogee_radius_error_m"]) < 5e3
    assert row["c3_error_m2_s2"] is None
    lost = only_flight(mission, navigation={"velocity_bias_m_s": constant(5.0)})
    assert lost["outcome"] == Verdict.TARGET_MISSED
    assert "radius by" not in lost["failure"].replace("perigee radius", "").replace(
        "apogee radius", ""
    )
    assert "apogee radius by" in lost["failure"]


# ---- failures


def only_flight(mission, **given):
    flyer = FlightRange(Settings(mission, Dispersions(**given)))
    return make_table(flyer.fly(0, 1), flyer.columns, mission.jettison_names).to_pylist()[0]


def constant(value):
    return {"mean": value, "sigma": 0.0}


@pytest.mark.parametrize(
    ("given", "outcome", "words"),
    [
        ({"thrust": constant(-0.5)}, Verdict.IMPACT, "met the ground at"),
        (
            {"navigation": {"position_bias_m": constant(1000.0)}},
            Verdict.TARGET_MISSED,
            (
                "target missed: radius by +841 m, flight path angle by +0.0013 deg, "
                "inclination by -0.012 deg"
            ),
        ),
        ({"log_density": constant(5.0)}, Verdict.FAIRING_ON, "payload fairing on at cut-off"),
        (
            {"jettison_limit": constant(-0.1)},
            Verdict.HEATING_EXCEEDED,
            "heating at jettison 1134.9 W/m2, limit 1021.5",
        ),
    ],
)
def test_each_failure_has_its_reason(ares_v, given, outcome, words):
    row = only_flight(ares_v, **given)
    assert row["outcome"] == outcome, row["failure"]
    assert words in row["failure"]
    assert not row["succeeded"]
    assert row["terminal_accuracy"] == (outcome in (Verdict.FAIRING_ON, Verdict.HEATING_EXCEEDED))
    assert row["fairing_off"] == (outcome in (Verdict.TARGET_MISSED, Verdict.HEATING_EXCEEDED))
    assert (row["t_plf_s"] is None) == (not row["fairing_off"])
    # nothing was dropped too early where nothing was dropped
    assert row["heating_kept"] == (outcome in (Verdict.IMPACT, Verdict.FAIRING_ON))


def test_depletion_has_its_reason(ares_v):
    core, upper = ares_v.stages
    scarce = upper.model_copy(update={"propellant_kg": 130_000.0})
    row = only_flight(
        ares_v.model_copy(update={"stages": (core, scarce)}), stage_mass=[0.0, constant(0.02)]
    )
    assert row["outcome"] == Verdict.DEPLETION
    assert row["failure"].startswith("propellant gone at 774.2 s, before cut-off; target missed: ")
    assert row["t_meco_s"] is None
    assert row["propellant_used_kg"] == pytest.approx(130_000.0)
    assert not row["terminal_accuracy"]


def test_an_exception_is_one_flights_own(standard, monkeypatch):
    flyer = FlightRange(standard)
    real = flights.begin

    def fail_at_seven(variations, *rest):
        if 7 in variations["errors"]["flight"]:
            raise FloatingPointError("struck\nby lightning")
        real(variations, *rest)

    monkeypatch.setattr(flights, "begin", fail_at_seven)
    table = make_table(flyer.fly(5, 4), flyer.columns, standard.mission.jettison_names)
    rows = table.to_pylist()
    assert [row["outcome"] for row in rows] == ["success", "success", "error", "success"]
    assert rows[2]["failure"] == "FloatingPointError: struck by lightning"
    assert rows[2]["m_f_kg"] is None
    assert rows[2]["flight"] == 7
    monkeypatch.undo()
    assert (
        rows[3]
        == make_table(flyer.fly(8, 1), flyer.columns, standard.mission.jettison_names).to_pylist()[
            0
        ]
    )


# ---- the folder


def test_chunks_fill_what_is_missing():
    assert list(missing([], 100)) == [(0, 25), (25, 25), (50, 25), (75, 25)]
    assert list(missing([(0, 30), (40, 10)], 60)) == [(30, 10), (50, 10)]
    assert list(missing([(0, 100)], 100)) == []
    chunks = list(missing([(5000, 1000)], 20_000))
    assert sum(count for _, count in chunks) == 19_000
    assert max(count for _, count in chunks) == 1000


def test_a_campaign_is_one_file_of_all_flights_in_order(standard, hundred, tmp_path):
    seen = []
    count, table = fly(
        CampaignPlan(standard, 100), tmp_path / "c", watch=lambda t: seen.append(t.num_rows)
    )
    assert count == 100
    assert table.equals(hundred)
    assert sum(seen) == 100
    assert len(seen) > 1
    assert sorted(path.name for path in (tmp_path / "c").iterdir()) == [
        "campaign.json",
        "flights.parquet",
        "parts",
    ]


def test_an_interrupted_campaign_goes_on(standard, hundred, tmp_path):
    flown = []

    def interrupt(table):
        flown.append(table.num_rows)
        if len(flown) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly(CampaignPlan(standard, 100), tmp_path, watch=interrupt)
    (tmp_path / "parts" / "half.partial").write_bytes(b"killed here")
    again = []
    _, table = fly(CampaignPlan(standard, 100), tmp_path, watch=lambda t: again.append(t.num_rows))
    assert sum(flown) + sum(again) == 100
    assert table.equals(hundred)


def test_a_finished_campaign_can_grow(standard, hundred, tmp_path):
    fly(CampaignPlan(standard, 30), tmp_path)
    again = []
    _, table = fly(CampaignPlan(standard, 100), tmp_path, watch=lambda t: again.append(t.num_rows))
    assert sum(again) == 70
    assert table.equals(hundred)
    for plan in (CampaignPlan(standard, 50), CampaignPlan(standard, 50, success_width=1e-9)):
        with pytest.raises(StoreError, match="holds 100 flights, more than 50"):
            fly(plan, tmp_path)
        assert pq.read_table(tmp_path / "flights.parquet").equals(hundred)
    assert fly(CampaignPlan(standard, 100), tmp_path)[1].equals(hundred)


def test_another_campaign_is_refused(standard, tmp_path):
    fly(CampaignPlan(standard, 25), tmp_path)
    others = {
        "seed was 0, now 1": Settings(standard.mission, standard.dispersions, seed=1),
        'guidance was "peg", now "optimal"': Settings(
            standard.mission, standard.dispersions, law="optimal"
        ),
        "dispersions.draws was": Settings(
            standard.mission, standard.dispersions.model_copy(update={"draws": "sobol"})
        ),
        'mission.title was "Ares V cargo': Settings(
            standard.mission.model_copy(update={"title": "Ares VI"}), standard.dispersions
        ),
    }
    for words, settings in others.items():
        with pytest.raises(StoreError) as caught:
            Store(tmp_path, settings)
        assert f"{tmp_path}: holds another campaign: {words}" in str(caught.value)
        assert "\n" not in str(caught.value)


def test_folders_that_cannot_hold_a_campaign(standard, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "novel.txt").write_text("once")
    with pytest.raises(StoreError, match="is no campaign; expected a new or empty folder"):
        Store(tmp_path / "full", standard)
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match=r"is a file; expected a folder"):
        Store(tmp_path / "file", standard)
    with (
        Store(tmp_path / "held", standard),
        pytest.raises(StoreError, match="another process flies this campaign"),
    ):
        Store(tmp_path / "held", standard)
    (tmp_path / "held" / "campaign.json").write_text("{")
    with pytest.raises(StoreError, match=r"campaign\.json is damaged"):
        Store(tmp_path / "held", standard)


def test_the_folder_says_what_was_flown(standard, tmp_path):
    fly(CampaignPlan(standard, 25), tmp_path)
    said = json.loads((tmp_path / "campaign.json").read_text())
    assert said["guidance"] == "peg"
    assert said["mission"]["name"] == "ares_v"
    assert said["dispersions"]["thrust"] == [{"centre": 0.0, "size": 0.01, "even": False}]
    assert said["simulator"]["integration_step_s"] == 1.0


# ---- who flies


def test_threads_fly_the_same_bit_for_bit(standard, hundred, tmp_path):
    _, table = fly(CampaignPlan(standard, 100), tmp_path, partial(fly_on_cores, count=3))
    assert table.equals(hundred)


def start(arguments, **environment):
    return subprocess.Popen(
        [sys.executable, "-m", *arguments],
        env={**os.environ, **environment},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Start a scheduler with two workers; return its address and the workers."""
    from distributed import Client

    folder = tmp_path_factory.mktemp("dask")
    where = folder / "scheduler.json"
    given = ["--scheduler-file", str(where), "--no-dashboard"]
    with ExitStack() as stack:

        def run(*arguments):
            process = start(arguments)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        scheduler = run(
            "distributed.cli.dask_scheduler", *given, "--host", "127.0.0.1", "--port", "0"
        )
        while not (address := address_in(where)):
            assert scheduler.poll() is None
            time.sleep(0.05)
        workers = [
            run(
                *("distributed.cli.dask_worker", address, "--no-dashboard"),
                *("--nthreads", "1", "--no-nanny"),
                *("--local-directory", str(folder / name), "--name", name),
            )
            for name in ("one", "two")
        ]
        with Client(address, set_as_default=False, timeout=120) as client:
            client.wait_for_workers(2, timeout=240)
        yield address, workers


def address_in(file):
    """Return the scheduler's address; "" until its file is complete."""
    try:
        return json.loads(file.read_text())["address"]
    except (FileNotFoundError, json.JSONDecodeError):
        return ""


def test_a_cluster_flies_the_same(standard, hundred, tmp_path):
    from distributed import LocalCluster

    # its workers are threads: `make trials` has processes
    given = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    place = {"protocol": "tcp", "host": "127.0.0.1"}
    with LocalCluster(processes=False, **given, **place) as threads:
        engine = partial(fly_on_cluster, address=threads.scheduler_address)
        _, table = fly(CampaignPlan(standard, 100), tmp_path / "both", engine)
    assert table.equals(hundred)


@pytest.mark.trial
def test_a_cluster_flies_the_same_and_a_lost_worker_loses_no_flight(
    standard, hundred, tmp_path, cluster
):
    address, workers = cluster
    engine = partial(fly_on_cluster, address=address)
    _, table = fly(CampaignPlan(standard, 100), tmp_path / "both", engine)
    assert table.equals(hundred)

    def kill_one(_):
        if workers[0].poll() is None:
            workers[0].send_signal(signal.SIGKILL)
            workers[0].wait()

    _, table = fly(CampaignPlan(standard, 100), tmp_path / "one", engine, watch=kill_one)
    assert workers[0].poll() is not None
    assert table.equals(hundred)


def test_a_chunk_that_no_worker_brings_home_is_logged(standard):
    table = engines.lost(standard, (5, 3), RuntimeError("all\nworkers gone"))
    assert table["flight"].to_pylist() == [5, 6, 7]
    assert set(table["outcome"].to_pylist()) == {Verdict.ERROR}
    assert set(table["failure"].to_pylist()) == {"RuntimeError: all workers gone"}


def test_no_scheduler_is_one_line(standard, tmp_path, monkeypatch):
    monkeypatch.setattr(engines, "CONNECT_TIMEOUT", 0.5)
    with socket.socket() as held:
        # a port of one's own at which nobody listens
        held.bind(("127.0.0.1", 0))
        engine = partial(fly_on_cluster, address=f"tcp://127.0.0.1:{held.getsockname()[1]}")
        with pytest.raises(EngineError, match="no Dask scheduler at") as caught:
            fly(CampaignPlan(standard, 25), tmp_path, engine)
    assert "\n" not in str(caught.value)


def test_a_chunk_names_what_it_needs_by_pickle(standard, hundred):
    assert fly_chunk(pickle.dumps(standard), (10, 3)).equals(hundred.slice(10, 3))


# ---- stopping early


def test_a_campaign_stops_when_it_knows_enough(standard, tmp_path):
    from scipy.stats import binomtest

    plan = CampaignPlan(standard, 2000, success_width=0.08)
    counts = set()
    for name, engine in (("here", fly_here), ("cores", partial(fly_on_cores, count=3))):
        count, table = fly(plan, tmp_path / name, engine)
        counts.add(count)
        assert table.num_rows == count
        assert table["flight"].to_pylist() == list(range(count))
    assert len(counts) == 1
    count = counts.pop()
    low, high = binomtest(count, count).proportion_ci(0.95, "exact")
    assert high - low <= 0.08
    assert count < 200
    # and again: nothing more is flown
    assert fly(plan, tmp_path / "here")[0] == count


def test_a_campaign_stops_on_its_mass(standard, tmp_path):
    count, table = fly(CampaignPlan(standard, 2000, mass_width_kg=1500.0), tmp_path)
    tally = Tally()
    tally.add(table)
    low, high = tally.mass_intervals()[0]
    assert high - low <= 1500.0
    assert count < 400


# ---- what is said


def test_tally_of_a_campaign_in_pieces(hundred):
    whole, pieces = Tally(), Tally()
    whole.add(hundred)
    for first in range(0, 100, 30):
        pieces.add(hundred.slice(first, 30))
    mass = hundred["m_f_kg"].to_numpy()
    for tally in (whole, pieces):
        assert tally.n == 100
        assert tally.counts["succeeded"] == 100
        assert tally.outcomes == {"success": 100}
        assert tally.mass() == pytest.approx((np.mean(mass), np.std(mass, ddof=1)))
        assert (tally.least, tally.most) == (mass.min(), mass.max())


def test_intervals_are_those_of_the_textbook(hundred):
    from scipy.stats import norm

    tally = Tally()
    tally.add(hundred)
    assert tally.proportion("succeeded") == pytest.approx((0.025 ** (1 / 100), 1.0))
    mass = hundred["m_f_kg"].to_numpy()
    (low, high), (low_std, high_std) = tally.mass_intervals()
    expected = norm.interval(0.95, mass.mean(), mass.std(ddof=1) / 10.0)
    assert (low, high) == pytest.approx(expected, abs=0.1 * (high - low))
    assert low_std < mass.std(ddof=1) < high_std


def test_blocks_resample_as_well_as_flights():
    """Add many more flights than blocks: the interval of the mean keeps its width."""
    rng = np.random.default_rng(1)
    mass = rng.normal(170e3, 2e3, 20_000)
    flags = np.ones(mass.size, bool)
    columns = dict.fromkeys(
        ("terminal_accuracy", "fairing_off", "heating_kept", "succeeded"), flags
    )
    tally = Tally()
    tally.add(
        pa.table(
            {
                "flight": np.arange(mass.size),
                "m_f_kg": mass,
                "outcome": ["success"] * mass.size,
                **columns,
            }
        )
    )
    low, high = tally.mass_intervals()[0]
    assert high - low == pytest.approx(2 * 1.96 * 2e3 / math.sqrt(mass.size), rel=0.12)


def test_the_reserve_is_enough_as_often_as_it_says():
    from scipy.stats import binom

    assert flights_needed() == 767
    assert bound_rank(766) == 0
    assert bound_rank(767) == 1
    n = 3000
    rank = bound_rank(n)
    # the chance that the bound lies beyond the 99.7 % quantile, and just so
    assert binom.sf(rank - 1, n, 0.003) >= 0.90 > binom.sf(rank, n, 0.003)


def mass_of(rows):
    return np.array([row["m_f_kg"] for row in rows])


def test_one_failed_flight_does_not_flatten_the_others(hundred, tmp_path):
    """Check that an outlier is counted beside the bins."""
    mass = hundred["m_f_kg"].to_numpy().copy()
    good = hundred["succeeded"].to_numpy().copy()
    mass[7], good[7] = 0.2 * mass[7], False
    columns = {"m_f_kg": mass, "succeeded": good}
    table = hundred
    for name, values in columns.items():
        table = table.set_column(table.schema.get_field_index(name), name, pa.array(values))
    path = tmp_path / "flights.parquet"
    pq.write_table(table, path)
    histogram = summarize(path, 127_880.0).histograms["m_f_kg"]
    assert (histogram.edges[0], histogram.edges[-1]) == (mass[good].min(), mass[good].max())
    assert (histogram.below, histogram.above) == (1, 0)
    # as many bins as the square root of the flights
    assert histogram.failed.tolist() == 10 * [0]
    assert histogram.counts.sum() == 99


def test_a_histogram_of_few_successes_shows_nearly_all_flights(hundred, tmp_path):
    mass = hundred["m_f_kg"].to_numpy()
    good = np.argsort(mass).argsort() // 2 == 25
    place = hundred.schema.get_field_index("succeeded")
    path = tmp_path / "flights.parquet"
    pq.write_table(hundred.set_column(place, "succeeded", pa.array(good)), path)
    histogram = summarize(path, 127_880.0).histograms["m_f_kg"]
    assert histogram.counts.sum() == 2
    inside = (mass >= histogram.edges[0]) & (mass <= histogram.edges[-1])
    assert 98 <= np.count_nonzero(inside) == 2 + histogram.failed.sum()
    assert histogram.below + histogram.above == 100 - np.count_nonzero(inside)
    # none is heaped at an edge
    expected = np.histogram(mass[inside & ~good], histogram.edges)[0]
    assert histogram.failed.tolist() == expected.tolist()


def test_a_single_failure_is_marked_in_every_histogram(standard, tmp_path):
    weak = Settings(
        standard.mission,
        Dispersions(thrust=0.01, log_density={"mean": 0.0, "sigma": 1.5}),
    )
    _, table = fly(CampaignPlan(weak, 60), tmp_path, partial(fly_on_cores, count=2))
    rows = table.to_pylist()
    first = next(row["flight"] for row in rows if not row["succeeded"])
    kept = [row["flight"] for row in rows if row["succeeded"] or row["flight"] == first]
    pq.write_table(table.take(kept), tmp_path / "one.parquet")
    summary = summarize(tmp_path / "one.parquet", 127_880.0)
    assert [row["flight"] for row in summary.failures] == [first]
    globe = make_ways(weak, [], summary.failed)
    report = make_report(weak, summary, {}, "./ares fly", {}, globe)
    assert report.command == "./ares fly"
    histograms = [
        item.content
        for chapter in report.chapters
        for item in chapter.items
        if item.kind == "figure" and item.content.y.title == "flights"
    ]
    assert len(histograms) >= 6
    for figure in histograms:
        (mark,) = [one for one in figure.series if one.shape == "marks"]
        assert len(mark.x) == 1
        assert mark.texts[0].startswith(f"flight {first}<br>")
    # its fairing stayed on: where there is no time of that, it stands beside the bins
    jettison = next(f for f in histograms if f.x.title == "fairing jettison")
    (mark,) = [one for one in jettison.series if one.shape == "marks"]
    assert mark.x[0] > jettison.series[0].x[-1]
    assert "no fairing jettison" in mark.texts[0]
    assert "1 that have no value" in jettison.finding


def test_perigee_and_apogee_are_those_of_the_state_reached():
    mission = load_mission("ares_v")
    target, mu = target_record(mission)[0], mission.environment.mu_m3_s2
    names = ("perigee_radius_error_m", "apogee_radius_error_m", "semi_major_axis_error_m")
    sample = {name: np.full(3, np.nan) for name in (*names, "eccentricity_error")}
    sample["radius_error_m"] = np.array([0.0, 50.0, np.nan])
    sample["speed_error_m_s"] = np.array([0.0, -3.0, 0.0])
    sample["flight_path_angle_error_deg"] = np.array([0.0, 0.2, 0.0])
    perigee, apogee = perigee_apogee(sample, target, mu)
    for k in range(2):
        r = float(target["radius"]) + sample["radius_error_m"][k]
        v = float(target["speed"]) + sample["speed_error_m_s"][k]
        angle = float(target["flight_path_angle"])
        angle += math.radians(sample["flight_path_angle_error_deg"][k])
        state = (np.array([r, 0.0, 0.0]), v * np.array([math.sin(angle), math.cos(angle), 0.0]))
        orbit = Elements.from_state(*state, mu)
        assert perigee[k] == pytest.approx(orbit.perigee_radius, abs=0.01)
        assert apogee[k] == pytest.approx(orbit.apogee_radius, abs=0.01)
    assert math.isnan(perigee[2])
    transfer = target_record(load_mission("geostationary_transfer"))[0]
    sample["perigee_radius_error_m"] = np.array([1.0, 2.0, 3.0])
    sample["apogee_radius_error_m"] = np.array([-1.0, 0.0, 1.0])
    perigee, apogee = perigee_apogee(sample, transfer, mu)
    assert perigee[2] - float(transfer["perigee_radius"]) == pytest.approx(3.0, abs=1e-6)
    assert apogee[0] - float(transfer["apogee_radius"]) == pytest.approx(-1.0, abs=1e-6)


def test_a_summary_of_a_campaign(standard, tmp_path):
    weak = Settings(
        standard.mission,
        Dispersions(thrust=0.01, log_density={"mean": 0.0, "sigma": 2.5}),
    )
    _, table = fly(CampaignPlan(weak, 1000), tmp_path, partial(fly_on_cores, count=2))
    summary = summarize(tmp_path / "flights.parquet", 127_880.0)
    failed = [row for row in table.to_pylist() if not row["succeeded"]]
    assert failed
    assert [row["flight"] for row in summary.worst["failures"]] == [
        row["flight"] for row in failed[:10]
    ]
    mass = table["m_f_kg"].to_numpy()
    assert [row["m_f_kg"] for row in summary.worst["least final mass"]] == sorted(mass)[:5]
    used = np.sort(
        np.where(table["terminal_accuracy"].to_numpy(), table["propellant_used_kg"], np.inf)
    )
    assert summary.reserve.used_kg == used[-bound_rank(1000)]
    assert summary.reserve.reserve_kg == pytest.approx(summary.reserve.used_kg - 127_880.0)
    histogram = summary.histograms["m_f_kg"]
    assert histogram.counts.sum() == 1000 - len(failed)
    outside = histogram.below + histogram.above
    assert histogram.failed.sum() + outside == np.count_nonzero(np.isfinite(mass_of(failed)))
    good = [row["m_f_kg"] for row in table.to_pylist() if row["succeeded"]]
    width = max(good) - min(good)
    assert histogram.edges[0] >= min(good) - 0.25 * width
    assert histogram.edges[-1] <= max(good) + 0.25 * width
    assert histogram.below == np.count_nonzero(mass_of(failed) < histogram.edges[0])
    assert histogram.above == np.count_nonzero(mass_of(failed) > histogram.edges[-1])
    assert summary.failed == {row["flight"]: row["failure"] for row in failed[:30]}
    strongest, correlation = next(iter(summary.influences["m_f_kg"].items()))
    assert strongest == "thrust_core"
    assert correlation > 0.5
    assert next(iter(summary.influences["t_plf_s"])) == "log_density"


def test_a_way_over_the_earth_is_that_of_the_flight(standard):
    """Check that a track ends at the time and place of the campaign's flight."""
    globe = make_ways(standard, [3], {5: "why"})
    table = make_table(
        FlightRange(standard).fly(0, 6), FlightRange(standard).columns, ("payload fairing",)
    )
    names = [flight.name for flight in globe.flights]
    assert names == ["the nominal flight", "flight 3", "flight 5: why"]
    for k, flight in zip((3, 5), globe.flights[1:], strict=True):
        assert flight.time_s[0] == pytest.approx(standard.mission.start().time_s, abs=0.05)
        assert flight.time_s[-1] == pytest.approx(table["t_meco_s"][k].as_py(), abs=0.06)
        radius = standard.mission.environment.earth.equatorial_radius_m
        target = standard.mission.arrays().target["radius"][0]
        assert radius * (1.0 + flight.height[-1]) == pytest.approx(target, abs=200.0)
    assert len(globe.land) > 10


def test_a_summary_takes_no_more_memory_for_more_flights(hundred, tmp_path, monkeypatch):
    held = []
    add = Tally.add

    def watched(tally, table):
        held[-1] = max(held[-1], pa.total_allocated_bytes())
        add(tally, table)

    monkeypatch.setattr(Tally, "add", watched)
    for copies in (600, 3000):
        path = tmp_path / f"{copies}.parquet"
        many = pa.concat_tables([hundred] * copies).combine_chunks()
        many = many.set_column(0, "flight", pa.array(np.arange(many.num_rows)))
        pq.write_table(many, path, row_group_size=GROUP)
        del many
        held.append(0)
        assert summarize(path, 127_880.0).tally.n == 100 * copies
    assert held[1] < 1.2 * held[0]


def test_the_page_shows_the_campaign(standard, tmp_path):
    settings = Settings(
        standard.mission, Dispersions(thrust=0.01, log_density={"mean": 0.0, "sigma": 2.0})
    )
    _, table = fly(CampaignPlan(settings, 200), tmp_path)
    summary = summarize(tmp_path / "flights.parquet", 127_880.0)
    facts = {"flights": "200", "guidance": "peg", "file": "flights.parquet"}
    failures = summary.worst["failures"]
    reached = reaches(settings, failures)
    assert sorted(reached) == [row["flight"] for row in failures]
    globe = make_ways(settings, sampled(summary), summary.failed)
    report = make_report(settings, summary, facts, "./ares fly --seed 0", reached, globe)
    json.dumps(report.to_json(), allow_nan=False)
    items = {item.title: item for chapter in report.chapters for item in chapter.items}
    bars = items["Final mass"].content.series
    assert [series.name for series in bars] == ["success", "failure", "each failure"]
    masses = summary.histograms["m_f_kg"]
    assert sum(sum(series.y) for series in bars) + masses.below + masses.above == 200
    cloud = items["Radius against speed"].content.series
    assert sum(len(series.x) for series in cloud) == 200
    failed = table.filter(np.logical_not(table["succeeded"].to_numpy()))
    assert [case.flight for case in report.cases["failures"]] == failed["flight"].to_pylist()[:10]
    shown = Counter(flight.role for flight in globe.flights)
    assert shown["thesis"] == len(summary.failed)
    assert shown["other"] == 1
    assert shown["here"] == len(sampled(summary)) == 20
    assert not set(sampled(summary)) & set(failed["flight"].to_pylist())
    page = render(report)
    assert report.masses.finding in page
    assert len(page) < 4e6
    first = report.cases["least final mass"][0]
    assert first.command == f"./ares fly --seed 0 --flight {first.flight}"
    for words in (
        first.command,
        "200 flights, guidance peg",
        "payload fairing on at cut-off; within reach: the optimum ends with 1",
    ):
        assert words in page
    # nothing is loaded from elsewhere
    head = page[: page.index('<script type="application/json"')]
    assert "http" not in head.replace("http-equiv", "")


@pytest.mark.parametrize(
    ("column", "name"),
    [
        ("thrust_upper_stage", "thrust upper stage"),
        ("initial_position_m_crossrange", "initial position crossrange"),
        ("log_density", "density"),
        ("navigation_position_bias_m_x", "navigation position x"),
        ("jettison_mass_payload_fairing", "mass of payload fairing"),
        ("start_delay_s_core", "start delay core"),
    ],
)
def test_what_is_drawn_has_a_name_for_people(column, name):
    assert drawn_name(column) == name


def test_a_campaign_from_the_pad_tells_its_loads(tmp_path, hundred):
    limits = (
        "max_dynamic_pressure_pa: 60000.0\n    max_q_alpha_pa_rad: 14000.0\n    thrust_n: 1083100.0"
    )
    text = MISSION.find("delta_iii_pad").read_text().replace("thrust_n: 1083100.0", limits)
    mission = parse_mission(text, "limited.yaml")
    settings = Settings(mission, load_dispersions("standard", mission), seed=3)
    _, table = fly(CampaignPlan(settings, 60), tmp_path / "pad")
    rows = table.to_pylist()
    for load, share, limit in (
        ("max_q_pa", "max_q_of_limit", 60e3),
        ("max_q_alpha_pa_rad", "max_q_alpha_of_limit", 14e3),
    ):
        values = np.array([row[load] for row in rows])
        # the first stage has the limits and the greatest loads
        assert [row[share] for row in rows] == pytest.approx(values / limit)
        found = summarize(tmp_path / "pad" / "flights.parquet", 1.0).loads[load]
        assert found.mean == pytest.approx(values.mean())
        assert found.most == values.max()
        assert found.worst == pytest.approx(values.max() / limit)
        assert (found.limited, found.kept) == (60, np.count_nonzero(values <= 1.001 * limit))
        assert math.isnan(found.bound)
    summary = summarize(tmp_path / "pad" / "flights.parquet", 1.0)
    shown = make_report(settings, summary, {}, "", {}, make_ways(settings, [], {})).masses
    # of so few flights there is no bound
    columns = ["mean", "standard deviation", "least", "greatest", "flights within limit"]
    assert [column.title for column in shown.columns] == columns
    assert "takes 767 flights" in shown.finding
    assert [row.label for row in shown.rows[1:]] == [
        "highest dynamic pressure, Pa",
        "highest dynamic pressure times angle of attack, Pa rad",
    ]
    kept = summary.loads["max_q_pa"].kept
    assert shown.rows[1].cells[-1].text == f"{kept}\u00a0of\u00a060"
    assert np.ptp([row["draw_gust_azimuth_deg"] for row in rows]) > 180.0
    # the fall of a flight that meets the ground is no load of the ascent
    rows[0] |= {"outcome": Verdict.IMPACT, "max_q_pa": 1e6}
    pq.write_table(pa.Table.from_pylist(rows, table.schema), tmp_path / "fallen.parquet")
    found = summarize(tmp_path / "fallen.parquet", 1.0).loads["max_q_pa"]
    assert found.most == max(row["max_q_pa"] for row in rows[1:])
    assert found.limited == 60
    # above the air there is none
    assert hundred["max_q_pa"].null_count == hundred["max_q_alpha_of_limit"].null_count == 100
    path = tmp_path / "vacuum.parquet"
    pq.write_table(hundred, path)
    assert summarize(path, 1.0).loads == {}


def test_more_wind_makes_more_load():
    mission = load_mission("delta_iii_pad")
    winds = load_dispersions("standard", mission)
    calm = winds.model_copy(update={"wind": None, "gust": None})
    most = [
        FlightRange(Settings(mission, given, seed=5)).fly(0, 40).results for given in (calm, winds)
    ]
    assert most[1]["most_q_alpha"].std() > 1.5 * most[0]["most_q_alpha"].std()
    # the orbit does not mind
    assert np.abs(most[1]["mass"] - most[0]["mass"]).max() < 40.0
    assert list(most[1]["terminal_accuracy"]) == list(most[0]["terminal_accuracy"])

# SPDX-License-Identifier: Apache-2.0
"""`ares montecarlo` from the command line."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import pyarrow.parquet as pq
import pytest

from ares_models.mission import TEMPLATE
from ares_trials.testing.samples import one_in

COMMAND = (sys.executable, "-m", "ares_bringup", "montecarlo")


def run(*argv):
    return subprocess.run(
        [*COMMAND, *argv], capture_output=True, text=True, check=False, timeout=240
    )


def test_one_json_object(ares, tmp_path):
    done = ares("montecarlo", "-n", "40", "--json", "--out", str(tmp_path / "c"))
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert [said[key] for key in ("n", "succeeded", "terminal_accuracy")] == [40, 40, 40]
    assert [said[key] for key in ("fairing_off", "heating_kept")] == [40, 40]
    mass = said["m_f_kg"]
    assert mass["min"] < mass["mean"] < mass["max"]
    assert 1000.0 < mass["std"] < 4000.0
    assert said["flights_per_s"] > 0.0
    assert said["wall_s"] > 0.0
    assert (said["planning_s"], said["by_peg_s"]) == (0.0, 0.0)
    assert said["outcomes"] == {"success": 40}
    core, fairing = said["footprints"]
    assert (core["name"], core["flights"], fairing["flights"]) == ("core", 40, 40)
    assert 0.0 < core["minor_km"] < core["major_km"] and 0.0 <= core["azimuth_deg"] < 180.0
    assert "<name>payload fairing</name>" in (tmp_path / "c" / "footprints.kml").read_text()
    table = pq.read_table(said["results"])
    assert table.num_rows == 40
    assert max(table["m_f_kg"].to_pylist()) == mass["max"]
    # again: nothing to fly, the same said
    argv = ("-n", "40", "--json", "--out", str(tmp_path / "c"))
    again = json.loads(ares("montecarlo", *argv).stdout)
    assert again["m_f_kg"] == mass
    assert again["flights_per_s"] is None


def test_tables_for_people(ares, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = ares("montecarlo", "-n", "30", "--out", "c", "--seed", "3", "--hold-time", "8")
    assert done.returncode == 0, done.stderr
    for words in ("guidance peg, 30 flights", "95 % interval", "heating kept", "final mass"):
        assert words in done.stdout
    assert "reserve       needs at least 767 flights" in done.stdout
    assert "core: down at" in done.stdout
    assert "flights   c/flights.parquet" in done.stdout
    assert "report    c/report.html" in done.stdout
    again = "./ares fly --mission ares_v --guidance peg --dispersions standard --seed 3"
    assert f"again     {again} --hold-time 8.0 --flight K" in done.stdout
    # no bar where there is no terminal
    assert done.stderr == ""
    page = (tmp_path / "c" / "report.html").read_text(encoding="utf-8")
    assert f"{again} --hold-time 8.0 --flight" in page


@pytest.mark.trial
def test_the_plan_and_what_peg_flies_of_it_are_told(ares, tmp_path):
    words = ("montecarlo", "-n", "2", "--mission", "ariane5_eca_pad", "--guidance", "igm")
    done = ares(*words, "--out", str(tmp_path / "c"))
    assert done.returncode == 0, done.stderr
    found = re.search(r"by peg +(\d+) s of the undisturbed flight: igm has no sol", done.stdout)
    assert found
    assert 600 < int(found[1]) < 650
    assert re.search(r"wall time [\d.]+ s, [\d.]+ s of it for the plan, ", done.stdout)


@pytest.mark.trial
def test_a_j2_that_is_not_on_board_is_told_where_flights_miss_by_it(ares, tmp_path):
    text = TEMPLATE.read_text()
    for old, new in (
        ("geodetic_latitude_deg: -39.26", "geodetic_latitude_deg: 62.9"),
        ("inclination_deg: 45.0", "inclination_deg: 64.0"),
        ("payload_kg: 200.0", "payload_kg: 120.0"),
        ("thrust_n: 25800.0", "thrust_n: 20000.0"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    for name, known, misses in (("sphere", "0", 2), ("oblate", "0.00108263", 0)):
        file = tmp_path / f"{name}.yaml"
        file.write_text(text.replace("\n  earth:", f"\n  j2: {known}\n  earth:"))
        out = ("--out", str(tmp_path / name))
        said = ares("montecarlo", "-n", "2", "--mission", str(file), *out).stdout
        assert f"succeeded                {2 - misses} " in said
        told = re.search(
            r"j2 +0.0010826 in the dispersions, 0 on board: alone it takes (\d+) % of the "
            r"tolerance of flight path angle; name it in environment.j2\n",
            said,
        )
        assert (told is not None and int(told[1]) > 100) == (misses > 0)


def test_flights_one_by_one(ares, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = ares("montecarlo", "--only", "7", "--only", "123456", "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["n"] == said["succeeded"] == 2
    assert said["results"] is None
    assert [row["flight"] for row in said["flights"]] == [7, 123456]
    assert list(tmp_path.iterdir()) == []
    shown = ares("montecarlo", "--only", "7").stdout
    assert "flight 7: success" in shown
    assert f"{said['flights'][0]['m_f_kg']:,.3f}" in shown


@pytest.mark.trial
def test_a_dask_cluster_of_two_workers(ares, tmp_path):
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        argv = ("-n", "60", "--json", "--out", str(tmp_path / "there"))
        there = run(*argv, "--scheduler", cluster.scheduler_address)
    assert there.returncode == 0, there.stderr
    here = ares("montecarlo", "-n", "60", "--json", "--out", str(tmp_path / "here"))
    tables = [pq.read_table(json.loads(done.stdout)["results"]) for done in (there, here)]
    assert tables[0].equals(tables[1])


def test_a_law_that_does_not_arrive_is_refused_before_the_first_flight(ares, tmp_path):
    out = tmp_path / "c"
    words = ("--mission", "delta_iii_coast", "--guidance", "peg")
    done = ares("montecarlo", "-n", "10", *words, "--json", "--out", str(out))
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(
        r"ares: law is 'peg', which misses the target when the mission is flown ahead "
        r"\(.*\); try law optimal\n",
        done.stderr,
    )
    assert not out.exists()
    # nor is a flight of it, with the words of `fly`
    alone = ares("montecarlo", "--only", "3", *words)
    assert (alone.returncode, alone.stdout, alone.stderr) == (2, "", done.stderr)
    flown = ares("fly", *words, "--no-record")
    assert flown.returncode == 2
    assert flown.stderr.partition("(")[0] == done.stderr.partition("(")[0]


@pytest.mark.trial
@pytest.mark.parametrize("end", one_in(2, [signal.SIGINT, signal.SIGKILL]))
def test_an_interrupted_campaign_goes_on(ares, tmp_path, end):
    folder = tmp_path / "c"

    def campaign(count):
        return "-n", str(count), "--json", "--out", str(folder)

    # so many that it is certainly not over
    argv = campaign(10**8)
    flying = subprocess.Popen(
        [*COMMAND, *argv], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    parts = folder / "parts"
    while not list(parts.glob("*.parquet")):
        assert flying.poll() is None, flying.communicate()
        time.sleep(0.01)
    flying.send_signal(end)
    out, error = flying.communicate()
    assert out == ""
    if end == signal.SIGINT:
        assert flying.returncode == 130
        # also if a loaded machine ends it at once
        assert str(folder) in error or os.path.relpath(folder) in error
        assert "Traceback" not in error
    spans = [path.stem.partition("-") for path in parts.glob("*.parquet")]
    total = max(int(first) + int(count) for first, _, count in spans) + 100
    refused = ares("montecarlo", *argv, "--seed", "1")
    assert refused.returncode == 2
    assert refused.stderr.strip().endswith("holds another campaign: seed was 0, now 1")
    done = ares("montecarlo", *campaign(total))
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["n"] == total
    assert pq.read_table(folder / "flights.parquet")["flight"].to_pylist() == list(range(total))
    assert list(parts.iterdir()) == []


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["-n", "0"], "--flights is '0'; expected at least 1"),
        (["--mission", "soyuz"], "mission 'soyuz': no such mission"),
        (["--dispersions", "wild"], "dispersions 'wild': no such dispersions; shipped are"),
        (["--dispersions", "/nowhere.yaml"], "/nowhere.yaml: no such file"),
        (["--cycle-period", "0"], "--cycle-period is '0'; expected at least 0.001"),
        (["--out", __file__], "test_cli_montecarlo.py: is a file; expected a folder"),
        (["--out", "/proc/nothing"], "/proc/nothing: No such file or directory"),
        (["--scheduler", "nowhere"], "no Dask scheduler at 'nowhere'"),
        (["--only", "1", "--out", "c"], "--only and --out exclude each other"),
        (["--seed", "-1"], "--seed is '-1'; expected at least 0"),
        (["--seed", "x"], "--seed is 'x'; expected a whole number"),
        (["--stop-mass", "x"], "--stop-mass is 'x'; expected a number"),
        (["--heating-source", "sun"], "--heating-source is 'sun'; expected one of measured, model"),
        (["--guidance", "peg_thesis"], "starts by itself: one of igm"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(ares, tmp_path, monkeypatch, argv, words):
    monkeypatch.chdir(tmp_path)
    out = [] if "--out" in argv else ["--out", str(tmp_path / "c")]
    done = ares("montecarlo", *argv, *out)
    assert done.returncode == 2
    assert done.stdout == ""
    assert words in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_dispersions_that_do_not_fit_the_mission(ares, tmp_path):
    file = tmp_path / "three.yaml"
    file.write_text("thrust: [0.01, 0.01, 0.01]\n")
    done = ares("montecarlo", "--dispersions", str(file), "--out", str(tmp_path / "c"))
    assert done.returncode == 2
    words = "ares: dispersions: thrust is a list of 3; expected 2: core, upper_stage"
    assert done.stderr.strip() == words

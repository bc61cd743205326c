# SPDX-License-Identifier: Apache-2.0
"""`ares export`: a recorded flight as tables and on globes, read by other libraries."""

import csv
import json
import math
import shutil
from datetime import datetime
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from fastkml import Placemark
from fastkml.kml import KML
from fastkml.utils import find_all
from fastkml.validator import validate
from lxml import etree
from pyproj import Transformer

from ares_bringup.commands.cli import main
from ares_bringup.recorded import read_flight
from ares_models.mission import load_mission
from ares_studies.export.globes import NO_EPOCH
from ares_studies.export.tables import PLAIN, unit_of
from ares_trials.testing.flights import short_burn

REFERENCE = Path(__file__).parent.parent / "bags" / "reference"
EVENTS = [
    "flight started",
    "ignition: core",
    "arc ended: core",
    "staging: upper stage",
    "ignition: upper stage",
    "jettison: payload fairing",
    "main-engine cut-off",
    "flight complete",
]
BEGIN, END = 155.9, 767.1269222750327


def run(capfd, *words):
    capfd.readouterr()
    status = main(["export", *map(str, words)])
    return status, *capfd.readouterr()


@pytest.fixture
def exported(tmp_path, capfd):
    def make(form, *more):
        out = tmp_path / f"flight.{form}"
        words = ("--format", form, "--out", out, *more)
        assert run(capfd, REFERENCE, *words) == (0, f"{out}\n", "")
        return out

    return make


@pytest.fixture
def own_flight(ares, tmp_path):
    """Fly a mission of the user's, east of Greenwich, with ten states per guidance cycle."""
    content = short_burn() | {"epoch": "2031-12-31T23:00:00-05:00"}
    mission = tmp_path / "mine.yaml"
    mission.write_text(yaml.safe_dump(content), encoding="utf-8")
    words = ("--mission", str(mission), "--bag", str(tmp_path / "bag"), "--in-process")
    done = ares("fly", *words)
    assert done.returncode == 0, done.stderr
    return tmp_path / "bag"


def places():
    """Compute longitude, latitude, height of all states, by PROJ and by hand."""
    flight = read_flight(REFERENCE)
    truth = flight.columns["vehicle_state"]
    earth = load_mission("ares_v").environment.earth
    figure = f"+a={earth.equatorial_radius_m} +b={earth.polar_radius_m} +no_defs"
    to_place = Transformer.from_crs(f"+proj=geocent {figure}", f"+proj=longlat {figure}")
    x, y, z = truth["position"].T
    angle = math.radians(earth.zero_longitude_deg) + earth.rotation_rate_rad_s * truth["time"]
    cosine, sine = np.cos(angle), np.sin(angle)
    return to_place.transform(cosine * x + sine * y, cosine * y - sine * x, z)


# ---- tables


def test_the_commands_in_the_table_are_the_law_that_was_flown(ares, own_flight):
    """Extrapolate each row to the next: it matches the direction of the thrust."""
    assert ares("export", str(own_flight), "--format", "parquet").returncode == 0
    table = pq.read_table(own_flight / "flight.parquet").to_pydict()

    def vectors(name, unit=""):
        rows = [table[f"{name}_{axis}{unit}"] for axis in "xyz"]
        return np.array(rows, dtype=float).T

    direction, rate = vectors("command_direction"), vectors("command_direction_rate", "_per_s")
    flown, time = vectors("thrust_direction"), np.array(table["time_s"])
    burning = np.array(table["thrust_n"]) > 0.0
    asked = np.flatnonzero(burning[:-1] & burning[1:] & np.isfinite(direction[:-1, 0]))
    assert len(asked) > 300
    # between cycles the sum of the law is longer than 1
    commands = read_flight(own_flight).columns["thrust_command"]
    late = (commands["time"] - commands["reference_time"])[:, None]
    sums = np.linalg.norm(commands["direction"] + late * commands["direction_rate"], axis=1)
    assert np.max(np.abs(sums - 1.0)) > 1e-9
    step = (time[asked + 1] - time[asked])[:, None]
    carried = direction[asked] + rate[asked] * step
    carried /= np.linalg.norm(carried, axis=1, keepdims=True)
    assert carried == pytest.approx(flown[asked + 1], abs=1e-14)


def test_the_table_of_a_flight(exported):
    table = pq.read_table(exported("parquet"))
    truth = read_flight(REFERENCE).columns["vehicle_state"]
    assert table.num_rows == len(truth["time"])
    columns = {name: table[name].to_numpy() for name in table.column_names}
    for name, field in {
        "time_s": "time",
        "altitude_m": "altitude",
        "mass_kg": "mass",
        "thrust_n": "thrust",
        "heating_w_m2": "heating_rate",
    }.items():
        assert columns[name].tolist() == truth[field].tolist()
    assert columns["flight_path_angle_deg"] == pytest.approx(np.degrees(truth["flight_path_angle"]))
    assert columns["speed_m_s"] == pytest.approx(np.linalg.norm(truth["velocity"], axis=1))
    assert columns["navigation_position_x_m"][:-1].tolist() == columns["position_x_m"][:-1].tolist()
    for name, values in zip(("longitude_deg", "latitude_deg", "height_m"), places(), strict=True):
        assert columns[name] == pytest.approx(values, abs=1e-3 if name == "height_m" else 1e-8)
    # the horizon is that of a programme: normal to the ellipsoid
    earth = load_mission("ares_v").environment.earth
    up = truth["position"] * [1.0, 1.0, (earth.equatorial_radius_m / earth.polar_radius_m) ** 2]
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    parts = [np.sum(truth["thrust_direction"] * axis, axis=1) for axis in (up, east)]
    pitch, azimuth = np.radians([columns["pitch_deg"], columns["azimuth_deg"]])
    burns = np.flatnonzero(truth["thrust"] > 0.0)[1:]
    assert len(burns) > 600
    assert np.sin(pitch[burns]) == pytest.approx(parts[0][burns], abs=1e-12)
    flat = np.cos(pitch[burns]) * np.sin(azimuth[burns])
    assert flat == pytest.approx(parts[1][burns], abs=1e-12)
    # the vehicle turns at once: the command to a state is where the thrust points in the next
    nxt = [columns[f"thrust_direction_{axis}"][2:-1] for axis in "xyz"]
    told = [columns[f"command_direction_{axis}"][1:-2] for axis in "xyz"]
    assert np.sum(np.array(nxt) * np.array(told), axis=0).min() > math.cos(math.radians(0.2))
    assert table["guidance_cycle"].null_count == 0
    assert table["time_to_go_s"][0].as_py() == pytest.approx(609.2, abs=0.1)
    # the last state is the end: navigation has none, no command answers it
    for name in ("navigation_position_x_m", "command_direction_x"):
        assert table[name].null_count == 1
        assert table[name][-1].as_py() is None
    assert set(table["phase"].to_pylist()) == {
        "core",
        "upper stage",
        "upper stage, after payload fairing",
    }


def test_every_quantity_has_its_unit(exported):
    table = pq.read_table(exported("parquet"))
    for field in table.schema:
        unit = (field.metadata or {}).get(b"unit", b"").decode()
        assert unit == unit_of(field.name)
        assert bool(unit) != (field.name in PLAIN), field.name
    assert table.schema.field("altitude_m").metadata == {b"unit": b"m"}
    assert table.schema.field("speed_m_s").metadata == {b"unit": b"m/s"}
    assert table.schema.field("command_direction_rate_x_per_s").metadata == {b"unit": b"1/s"}
    about = table.schema.metadata
    assert (about[b"mission"], about[b"guidance"]) == (b"ares_v", b"peg")
    assert about[b"verdict"] == b"Flown to the target"


def test_csv_holds_the_same_as_parquet(exported):
    table = pq.read_table(exported("parquet"))
    with exported("csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == table.column_names
    for name in table.column_names:
        for text, value in zip((row[name] for row in rows), table[name].to_pylist(), strict=True):
            if value is None:
                assert text == ""
            elif isinstance(value, float):
                assert float(text) == value
            else:
                assert text == str(value).lower() if isinstance(value, bool) else str(value)


def test_the_table_of_events(exported):
    table = pq.read_table(exported("parquet", "--table", "events"))
    assert table["event"].to_pylist() == EVENTS
    assert table["time_s"].to_pylist()[-1] == pytest.approx(END)
    assert table["mass_kg"].to_pylist()[-1] == pytest.approx(174_117.62, abs=0.01)
    assert table["height_m"][-1].as_py() == pytest.approx(places()[2][-1], abs=1e-3)


# ---- globes


def test_what_comes_down_is_on_globes(exported):
    falls = read_flight(REFERENCE).summary.falls
    assert [fall.name for fall in falls] == ["core", "payload fairing"]
    document = KML.parse(exported("kml")).features[0]
    (folder,) = [each for each in document.features if each.name == "where stages come down"]
    packets = {packet["id"]: packet for packet in json.loads(exported("czml").read_text())}
    for number, (fall, mark) in enumerate(zip(falls, folder.features, strict=True)):
        assert (mark.name, fall.words in mark.description) == (fall.title, True)
        point, way = mark.kml_geometry.geometry.geoms
        packet = packets[f"fall/{number}"]
        expected = (fall.impact.longitude_deg, fall.impact.latitude_deg)
        for place in (point.coords[0], way.coords[-1], packet["position"]["cartographicDegrees"]):
            assert place[:2] == pytest.approx(expected, abs=1e-5)
        assert way.coords[-1][2] == pytest.approx(0.0, abs=0.5)
        assert len(packet["polyline"]["positions"]["cartographicDegrees"]) == 3 * len(way.coords)


def seconds(text):
    return (datetime.fromisoformat(text) - NO_EPOCH).total_seconds()


def test_kml_is_valid_and_holds_the_flight(exported):
    out = exported("kml")
    # the schema of OGC, which has no extensions: those are looked at apart
    root = etree.parse(out).getroot()
    gx = "{http://www.google.com/kml/ext/2.2}"
    (track,) = root.iter(f"{gx}Track")
    when = [seconds(each.text) for each in track if each.tag.endswith("}when")]
    coords = [[float(x) for x in each.text.split()] for each in track.iter(f"{gx}coord")]
    longitude, latitude, height = places()
    assert when == pytest.approx(read_flight(REFERENCE).columns["vehicle_state"]["time"], abs=1e-3)
    assert np.array(coords) == pytest.approx(np.array([longitude, latitude, height]).T, abs=2e-3)
    placemark = track.getparent()
    placemark.getparent().remove(placemark)
    plain = out.with_name("plain.kml")
    etree.ElementTree(root).write(plain)
    assert validate(file_to_validate=plain)

    document = KML.parse(plain).features[0]
    folders = {
        folder.name: list(find_all(folder, of_type=Placemark)) for folder in document.features
    }
    phases = ["core", "upper stage", "upper stage, after payload fairing"]
    assert [each.name for each in folders["flight"]] == phases
    assert [each.name for each in folders["ground track"]] == phases
    assert [each.name for each in folders["events"]] == EVENTS
    lines = [each.geometry.coords for each in folders["flight"]]
    # the stretches hang together
    assert [line[-1] for line in lines[:-1]] == [line[0] for line in lines[1:]]
    assert lines[-1][-1] == pytest.approx((longitude[-1], latitude[-1], height[-1]), abs=2e-3)
    begins = [each.times.begin.dt for each in folders["events"]]
    assert [(begin - NO_EPOCH).total_seconds() for begin in begins][-1] == pytest.approx(
        END, abs=1e-3
    )
    assert len({str(each.style_url.url) for each in folders["flight"]}) == 3


def test_the_dates_are_those_of_the_epoch(ares, own_flight):
    """Check that mission time 0 is the epoch, in UTC: the flight begins 1,000 s later."""
    begin = "2032-01-01T04:16:40.000Z"
    for form in ("kml", "czml"):
        assert ares("export", str(own_flight), "--format", form).returncode == 0
    track = etree.parse(own_flight / "flight.kml").iter("{*}when", "{*}begin")
    assert min(each.text for each in track) == begin
    text = (own_flight / "flight.kml").read_text(encoding="utf-8")
    said = "Mission elapsed time 0 is 2032-01-01T04:00:00.000Z.<"
    assert said in text
    packets = json.loads((own_flight / "flight.czml").read_text(encoding="utf-8"))
    assert packets[0]["clock"]["currentTime"] == begin
    assert packets[0]["description"].endswith("0 is 2032-01-01T04:00:00.000Z.")
    assert packets[1]["position"]["epoch"] == "2032-01-01T04:00:00.000Z"
    assert "2000-01-01" not in text + json.dumps(packets)


def test_czml_holds_the_flight(exported):
    packets = json.loads(exported("czml").read_text())
    head, vehicle, *others = packets
    assert head["id"] == "document"
    assert head["version"] == "1.0"
    assert len({packet["id"] for packet in packets}) == len(packets)
    begin, end = head["clock"]["interval"].split("/")
    assert seconds(begin) == pytest.approx(BEGIN)
    assert seconds(end) == pytest.approx(END, abs=1e-3)
    position = vehicle["position"]
    assert seconds(position["epoch"]) == 0.0
    samples = np.array(position["cartographicDegrees"]).reshape(-1, 4)
    expected = np.array([read_flight(REFERENCE).columns["vehicle_state"]["time"], *places()]).T
    assert samples == pytest.approx(expected, abs=2e-3)
    assert np.all(np.diff(samples[:, 0]) > 0.0)
    assert [p["name"] for p in others if p["id"].startswith("event/")] == EVENTS
    assert len([p for p in others if p["id"].startswith("phase/")]) == 3
    for packet in packets[1:]:
        first, last = map(seconds, packet["availability"].split("/"))
        assert BEGIN - 1e-3 <= first <= last == pytest.approx(END, abs=1e-3)


# ---- what goes wrong


def test_the_file_is_in_the_bag_unless_another_is_named(tmp_path, capfd):
    bag = tmp_path / "flight"
    # what a person has exported of the reference flight stays there
    shutil.copytree(REFERENCE, bag, ignore=shutil.ignore_patterns("flight.*", "events.*"))
    present = {path.name for path in bag.iterdir()}
    for words in (["csv"], ["parquet", "--table", "events"], ["kml"], ["czml"]):
        assert run(capfd, bag, "--format", *words)[0] == 0
    names = {path.name for path in bag.iterdir()} - present
    assert names == {"flight.csv", "events.parquet", "flight.kml", "flight.czml"}


@pytest.mark.trial
def test_a_damaged_bag_is_written_and_said(tmp_path, capfd):
    bag = tmp_path / "damaged"
    shutil.copytree(REFERENCE, bag)
    file = bag / "reference_0.mcap"
    file.write_bytes(file.read_bytes()[: int(0.4 * file.stat().st_size)])
    for form in ("parquet", "kml", "czml"):
        status, out, err = run(capfd, bag, "--format", form)
        assert status == 1
        assert out == f"{bag / f'flight.{form}'}\n"
        assert err.startswith("ares: ")
        assert err.count("\n") == 1
        assert "has no end" in err
    rows = pq.read_table(bag / "flight.parquet")
    whole = read_flight(REFERENCE).columns["vehicle_state"]["time"]
    assert 0 < rows.num_rows < len(whole)
    assert rows["time_s"].to_pylist() == whole[: rows.num_rows].tolist()
    # no end of the flight: events as far as they came
    assert run(capfd, bag, "--format", "csv", "--table", "events")[0] == 1


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["{tmp}/none", "--format", "csv"], "none"),
        ([str(REFERENCE)], "--format"),
        ([str(REFERENCE), "--format", "xlsx"], "xlsx"),
        ([str(REFERENCE), "--format", "csv", "--table", "wings"], "wings"),
        ([str(REFERENCE), "--format", "kml", "--table", "events"], "csv and parquet only"),
        ([str(REFERENCE), "--format", "csv", "--out", "{tmp}/no/where.csv"], "No such file"),
        ([str(REFERENCE), "--format", "csv", "--out", "{tmp}"], "cannot be written"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, capfd, words, expected):
    status, out, err = run(capfd, *(word.replace("{tmp}", str(tmp_path)) for word in words))
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert expected in err
    assert not list(tmp_path.rglob("*"))


@pytest.mark.trial
def test_what_the_air_does_is_exported(from_the_pad, tmp_path, capfd):
    def table(*more):
        out = tmp_path / "table.parquet"
        words = ("--format", "parquet", "--out", out, *more)
        assert run(capfd, from_the_pad / "bag", *words) == (0, f"{out}\n", "")
        return pq.read_table(out)

    states = table()
    pressure = np.array(states["dynamic_pressure_pa"])
    greatest = int(np.argmax(pressure))
    assert 5e4 < pressure[greatest] < 7e4
    attack = math.radians(states["angle_of_attack_deg"][greatest].as_py())
    bending = states["q_alpha_pa_rad"][greatest].as_py()
    assert bending == pytest.approx(pressure[greatest] * math.sin(attack))
    assert states.schema.field("q_alpha_pa_rad").metadata == {b"unit": b"Pa rad"}
    assert states["lateral_acceleration_m_s2"][greatest].as_py() > 0.0
    events = table("--table", "events")
    names = events["event"].to_pylist()
    row = next(k for k, name in enumerate(names) if name.startswith("greatest dynamic pressure"))
    for column in ("time_s", "mass_kg", "position_x_m", "speed_m_s", "latitude_deg"):
        found = events[column][row].as_py()
        assert found == pytest.approx(states[column][greatest].as_py(), rel=1e-12), column
    times = events["time_s"].to_pylist()
    assert times == sorted(times)
    assert "hand-over: closed-loop guidance begins" in names

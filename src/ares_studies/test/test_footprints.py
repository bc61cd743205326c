# SPDX-License-Identifier: Apache-2.0
"""Footprints: mean places and ellipses of what comes down in a campaign."""

import math
from xml.etree import ElementTree

import numpy as np
import pyarrow as pa
import pytest

from ares_models.mission import load_mission
from ares_studies.export.kml import footprints_kml
from ares_studies.montecarlo.campaign import CampaignPlan, fly_campaign
from ares_studies.montecarlo.engines import fly_here
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_studies.montecarlo.footprint_page import footprint_items
from ares_studies.montecarlo.footprints import REACH, SHARE, Footprints
from ares_studies.montecarlo.report import make_report
from ares_studies.montecarlo.statistics import summarize
from ares_studies.montecarlo.store import SETTINGS, Store, StoreError
from ares_studies.montecarlo.table import make_table
from ares_studies.montecarlo.ways import make_ways
from ares_vehicle_sim.dispersions import Dispersions, DispersionsError, load_dispersions

PIECES = ("first stage", "fairing")


@pytest.fixture(scope="module")
def falcon():
    return load_mission("falcon9_leo_pad")


@pytest.fixture(scope="module")
def windy(falcon):
    return Settings(falcon, load_dispersions("standard_pad"), seed=4).planned()


@pytest.fixture(scope="module")
def hundred(windy):
    flyer = FlightRange(windy)
    names = windy.mission.jettison_names
    return make_table(flyer.fly(0, 100), flyer.columns, names, flyer.pieces)


def table_of(latitude, longitude):
    """Return the columns of a stage that comes down at some places."""
    names = ("fall_first_stage_latitude_deg", "fall_first_stage_longitude_deg")
    return pa.table(dict(zip(names, (pa.array(latitude), pa.array(longitude)), strict=True)))


def found(mission, *tables):
    footprints = Footprints(mission)
    for table in tables:
        footprints.add(table)
    return footprints.found()


@pytest.mark.parametrize("place", [(28.0, -72.0), (-60.0, 179.98), (89.9, 10.0)])
def test_an_ellipse_is_that_of_the_distribution(falcon, place):
    from scipy.stats import chi2

    rng = np.random.default_rng(1)
    # 20 by 5 km along 30 deg, laid out on the ellipsoid by its radii of curvature
    along, across = 20e3 * rng.standard_normal(20_000), 5e3 * rng.standard_normal(20_000)
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    east, north = along * s + across * c, along * c - across * s
    sine = math.sin(math.radians(place[0]))
    flat = 1.0 - (6356752.3 / 6378137.0) ** 2
    wide = 6378137.0 / math.sqrt(1.0 - flat * sine**2)
    high = wide * (1.0 - flat) / (1.0 - flat * sine**2)
    if place[0] > 89.0:
        # near the pole the plane itself is the measure
        x, y = east / wide, north / high
        up = math.radians(place[0])
        u = np.stack((x, math.sin(up) * -y + math.cos(up), math.cos(up) * y + math.sin(up)))
        u /= np.linalg.norm(u, axis=0)
        latitude = np.degrees(np.arcsin(u[2]))
        longitude = np.degrees(np.arctan2(u[0], u[1])) + place[1]
    else:
        latitude = place[0] + np.degrees(north / high)
        longitude = place[1] + np.degrees(east / wide / np.cos(np.radians(latitude)))
    longitude = (longitude + 180.0) % 360.0 - 180.0
    table = table_of(latitude, longitude)
    (footprint,) = found(falcon, table)
    assert footprint.flights == 20_000
    if place[0] < 89.0:
        assert footprint.latitude_deg == pytest.approx(place[0], abs=0.01)
        turned = math.radians(footprint.longitude_deg - place[1])
        assert math.sin(turned) == pytest.approx(0.0, abs=3e-4)
        assert footprint.azimuth_deg == pytest.approx(30.0, abs=1.0)
    assert pytest.approx(math.sqrt(chi2(2).ppf(SHARE)), rel=1e-12) == REACH
    assert footprint.major_km == pytest.approx(20.0 * REACH, rel=0.02)
    assert footprint.minor_km == pytest.approx(5.0 * REACH, rel=0.02)
    # 99 % of the places are inside, by the same map
    x, y = footprint.beside(latitude, longitude).T
    a = math.radians(footprint.azimuth_deg)
    lengthwise, aside = x * math.sin(a) + y * math.cos(a), x * math.cos(a) - y * math.sin(a)
    inside = (lengthwise / footprint.major_km) ** 2 + (aside / footprint.minor_km) ** 2 < 1.0
    assert np.mean(inside) == pytest.approx(SHARE, abs=0.003)


def test_chunks_add_up_and_what_does_not_come_down_counts_nothing(falcon):
    rng = np.random.default_rng(2)
    latitude, longitude = 28.0 + 0.1 * rng.standard_normal(50), -72.0 + rng.standard_normal(50)
    latitude[7] = longitude[7] = math.nan
    (whole,) = found(falcon, table_of(latitude, longitude))
    parts = [table_of(latitude[k : k + 10], longitude[k : k + 10]) for k in range(0, 50, 10)]
    (added,) = found(falcon, *parts)
    assert whole.flights == added.flights == 49
    assert added.major_km == pytest.approx(whole.major_km, rel=1e-9)
    assert added.azimuth_deg == pytest.approx(whole.azimuth_deg, abs=1e-6)
    assert found(falcon) == found(falcon, pa.table({"flight": [1]})) == ()
    (single,) = found(falcon, table_of([28.0], [-72.0]))
    assert math.isnan(single.major_km) and single.outline() == []
    assert single.words == "first stage: down at 28.00 N 72.00 W, mean of 1 flight"
    assert whole.words == (
        f"first stage: down at {whole.place}, mean of 49 flights; 99 % ellipse: semi-major axis "
        f"{whole.major_km:,.1f} km, semi-minor axis {whole.minor_km:,.1f} km, azimuth of the "
        f"major axis {whole.azimuth_deg:.0f} deg from north"
    )


def test_the_outline_lies_on_the_ellipse(falcon):
    rng = np.random.default_rng(3)
    table = table_of(28.0 + 0.1 * rng.standard_normal(50), -72.0 + 0.5 * rng.standard_normal(50))
    (footprint,) = found(falcon, table)
    outline = np.array(footprint.outline())
    assert outline[0] == pytest.approx(outline[-1])
    assert footprint.beside(*outline.T) == pytest.approx(footprint.ellipse(), abs=0.1)


def test_each_flight_keeps_where_its_pieces_come_down(hundred, falcon):
    for slug, name in (("first_stage", "first stage"), ("fairing", "fairing")):
        time = hundred[f"fall_{slug}_t_s"].to_numpy()
        assert np.all((time > 400.0) & (time < 1200.0)), name
        assert np.ptp(hundred[f"fall_{slug}_latitude_deg"].to_numpy()) > 0.01
    stage, fairing = found(falcon, hundred)
    assert (stage.name, fairing.name) == PIECES
    assert 25.0 < stage.latitude_deg < 29.0 and -75.0 < stage.longitude_deg < -68.0
    assert fairing.longitude_deg > stage.longitude_deg
    assert 5.0 < stage.minor_km < stage.major_km < 500.0


def test_what_falls_has_no_influence_on_the_flight(windy, hundred):
    exact = windy.dispersions.model_copy(update={"ballistic_coefficient": Dispersions().thrust})
    settings = Settings(windy.mission, exact, windy.seed, plan=windy.plan)
    flyer = FlightRange(settings)
    other = make_table(flyer.fly(0, 100), flyer.columns, windy.mission.jettison_names, flyer.pieces)
    fallen = [name for name in other.column_names if name.startswith("fall_")]
    drawn = [name for name in hundred.column_names if "ballistic" in name]
    assert len(fallen) == 6 and len(drawn) == 2
    same = [name for name in hundred.column_names if name not in (*fallen, *drawn)]
    assert other.select(same).equals(hundred.select(same))
    # the wind moves what is light and slow, and a coefficient that is drawn moves it further
    assert not other["fall_fairing_t_s"].equals(hundred["fall_fairing_t_s"])


def test_a_list_of_the_wrong_length_is_refused_in_one_line(falcon):
    given = Dispersions(ballistic_coefficient=[0.1, 0.2, 0.3])
    with pytest.raises(DispersionsError) as error:
        FlightRange(Settings(falcon, given))
    assert "ballistic_coefficient is a list of 3; expected 2: first_stage, fairing" in str(
        error.value
    )


def test_a_campaign_tells_and_draws_its_footprints(windy, tmp_path):
    with Store(tmp_path / "some", windy) as store:
        fly_campaign(CampaignPlan(windy, 40), store, fly_here, lambda _: None)
    summary = summarize(store.flights, 0.0, Footprints(windy.mission))
    stage, fairing = summary.footprints
    assert (stage.flights, fairing.flights) == (40, 40)
    table, *figures = footprint_items(summary)
    assert [row.label for row in table.content.rows] == list(PIECES)
    assert table.content.rows[0].cells[1].text == stage.place.replace(" ", "\u00a0")
    assert [len(item.content.series[0].x) for item in figures] == [40, 40]
    assert figures[0].content.series[-1].name == "99 %"
    assert not any("ballistic" in draw for draw in summary.influences["m_f_kg"])
    globe = make_ways(windy, [], {}, summary.footprints)
    assert [len(area) for area in globe.areas] == [146, 146]
    assert globe.areas[1][:2] == pytest.approx(fairing.outline()[0][::-1], abs=1e-3)
    report = make_report(windy, summary, {}, "", {}, globe)
    assert report.globe_key[-1] == ("where pieces come down, 99 % ellipse", "otis", 2, "line")
    document = ElementTree.fromstring(footprints_kml("title", summary.footprints))
    marks = list(document.iter("{http://www.opengis.net/kml/2.2}Placemark"))
    for footprint, mark in zip(summary.footprints, marks, strict=True):
        name, words, geometry = mark
        point, ring = geometry.iter("{http://www.opengis.net/kml/2.2}coordinates")
        assert (name.text, words.text) == (footprint.name, footprint.words)
        assert [float(x) for x in point.text.split(",")[:2]] == pytest.approx(
            [footprint.longitude_deg, footprint.latitude_deg], abs=1e-5
        )
        assert len(ring.text.split()) == 73
    assert summarize(store.flights, 0.0).footprints == ()


def test_a_folder_of_another_format_is_refused_in_one_line(windy, tmp_path):
    with Store(tmp_path / "old", windy):
        pass
    file = tmp_path / "old" / SETTINGS
    file.write_text(file.read_text().replace('"format": 2', '"format": 1'))
    with pytest.raises(StoreError, match="holds another campaign: format was 1, now 2"):
        Store(tmp_path / "old", windy)


def test_two_pieces_of_one_name_have_columns_of_their_own(falcon):
    text = falcon.model_dump(mode="json", exclude_unset=True)
    text["jettisons"][0]["name"] = "first stage"
    mission = type(falcon).model_validate(text)
    flyer = FlightRange(Settings(mission, Dispersions(ballistic_coefficient=0.1)))
    assert flyer.pieces == ("first_stage", "first_stage_2")
    table = make_table(flyer.fly(0, 1), flyer.columns, mission.jettison_names, flyer.pieces)
    assert len(set(table.column_names)) == len(table.column_names)

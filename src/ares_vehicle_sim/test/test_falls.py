# SPDX-License-Identifier: Apache-2.0
"""Falls of what a flight drops: which pieces, with which drag, from which separations."""

import math

import numpy as np
import pytest

from ares_models.impacts import find_impact
from ares_models.mission import MissionError, load_mission, parse_mission, read_mission
from ares_vehicle_sim.arrays import ARC_ENDED, EVENT, JETTISON_DONE, STAGING
from ares_vehicle_sim.falls import find_falls

AREA = 4.0 * math.pi


def separated(*rows):
    """Return events of a type, index and time, with mass, height and speed, over the Cape."""
    events = np.zeros(len(rows), EVENT)
    for event, (kind, index, time, mass, height, speed) in zip(events, rows, strict=True):
        event["type"], event["index"], event["time"], event["mass"] = kind, index, time, mass
        angle = math.radians(28.5)
        event["position"] = (6378145.0 + height) * np.array([math.cos(angle), 0, math.sin(angle)])
        event["velocity"] = [0.3 * speed, speed + 408.0, 0.0]
    return events


STAGED = separated(
    (JETTISON_DONE, 0, 75.0, 90e3, 20e3, 1000.0),
    (ARC_ENDED, 2, 261.0, 32e3, 100e3, 4000.0),
    (STAGING, 1, 261.0, 23e3, 100e3, 4000.0),
)


def of(name, *changes):
    """Return a shipped mission with some changes of its text."""
    text = read_mission(name)[1]
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return parse_mission(text, f"{name}.yaml")


def test_a_piece_tumbles_on_the_reference_area():
    mission = load_mission("delta_iii_pad")
    solids, stage = find_falls(mission, STAGED)
    assert (solids.name, solids.count, solids.mass_kg) == ("six solids", 6, 13680.0)
    assert solids.coefficient_kg_m2 == pytest.approx(2280.0 / AREA)
    assert (stage.name, stage.count, stage.mass_kg) == ("first stage", 1, 9e3)
    assert stage.coefficient_kg_m2 == pytest.approx(9e3 / AREA)
    assert solids.impact is not None and stage.impact is not None
    assert 75.0 < solids.impact.time_s < stage.impact.time_s
    assert 0.0 < solids.downrange_m < stage.downrange_m
    # falling steadily: drag is weight
    assert solids.speed_m_s == pytest.approx(math.sqrt(2 * 9.8 * 181.4 / 1.225), rel=0.02)
    assert stage.words.startswith(f"comes down at {stage.impact.place}, ")
    assert solids.title == "six solids, 6 pieces" and stage.title == "first stage"


def test_the_way_goes_from_the_separation_to_the_ground():
    mission = load_mission("delta_iii_pad")
    _, stage = find_falls(mission, STAGED)
    assert stage.impact is not None
    assert stage.track_time_s[0] == 261.0 and stage.track_time_s[-1] == stage.impact.time_s
    assert stage.track[0] == pytest.approx(STAGED["position"][2])
    heights = np.linalg.norm(stage.track, axis=1) - 6378145.0
    assert heights.max() > 100e3
    assert abs(heights[-1]) < 5.0


def test_coefficients_of_the_file_are_taken():
    own = "ballistic_coefficient_kg_m2"
    mission = of(
        "delta_iii_pad",
        ("    dry_mass_kg: 8830.0\n", f"    dry_mass_kg: 8830.0\n    {own}: 1500.0\n"),
        ("        count: 6\n", f"        count: 6\n        {own}: 300.0\n"),
    )
    solids, stage = find_falls(mission, STAGED)
    assert (solids.coefficient_kg_m2, stage.coefficient_kg_m2) == (300.0, 1500.0)


def test_without_aerodynamics_there_is_no_drag():
    mission = load_mission("ares_v")
    r, v = mission.start().position, mission.start().velocity
    events = separated((ARC_ENDED, 0, 155.9, 5e5, 0, 0), (STAGING, 1, 155.9, 4e5, 0, 0))
    events["position"], events["velocity"] = r, v
    (core,) = find_falls(mission, events)
    expected = find_impact(r.tolist(), v.tolist(), 155.9, mission.environment_array()[0])
    assert expected is not None and core.impact is not None
    assert math.isinf(core.coefficient_kg_m2) and ", without drag" in core.words
    assert core.impact.time_s == pytest.approx(expected.time_s, abs=0.05)
    assert core.impact.latitude_deg == pytest.approx(expected.latitude_deg, abs=1e-4)


def test_an_area_in_which_it_falls_is_named():
    away = """
abort:
  safe_perigee_altitude_m: 150000.0
  avoid:
    - {name: the sea, latitude_deg: 28.5, longitude_deg: -80.2, radius_m: 100000.0}

target:"""
    mission = of("delta_iii_pad", ("\ntarget:", away))
    solids, stage = find_falls(mission, STAGED)
    assert solids.words.endswith(", in the sea")
    assert "in the sea" not in stage.words


def test_what_is_in_orbit_stays_there():
    events = STAGED.copy()
    events["position"][:, :] *= 1.05
    events["velocity"] = [0.0, 7700.0, 0.0]
    falls = find_falls(load_mission("delta_iii_pad"), events)
    assert [fall.impact for fall in falls] == [None, None]
    assert falls[0].words == "do not come down within a revolution"


def test_what_is_not_among_the_events_is_not_told():
    mission = load_mission("delta_iii_pad")
    assert find_falls(mission, STAGED[:0]) == ()
    # the mass before the staging is not known
    assert [fall.name for fall in find_falls(mission, STAGED[[0, 2]])] == ["six solids"]
    strange = STAGED.copy()
    strange["index"] = 4_000_000
    assert find_falls(mission, strange) == ()


@pytest.mark.parametrize("value", ["0.5", "2e6", "-3", "nan", "heavy"])
def test_a_coefficient_out_of_range_is_refused_in_one_line(value):
    with pytest.raises(MissionError) as error:
        of(
            "delta_iii_pad",
            (
                "    dry_mass_kg: 8830.0\n",
                f"    dry_mass_kg: 8830.0\n    ballistic_coefficient_kg_m2: {value}\n",
            ),
        )
    text = str(error.value)
    assert "\n" not in text
    assert "stages[0].ballistic_coefficient_kg_m2 is" in text
    assert "expected a number" in text

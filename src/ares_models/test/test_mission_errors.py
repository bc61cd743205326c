# SPDX-License-Identifier: Apache-2.0
"""Broken mission files: one line each, with file, line, key, value and expected value."""

import errno
import os
import re
from importlib import resources
from pathlib import Path

import pytest

from ares_models.mission import MISSION, TEMPLATE, MissionError, load_mission, parse_mission
from ares_models.mission_programme import flown_whole

TEXT = resources.files("ares_models").joinpath("missions", "ares_v.yaml").read_text()
SATURN = resources.files("ares_models").joinpath("missions", "saturn_v_as506.yaml").read_text()


def message(path):
    with pytest.raises(MissionError) as caught:
        load_mission(path)
    text = str(caught.value)
    assert "\n" not in text
    assert "Traceback" not in text
    assert "pydantic" not in text
    return text


def edited(tmp_path, old, new, text=TEXT):
    assert text.count(old) >= 1, f"{old!r} is not in the mission file"
    path = tmp_path / "broken.yaml"
    path.write_text(text.replace(old, new, 1))
    return path


# (text in ares_v.yaml, its replacement, key path, rest of the message)
BROKEN = {
    "area of neither form": (
        (
            "    - name: Bermuda\n      latitude_deg: 32.3\n      longitude_deg: -64.8\n"
            "      radius_m: 60000.0\n"
        ),
        "    - name: Bermuda\n",
        "abort.avoid[2].latitude_deg",
        "expected the centre and radius of a circle, or a list of vertices_deg",
    ),
    "circle without a radius": (
        "      radius_m: 60000.0\n",
        "",
        "abort.avoid[2].radius_m",
        "is missing; expected a number, for a circle",
    ),
    "area of both forms": (
        "      radius_m: 60000.0\n",
        "      radius_m: 60000.0\n      vertices_deg: [[0, 0], [0, 1], [1, 0]]\n",
        "abort.avoid[2].latitude_deg",
        "is 32.3; expected no such key beside vertices_deg",
    ),
    "radius in km": (
        "radius_m: 60000.0",
        "radius_m: 60.0",
        "abort.avoid[2].radius_m",
        "is 60.0; expected a number from 1000 to 1e7 in m",
    ),
    "circle around the globe": (
        "radius_m: 60000.0",
        "radius_m: 9.5e6",
        "abort.avoid[2].radius_m",
        "expected at most 8,905,563 m on this body",
    ),
    "latitude and longitude exchanged": (
        "latitude_deg: 32.3",
        "latitude_deg: -124.8",
        "abort.avoid[2].latitude_deg",
        "expected a number from -90 to 90 in deg",
    ),
    "two areas of a name": (
        "name: Bermuda",
        "name: Bahamas",
        "abort.avoid[2].name",
        "is 'Bahamas'; expected a name other than that of abort.avoid[1]",
    ),
    "two corners": (
        (
            "[[27.5, -79.1], [27.0, -76.8], [24.0, -74.0], [20.8, -72.5], [20.8, -74.0], "
            "[22.0, -76.5], [24.0, -79.0], [26.4, -79.4]]"
        ),
        "[[27.5, -79.1], [27.0, -76.8]]",
        "abort.avoid[1].vertices_deg",
        "expected a list of at least 3",
    ),
    "polygon that is closed": (
        "[26.4, -79.4]]",
        "[27.5, -79.1]]",
        "abort.avoid[1].vertices_deg[0]",
        "expected a corner at least 0.01 deg from the one before it; the polygon closes by itself",
    ),
    "polygon that crosses itself": (
        "[27.5, -79.1], [27.0, -76.8]",
        "[27.5, -76.8], [27.0, -79.1]",
        "abort.avoid[1].vertices_deg[7]",
        "expected a corner whose edge does not cross that of corner",
    ),
    "polygon around the globe": (
        (
            "[[27.5, -79.1], [27.0, -76.8], [24.0, -74.0], [20.8, -72.5], [20.8, -74.0], "
            "[22.0, -76.5], [24.0, -79.0], [26.4, -79.4]]"
        ),
        "[[0, 0], [0, 120], [0, 240]]",
        "abort.avoid[1].vertices_deg",
        "expected corners within 80 deg of their middle",
    ),
    "areas where no place is known": (
        "    zero_longitude_deg",
        "    # zero_longitude_deg",
        "environment.earth.zero_longitude_deg",
        "is missing; expected a number, because abort.avoid names places",
    ),
    "unknown key": (
        "thrust_n: 17437041.0",
        "trust_n: 17437041.0",
        "stages[0].trust_n",
        "is not a known key (its value is 17437041.0); did you mean thrust_n?",
    ),
    "unknown key at the top": (
        "title:",
        "titel:",
        "titel",
        "did you mean title?; also title is missing; expected a value",
    ),
    "altitude for a radius": (
        "radius_m: 6518889.0",
        "altitude_km: 140",
        "target.altitude_km",
        "(its value is 140); did you mean radius_m, which counts from the centre?",
    ),
    "another unit": (
        "thrust_n: 17437041.0",
        "thrust_kn: 17437.0",
        "stages[0].thrust_kn",
        "is not a known key (its value is 17437.0); did you mean thrust_n?",
    ),
    "unknown key in the environment": (
        "  j2: 0.0",
        "  j3: 0.0",
        "environment.j3",
        "did you mean j2?",
    ),
    "missing key": (
        "    isp_s: 414.7 ",
        "    # ",
        "stages[0].isp_s",
        "is missing; expected a number in s, or a list of arcs in its place",
    ),
    "missing number": (
        "  mu_m3_s2: 3.986e14",
        "  # ",
        "environment.mu_m3_s2",
        "is missing; expected a number in m3/s2",
    ),
    "negative mass": (
        "ignition_mass_kg: 1227734.0",
        "ignition_mass_kg: -1227734.0",
        "stages[0].ignition_mass_kg",
        "is -1227734.0; expected a number from 0.001 to 1e9 in kg",
    ),
    "negative jettison": (
        "mass_kg: 5837.0",
        "mass_kg: -5837.0",
        "jettisons[0].mass_kg",
        "is -5837.0; expected a number from 0.001 to 1e9 in kg",
    ),
    "zero thrust": (
        "17437041.0",
        "0",
        "stages[0].thrust_n",
        "is 0; expected a number from 0.001 to 1e10 in N",
    ),
    "not a number": (
        "isp_s: 448.0",
        "isp_s: .nan",
        "stages[1].isp_s",
        "is nan; expected a finite number in s",
    ),
    "infinite": (
        "speed_m_s: 7840.675",
        "speed_m_s: .inf",
        "target.speed_m_s",
        "is inf; expected a finite number in m/s",
    ),
    "too large for a number": (
        "speed_m_s: 7840.675",
        "speed_m_s: 1e999",
        "target.speed_m_s",
        "is inf; expected a finite number in m/s",
    ),
    "nan in a vector": (
        "-2044694.0",
        ".nan",
        "initial_state.position_m[1]",
        "is nan; expected a finite number",
    ),
    "text for a number": (
        "radius_m: 6518889.0",
        "radius_m: far",
        "target.radius_m",
        "is 'far'; expected a number in m",
    ),
    "quoted number": (
        "radius_m: 6518889.0",
        'radius_m: "6518889.0"',
        "target.radius_m",
        "is '6518889.0'; expected a number in m",
    ),
    "truth for a number": (
        "radius_m: 6518889.0",
        "radius_m: true",
        "target.radius_m",
        "is true; expected a number in m",
    ),
    "empty value": (
        "radius_m: 6518889.0",
        "radius_m:",
        "target.radius_m",
        "is empty; expected a number in m",
    ),
    "empty value of a key that may be left out": (
        "  g0_m_s2: 9.80665",
        "  g0_m_s2:",
        "environment.g0_m_s2",
        "is empty; expected a number in m/s2",
    ),
    "empty block that may be left out": (
        "initial_state:",
        "aerodynamics:\ninitial_state:",
        "aerodynamics",
        "is empty; expected a mapping with keys such as reference_area_m2",
    ),
    "list for a mapping": (
        "  atmosphere:\n    model: pra63 ",
        "  atmosphere: [1, 2] ",
        "environment.atmosphere",
        "is a list of 2; expected a mapping",
    ),
    "short vector": (
        ", 3058330.0]",
        "]",
        "initial_state.position_m[2]",
        "is missing; expected a number",
    ),
    "long vector": (
        ", 3058330.0]",
        ", 3058330.0, 1.0]",
        "initial_state.position_m",
        "is a list of 4; expected a list of at most 3",
    ),
    "too large for the schema": (
        "3058330.0]",
        "1e300]",
        "initial_state.position_m[2]",
        "is 1e+300; expected a number from -1e9 to 1e9",
    ),
    "polar radius of a disc": (
        "6356750.0",
        "3e6",
        "environment.earth.polar_radius_m",
        "is 3000000.0; expected at least 3,189,070 m",
    ),
    "gravity of no body": (
        "mu_m3_s2: 3.986e14",
        "mu_m3_s2: 3.986e16",
        "environment.mu_m3_s2",
        "expected a gravity on the equator of 0.05 to 50 m/s2; it is 980 m/s2",
    ),
    "rotation that tears": (
        "7.2921159e-5",
        "7.29e-3",
        "environment.earth.rotation_rate_rad_s",
        "is 0.00729; expected less than 0.00124 rad/s, at which the equator would be in orbit",
    ),
    "exhaust of no engine": (
        "isp_s: 448.0",
        "isp_s: 44800.0",
        "stages[1].isp_s",
        "expected an exhaust velocity g0 Isp of 100 to 100000 m/s; it is 4.39e+05 m/s",
    ),
    "thrust that crushes": (
        "thrust_n: 1306665.0",
        "thrust_n: 1306665e6",
        "stages[1].thrust_n",
        "expected a number from 0.001 to 1e10 in N",
    ),
    "thrust of no stage": (
        "thrust_n: 1306665.0",
        "thrust_n: 9e9",
        "stages[1].thrust_n",
        "is 9000000000.0; expected at most 3.07837e+09 N, 10,000 m/s2 at ignition",
    ),
    "thrust that takes for ever": (
        "thrust_n: 1306665.0",
        "thrust_n: 1000.0",
        "stages[1].thrust_n",
        "N, its 286,900 kg of propellant to burn within 864,000 s of flight",
    ),
    "start that outlasts the propellant": (
        "burn_time_s: free",
        "burn_time_s: free\n    start: [[0, 1], [3600, 1]]",
        "stages[1].start",
        "expected a start that is over before the 286,900 kg of propellant are gone",
    ),
    "knots that are nearly one": (
        "burn_time_s: free",
        "burn_time_s: free\n    start: [[0, 0], [1.0e-9, 1]]",
        "stages[1].start[1]",
        "expected the time of the knot before, or at least 0.001 s later",
    ),
    "jettison after the last drop": (
        "heating_limit_w_m2: 1135.0",
        "time_s: 3000.0",
        "jettisons[0].time_s",
        "is 3000.0; expected at most 1301.79 s, when all propellant is gone",
    ),
    "unknown atmosphere": (
        "model: pra63",
        "model: pra64",
        "environment.atmosphere.model",
        "is 'pra64'; expected one of 'pra63', 'pra63_exponential', 'pra63_data',",
    ),
    "indices without nrlmsis": (
        "model: pra63",
        "f107: 150\n    model: pra63",
        "environment.atmosphere.f107",
        "is 150.0; expected no such key, because model is pra63",
    ),
    "nrlmsis without indices": (
        "model: pra63",
        "model: nrlmsis",
        "environment.atmosphere.f107",
        (
            "is missing; expected a number for it, and for f107a, ap, latitude_deg, longitude_deg, "
            "because model is nrlmsis"
        ),
    ),
    "nrlmsis without an epoch": (
        "model: pra63",
        "{model: nrlmsis, f107: 99, f107a: 99, ap: 1, latitude_deg: 0, longitude_deg: 0}",
        "epoch",
        "is missing; expected a date and time, because the atmosphere is nrlmsis",
    ),
    "bad epoch": (
        "name: ares_v",
        "name: ares_v\nepoch: tomorrow",
        "epoch",
        "is 'tomorrow'; expected a date and time such as 2010-06-21T12:00:00Z",
    ),
    "bad name": (
        "name: ares_v",
        "name: Ares V",
        "name",
        "is 'Ares V'; expected a name of small letters, digits and underscores",
    ),
    "polar radius above equatorial": (
        "6356750.0",
        "6456750.0",
        "environment.earth.polar_radius_m",
        "expected at most equatorial_radius_m, 6378140.0 m",
    ),
    "no initial state": (
        (
            "  position_m: [-5255758.0, -2044694.0, 3058330.0]   # Eq. 2.17\n"
            "  velocity_m_s: [413.927, -1839.599, 202.550] "
        ),
        " ",
        "initial_state",
        (
            "expected time_s and one of six forms, such as geodetic_latitude_deg, longitude_deg "
            "and altitude_m on the pad, or position_m and velocity_m_s"
        ),
    ),
    "position in km": (
        "[-5255758.0, -2044694.0, 3058330.0]",
        "[-5255.758, -2044.694, 3058.330]",
        "initial_state.position_m",
        (
            "expected a place above the surface, 6,373,260 m from the centre there, and below "
            "63,781,400 m; it is 6,415 m from the centre"
        ),
    ),
    "position out of the Earth's reach": (
        "3058330.0]",
        "1e8]",
        "initial_state.position_m",
        "and below 63,781,400 m",
    ),
    "speed in mm/s": (
        "-1839.599",
        "-1839599",
        "initial_state.velocity_m_s",
        "expected an inertial speed below twice the escape speed, 22,295 m/s; it is",
    ),
    "no burn time": (
        "burn_time_s: free",
        "burn_time_s: forever",
        "stages[1].burn_time_s",
        "is 'forever'; expected a time in s, or the word free",
    ),
    "negative burn time": (
        "burn_time_s: 181.25",
        "burn_time_s: -1",
        "stages[0].burn_time_s",
        "is -1; expected a number from 0.001 to 864000 in s",
    ),
    "no free burn": (
        "burn_time_s: free",
        "burn_time_s: 400.0",
        "stages[1].burn_time_s",
        "is 400.0; expected free, for at least one burn",
    ),
    "free burn of a stage without propellant": (
        "burn_time_s: 181.25",
        "burn_time_s: free",
        "stages[0].propellant_kg",
        "expected a number, because burn core is free",
    ),
    "bounds of a burn that is not free": (
        "burn_time_s: 181.25",
        "burn_time_s: 181.25\n    max_s: 200",
        "stages[0].max_s",
        "is 200.0; expected no such key without burn_time_s: free",
    ),
    "bounds that cross": (
        "burn_time_s: free",
        "burn_time_s: free\n    min_s: 300\n    max_s: 200",
        "stages[1].min_s",
        "is 300.0; expected at most max_s, 200.0 s",
    ),
    "free burn in held attitude": (
        "burn_time_s: free",
        "burn_time_s: free\n    attitude: held",
        "stages[1].attitude",
        "is 'held'; expected guided, for a burn with burn_time_s: free",
    ),
    "throttle without a limit": (
        "burn_time_s: free",
        "burn_time_s: free\n    min_throttle: 0.6",
        "stages[1].min_throttle",
        "is 0.6; expected no such key without max_acceleration_m_s2",
    ),
    "throttled engine with a start": (
        "burn_time_s: free",
        "burn_time_s: free\n    max_acceleration_m_s2: 30\n    start: [[0, 0], [2, 1]]",
        "stages[1].start",
        "expected no such key beside max_acceleration_m_s2",
    ),
    "throttle bucket in a burn of fixed length": (
        "burn_time_s: 181.25",
        "burn_time_s: 181.25\n    throttle_bucket: 0.7",
        "stages[0].burn_time_s",
        "is 181.25; expected free, beside throttle_bucket: the optimizer plans the length",
    ),
    "throttle bucket without a limit": (
        "burn_time_s: 181.25",
        "propellant_kg: 700000\n    burn_time_s: free\n    throttle_bucket: 0.7",
        "stages[0].throttle_bucket",
        "is 0.7; expected max_dynamic_pressure_pa of the stage beside it",
    ),
    "throttle bucket in the last burn": (
        "burn_time_s: free",
        "burn_time_s: free\n    throttle_bucket: 0.7\n    max_dynamic_pressure_pa: 3e4",
        "stages[1].throttle_bucket",
        "is 0.7; expected no such key in the last burn of the flight",
    ),
    "throttle bucket with a least length": (
        "burn_time_s: free",
        "burn_time_s: free\n    throttle_bucket: 0.7\n    min_s: 10",
        "stages[1].min_s",
        "is 10.0; expected no such key beside throttle_bucket",
    ),
    "burn past the propellant": (
        "burn_time_s: 181.25",
        "propellant_kg: 700000\n    burn_time_s: 181.25",
        "stages[0].burn_time_s",
        (
            "is 181.25; expected burns that take at most 700,000 kg; the fixed burns of stage core "
            "take 777,134.328 kg"
        ),
    ),
    "burn past the next stage": (
        "burn_time_s: 181.25",
        "burn_time_s: 220",
        "stages[0].burn_time_s",
        "expected burns that take at most 919,897 kg",
    ),
    "propellant past the stage": (
        "    thrust_n: 1306665.0",
        "    propellant_kg: 305000\n    thrust_n: 1306665.0",
        "stages[1].propellant_kg",
        "is 305000.0; expected at most the 302,000 kg that the stage can lose",
    ),
    "upper stage heavier than the stack": (
        "307837.0",
        "1307837.0",
        "stages[1].ignition_mass_kg",
        "is 1307837.0; expected less than the 1,227,734 kg of stage core",
    ),
    "jettison heavier than its stage": (
        "mass_kg: 5837.0",
        "mass_kg: 583700.0",
        "stages[1].ignition_mass_kg",
        "expected more than the 583,700 kg of jettisons that it contains",
    ),
    "jettison of no stage": (
        "stage: upper stage",
        "stage: third stage",
        "jettisons[0].stage",
        "is 'third stage'; expected the name of a stage: core, upper stage",
    ),
    "jettison without a criterion": (
        "    heating_limit_w_m2: 1135.0",
        "    #",
        "jettisons[0].heating_limit_w_m2",
        "is missing; expected one of heating_limit_w_m2, time_s, time_after_ignition_s",
    ),
    "jettison with two criteria": (
        "heating_limit_w_m2: 1135.0",
        "heating_limit_w_m2: 1135.0\n    time_s: 400.0",
        "jettisons[0].time_s",
        "is 400.0; expected no such key beside heating_limit_w_m2",
    ),
    "heating limit that holds nowhere": (
        "heating_limit_w_m2: 1135.0",
        "heating_limit_w_m2: 1135.0\n    heating_limit_holds: never",
        "jettisons[0].heating_limit_holds",
        "is 'never'; expected one of 'at_jettison' or 'from_jettison'",
    ),
    "where no heating limit holds": (
        "heating_limit_w_m2: 1135.0",
        "time_s: 400.0\n    heating_limit_holds: at_jettison",
        "jettisons[0].heating_limit_holds",
        "is 'at_jettison'; expected no such key without heating_limit_w_m2",
    ),
    "higher heating limit that holds on": (
        "heating_limit_w_m2: 1135.0",
        """heating_limit_w_m2: 1135.0
    heating_limit_holds: from_jettison
  - {name: ring, mass_kg: 10.0, stage: core, heating_limit_w_m2: 1000.0}""",
        "jettisons[0].heating_limit_holds",
        "expected at_jettison, for all but the lowest limit, 1000 W/m2",
    ),
    "jettison before its stage burns": (
        "heating_limit_w_m2: 1135.0",
        "time_s: 300.0",
        "jettisons[0].time_s",
        "is 300.0; expected at least 337.15 s, when stage upper stage ignites",
    ),
    "jettison after the next stage has ignited": (
        "heating_limit_w_m2: 1135.0",
        """heating_limit_w_m2: 1135.0
  - {name: ring, mass_kg: 10.0, stage: core, time_after_ignition_s: 200.0}""",
        "jettisons[1].time_after_ignition_s",
        "is 200.0; expected at most 181.25 s, when stage upper stage ignites; for a later drop",
    ),
    "two stages of one name": (
        "- name: upper stage",
        "- name: core",
        "stages[1].name",
        "is 'core'; expected a name other than that of stages[0]",
    ),
    "no stages": ("stages:\n", "stages: []\nolder:\n", "stages", "expected a list of at least 1"),
    "start that does not begin at 0": (
        "burn_time_s: free",
        "burn_time_s: free\n    start: [[1, 0], [2, 1]]",
        "stages[1].start[0]",
        "expected a first knot at 0 s",
    ),
    "start that does not reach full thrust": (
        "burn_time_s: free",
        "burn_time_s: free\n    start: [[0, 0], [2, 0.9]]",
        "stages[1].start[1]",
        "expected a last thrust fraction of 1",
    ),
    "start that goes back in time": (
        "burn_time_s: free",
        "burn_time_s: free\n    start: [[0, 0], [2, 0.5], [1, 1]]",
        "stages[1].start[2]",
        "expected a time of 2.0 s or later, as the knot before",
    ),
    "start of too many knots": (
        "burn_time_s: free",
        "burn_time_s: free\n    start: [" + ", ".join(f"[{k}, 0]" for k in range(65)) + "]",
        "stages[1].start",
        "is a list of 65; expected a list of at most 64",
    ),
    "thrust fraction above 1": (
        "burn_time_s: free",
        "burn_time_s: free\n    start: [[0, 0], [2, 1.5]]",
        "stages[1].start[1][1]",
        "is 1.5; expected a number from 0 to 1",
    ),
    "tail-off without room": (
        "burn_time_s: 181.25",
        "burn_time_s: 181.25\n    tail_off: [[0, 1], [2, 0]]",
        "stages[0].tail_off",
        (
            "expected a tail-off of 2 s followed by a coast of at least that in the same stage, "
            "which has 0 s"
        ),
    ),
    "start longer than the burn": (
        "burn_time_s: 181.25",
        "burn_time_s: 1.5\n    start: [[0, 0], [2, 1]]",
        "stages[0].burn_time_s",
        "is 1.5; expected at least the 2.0 s that the start takes",
    ),
    "arcs beside the short form": (
        "burn_time_s: 181.25",
        "burn_time_s: 181.25\n    arcs: [{coast_s: 1}]",
        "stages[0].thrust_n",
        "expected no such key beside arcs",
    ),
    "target under the ground": (
        "radius_m: 6518889.0",
        "radius_m: 6318889.0",
        "target.radius_m",
        "is 6318889.0; expected more than the Earth's radius, 6,378,140 m",
    ),
    "target speed in km/s": (
        "speed_m_s: 7840.675",
        "speed_m_s: 7.840675",
        "target.speed_m_s",
        "is 7.840675; expected between 1,106 and 11,059 m/s (escape) at this radius",
    ),
    "target faster than escape": (
        "speed_m_s: 7840.675",
        "speed_m_s: 12000",
        "target.speed_m_s",
        "is 12000.0; expected between",
    ),
    "flight-path angle past the vertical": (
        "1.0064",
        "100.64",
        "target.flight_path_angle_deg",
        "is 100.64; expected a number from -90 to 90 in deg",
    ),
    "inclination past 180": (
        "inclination_deg: 28.5",
        "inclination_deg: 285",
        "target.inclination_deg",
        "is 285; expected a number from 0 to 180 in deg",
    ),
    "heating where there is no air": (
        "    model: pra63 ",
        "    model: none ",
        "jettisons[0].heating_limit_w_m2",
        (
            "is 1135.0; expected time_s or time_after_ignition_s in its place, because "
            "atmosphere.model is none"
        ),
    ),
    "no air, multiplied": (
        "    model: pra63 ",
        "    density_factor: 2.0\n    model: none ",
        "environment.atmosphere.density_factor",
        "is 2.0; expected no such key, because model is none",
    ),
    "target of no kind": (
        "target:                           # Table 2.1",
        "target: {}\nother:",
        "target",
        "expected an orbit by its elements, such as perigee_altitude_m, apogee_altitude_m and",
    ),
    "duplicate key": (
        "isp_s: 448.0",
        "isp_s: 448.0\n    isp_s: 449.0",
        "stages[1].isp_s",
        "is given twice (first in line",
    ),
    "alias": (
        "isp_s: 448.0",
        "isp_s: &x 448.0\n    propellant_kg: *x",
        "stages[1].propellant_kg",
        "is an alias (*name); expected the value itself",
    ),
    "tag": (
        "isp_s: 448.0",
        "isp_s: !!python/object:os.system 448.0",
        "stages[1].isp_s",
        "has the YAML tag tag:yaml.org,2002:python/object:os.system; expected a plain value",
    ),
    "list as a key": ("name: ares_v", "? [a, b]\n: 1", "the file", "a list or mapping as a key"),
}


_CORE = (
    "    thrust_n: 17437041.0          # Table 2.2\n"
    "    isp_s: 414.7                  # Table 2.2\n"
    "    engines: 5                    "
    "# derived: 3.49 MN each, an RS-68B; six would be far below one\n"
    "    burn_time_s: 181.25           # Table 2.2: from 155.9 s to the staging point at 337.15 s\n"
)
_TABLE = "    thrust_table: [[0, 0], [1, 1.5e7], [180, 0]]\n"
#: Replacement of the core's burn, key path, rest of the message.
TABLES = {
    "table without an impulse": (
        _TABLE,
        "stages[0].isp_s",
        "is missing; expected a number in s, or a mass_flow_table in its place",
    ),
    "two mass flows": (
        _TABLE + "    isp_s: 280\n    mass_flow_table: [[0, 0], [1, 5e3], [180, 0]]\n",
        "stages[0].isp_s",
        "is 280.0; expected no such key beside mass_flow_table",
    ),
    "flow that ends early": (
        _TABLE + "    mass_flow_table: [[0, 0], [1, 5e3], [170, 0]]\n",
        "stages[0].mass_flow_table[2]",
        "is a list of 2; expected a last time of 180 s, as of thrust_table",
    ),
    "thrust without flow": (
        _TABLE + "    mass_flow_table: [[0, 0], [1, 5e3], [150, 0], [180, 0]]\n",
        "stages[0].mass_flow_table",
        "is a list of 4; expected a mass flow where there is thrust, and only there; at 150 s",
    ),
    "flow alone": (
        (
            "    thrust_n: 1e7\n    isp_s: 280\n    burn_time_s: 180\n"
            "    mass_flow_table: [[0, 1], [1, 1]]\n"
        ),
        "stages[0].mass_flow_table",
        "is a list of 2; expected no such key without thrust_table",
    ),
    "thrust beside a table": (
        _TABLE + "    isp_s: 280\n    thrust_n: 1e7\n",
        "stages[0].thrust_n",
        "is 10000000.0; expected no such key beside thrust_table",
    ),
    "length beside a table": (
        _TABLE + "    isp_s: 280\n    burn_time_s: free\n",
        "stages[0].burn_time_s",
        "is 'free'; expected no such key beside thrust_table",
    ),
    "engines of a table": (
        _TABLE + "    isp_s: 280\n    engines: 2\n",
        "stages[0].engines",
        "is 2; expected 1, because thrust_table is the thrust of all motors together",
    ),
    "table that ends without thrust": (
        "    thrust_table: [[0, 1e7], [100, 0], [180, 0]]\n    isp_s: 280\n",
        "stages[0].thrust_table[2]",
        "is a list of 2; expected thrust until the last knot",
    ),
    "table that burns too much": (
        "    thrust_table: [[0, 3e7], [180, 3e7]]\n    isp_s: 280\n",
        "stages[0].thrust_table",
        "is a list of 2; expected burns that take at most",
    ),
    "table that burns more than is loaded": (
        "    propellant_kg: 700000\n    thrust_table: [[0, 2e7], [180, 2e7]]\n    isp_s: 280\n",
        "stages[0].propellant_kg",
        "is 700000.0; expected at least the 1,31",
    ),
}


@pytest.mark.parametrize("case", TABLES)
def test_a_table_that_does_not_fit_is_named(tmp_path, case):
    new, path, rest = TABLES[case]
    text = message(edited(tmp_path, _CORE, new))
    assert re.search(rf"broken\.yaml: (line \d+: )?{re.escape(path)} ", text), text
    assert rest in text


@pytest.mark.parametrize("case", BROKEN)
def test_broken_value_is_named(tmp_path, case):
    old, new, path, rest = BROKEN[case]
    text = message(edited(tmp_path, old, new))
    problem = rf"broken\.yaml: (line \d+: )?{re.escape(path)} "
    assert re.search(problem, text), text
    assert rest in text


def test_a_folder_is_told_of_as_one(tmp_path, monkeypatch):
    """Even one whose name is much like that of a shipped mission."""
    (tmp_path / "ares").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MissionError, match=r"^ares: is a directory; expected a YAML mission file$"):
        load_mission("ares")


def test_of_a_list_that_is_wrong_throughout_twenty_problems_are_told():
    error = MissionError("x.yaml", [f"problem {k}" for k in range(30)])
    assert str(error).endswith("; also problem 19; and 10 more")


def test_every_problem_is_kept(tmp_path):
    text = TEXT.replace("mass_kg: 5837.0", "mass_kg: -1").replace("isp_s: 448.0", "isp_s: 0")
    path = tmp_path / "two.yaml"
    path.write_text(text)
    with pytest.raises(MissionError) as caught:
        load_mission(path)
    problems = caught.value.problems
    assert len(problems) == 2
    assert str(caught.value) == f"{path}: {'; also '.join(problems)}"


def test_the_line_is_that_of_the_key(tmp_path):
    path = edited(tmp_path, "isp_s: 448.0", "isp_s: -448.0")
    line = (
        path.read_text()
        .splitlines()
        .index(next(row for row in path.read_text().splitlines() if "-448.0" in row))
    )
    assert f"line {line + 1}: stages[1].isp_s is -448.0" in message(path)


def test_problem_inside_an_arc(tmp_path):
    path = edited(tmp_path, "coast_s: 0.70", "coast_s: -0.70", SATURN)
    assert (
        "stages[0].arcs[0].coast_s is -0.7; expected a number from 0.001 to 864000 in s"
        in message(path)
    )
    path = edited(tmp_path, "isp_s: 427.0", "isp: 427.0", SATURN)
    assert "stages[0].arcs[3].isp is not a known key (its value is 427.0); did you mean isp_s?" in (
        message(path)
    )
    path = edited(tmp_path, "[0.51, 0.0]", "[0.81, 0.0]", SATURN)
    assert "stages[0].arcs[3].tail_off is a list of 2; expected a tail-off of 0.81 s" in message(
        path
    )
    path = edited(tmp_path, "time_s: 192.3", "time_s: 92.3", SATURN)
    assert "jettisons[1].time_s is 92.3; expected at least 163 s, when stage S-II" in message(path)


def with_free_core(jettison):
    """Ares V whose core burn is free, with another criterion for its fairing."""
    text = TEXT.replace(
        "burn_time_s: 181.25", "burn_time_s: free\n    max_s: 240.0\n    propellant_kg: 777134"
    )
    text = text.replace("stage: upper stage ", "stage: core ")
    return text.replace("heating_limit_w_m2: 1135.0", jettison)


@pytest.mark.parametrize(
    ("jettison", "line"),
    [
        (
            "time_s: 200.0",
            (
                "jettisons[0].time_s is 200.0; expected no such key in a mission with free arcs "
                "before its last"
            ),
        ),
        (
            "time_after_ignition_s: 250.0",
            (
                "jettisons[0].time_after_ignition_s is 250.0; expected at most 240 s, before an "
                "arc of stage core ends that is free"
            ),
        ),
    ],
)
def test_jettison_by_the_clock_beside_a_free_arc(tmp_path, jettison, line):
    path = tmp_path / "free.yaml"
    path.write_text(with_free_core(jettison))
    assert line in message(path)


FILES = {
    "empty": (b"", "is empty; expected a mapping"),
    "only a comment": (b"# nothing\n", "is empty; expected a mapping"),
    "a list": (b"- 1\n- 2\n", "is a list of 2; expected a mapping"),
    "a word": (b"mission\n", "is 'mission'; expected a mapping"),
    "binary": (bytes(range(256)), "is not text (byte "),
    "control characters": (b"name: \x00\x01\n", "not valid YAML"),
    "bad indent": (
        b"name: x\n  title: y\n",
        (
            "line 2: not valid YAML: indented by 2 blanks, its neighbour in line 1 by 0; keys of "
            "one mapping begin in one column"
        ),
    ),
    "indent one short": (
        b"stages:\n  - name: x\n    # a comment\n    isp_s: 1\n\n   thrust_n: 2\n",
        "line 6: not valid YAML: indented by 3 blanks, its neighbour in line 4 by 4; keys of one",
    ),
    "indent one more": (
        b"stages:\n  - name: x\n     isp_s: 1\n",
        "line 3: not valid YAML: indented by 5 blanks, its neighbour in line 2 by 4; keys of one",
    ),
    "item of a list": (
        b"stages:\n  - name: x\n - name: y\n",
        "line 3: not valid YAML: indented by 1 blank, its neighbour in line 2 by 2; items of one",
    ),
    "no colon": (
        b"title: x\nname falcon  # a name\nsource: y\n",
        "line 2: not valid YAML: 'name falcon' is no 'key: value'; is a colon missing?",
    ),
    "no colon at first": (
        b"name falcon\n\n# a title\ntitle: y\n",
        "line 1: not valid YAML: 'name falcon' is no 'key: value'; is a colon missing?",
    ),
    "no colon in a list": (
        b"stages:\n  - name x\n    isp_s: 1\n",
        "line 2: not valid YAML: 'name x' is no 'key: value'; is a colon missing?",
    ),
    "no colon before a mapping": (
        b"environment:\n  earth\n    j2: 0\n",
        "line 2: not valid YAML: 'earth' is no 'key: value'; is a colon missing?",
    ),
    "no blank behind a colon": (
        b"title: x\nname:falcon\nsource: y\n",
        "line 2: not valid YAML: 'name:falcon' is no 'key: value'; is a blank behind the colon",
    ),
    "colon in a text": (b"title: x: y\n", "here; text with a colon stands in quotes"),
    "open bracket": (b"name: [1, 2\ntitle: y\n", "not valid YAML"),
    "tab": (b"name:\n\t- x\n", "; lines are indented by spaces, not by tabs"),
    "two documents": (b"name: x\n---\nname: y\n", "line 2: not valid YAML"),
    "deep": (b"[" * 100000, "is nested too deeply"),
    "huge": (b"#" * (1 << 21), "is larger than 262144 bytes"),
}


@pytest.mark.parametrize("case", FILES)
def test_what_is_no_mission_file(tmp_path, case):
    content, rest = FILES[case]
    path = tmp_path / "no_mission.yaml"
    path.write_bytes(content)
    text = message(path)
    assert text.startswith(f"{path}: ")
    assert rest in text


def test_a_directory_and_nothing_at_all(tmp_path):
    assert message(tmp_path).endswith("is a directory; expected a YAML mission file")
    assert "no such file" in message(tmp_path / "none.yaml")


def test_what_never_ends_is_not_read(tmp_path):
    pipe = tmp_path / "pipe.yaml"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero"), Path("/dev/full")):
        assert message(path) == f"{path}: is a device or a pipe; expected a YAML mission file"
    sparse = tmp_path / "sparse.yaml"
    sparse.touch()
    os.truncate(sparse, 1 << 30)
    assert message(sparse).endswith("is larger than 262144 bytes; not a mission file")


def test_a_path_that_no_file_can_have(tmp_path):
    assert message("x" * 5000).startswith("mission 'xxx")
    assert message("y/" * 5000).endswith("...: cannot be read: File name too long")
    assert "cannot be read: " in message(tmp_path / "nothing\0in.yaml")
    (tmp_path / "round").symlink_to(tmp_path / "round")
    assert message(tmp_path / "round").endswith("cannot be read: Too many levels of symbolic links")


def test_an_alias_is_refused_before_it_multiplies(tmp_path):
    path = tmp_path / "bomb.yaml"
    lines = ["a: &a0 [x, x]", *(f"b{k}: &a{k} [*a{k - 1}, *a{k - 1}]" for k in range(1, 60))]
    path.write_text("\n".join(lines))
    assert "b1[0] is an alias (*name); expected the value itself" in message(path)


def test_what_cannot_be_printed_is_shown_as_it_is_written(tmp_path):
    bad = TEXT.replace("title:", '"ti\\ntle": 1\ntitle:', 1)
    path = tmp_path / "odd.yaml"
    path.write_text(bad)
    assert "'ti\\ntle' is not a known key" in message(path)
    path.write_text(bad.replace("ntle", "ud800"))
    assert "has half of a character in a key; expected text" in message(path)
    path = edited(tmp_path, "name: upper stage", 'name: "upper\\nstage"')
    assert "stages[1].name is 'upper\\nstage'; expected text on one line" in message(path)


def test_a_flight_of_more_than_ten_days(tmp_path):
    path = edited(tmp_path, "coast_s: 0.20", "coast_s: 863700", SATURN)
    text = message(path)
    assert "stages[1].arcs[0].coast_s is 863700.0; expected a flight of at most 864,000 s" in text


def test_a_last_stage_of_propellant_alone(tmp_path):
    path = edited(
        tmp_path, "    thrust_n: 1306665.0", "    propellant_kg: 301999\n    thrust_n: 1306665.0"
    )
    assert load_mission(path).propellant(1) == 301999.0
    small = path.read_text().replace("mass_kg: 5837.0", "mass_kg: 0.1").replace("301999", "307700")
    path.write_text(small)
    assert "propellant_kg is 307700.0; expected at most 307529.163 kg of the last stage" in message(
        path
    )


def test_a_file_that_may_not_be_read(tmp_path, monkeypatch):
    path = tmp_path / "secret.yaml"
    path.write_text(TEXT)

    def refuse(*_):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    assert "cannot be read: Permission denied" in message(path)


def test_unknown_name():
    text = message("ares_5")
    assert text == (
        "mission 'ares_5': no such mission; shipped are apollo11_ascent, ares_v, "
        "ares_v_transients, ariane5_eca, ariane5_eca_pad, delta_iii, delta_iii_coast, "
        "delta_iii_pad, electron_sso, electron_sso_pad, falcon9_gto, falcon9_gto_pad, "
        "falcon9_iss_pad, falcon9_leo_pad, geostationary_burn, geostationary_transfer, "
        "saturn_v_as506, saturn_v_as506_flown, saturn_v_as506_pad, saturn_v_tli, soyuz_fregat, "
        "soyuz_sso_pad, space_shuttle_sts121, vulcan_gto, or give a file's path; did you mean "
        "ares_v?"
    )
    assert "did you mean" not in message("quetzal")
    assert message("").startswith("mission ''")


def test_the_name_of_a_file_that_is_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("ares_5.yaml").write_text(TEXT)
    assert message("ares_5").endswith("; did you mean ares_5.yaml?")


def test_numbers_are_those_of_yaml_1_2(tmp_path):
    path = edited(tmp_path, "thrust_n: 17437041.0", "thrust_n: 017437041")
    assert load_mission(path).stages[0].thrust_n == 17437041.0
    path = edited(tmp_path, "mu_m3_s2: 3.986e14", "mu_m3_s2: 3.986E+14")
    assert load_mission(path).environment.mu_m3_s2 == 3.986e14


ORBIT = "        perigee_altitude_m: 185000.0\n        apogee_altitude_m: 200000.0\n"
PARK = "        coast_s: free\n"
GTO = resources.files("ares_models").joinpath("missions", "vulcan_gto.yaml").read_text()

# (replacement of the free coast's first line, key, rest of the message)
BROKEN_ORBITS = {
    "perigee above apogee": (
        PARK + ORBIT.replace("185", "205"),
        "apogee_altitude_m",
        "is 200000.0; expected at least perigee_altitude_m, 205000.0 m",
    ),
    "no apogee": (
        PARK + ORBIT.splitlines(keepends=True)[0],
        "apogee_altitude_m",
        "is missing; expected a number in m, beside perigee_altitude_m",
    ),
    "no perigee": (
        PARK + ORBIT.splitlines(keepends=True)[1],
        "perigee_altitude_m",
        "is missing; expected a number in m, beside apogee_altitude_m",
    ),
    "an inclination alone": (
        PARK + "        inclination_deg: 28.5\n",
        "perigee_altitude_m",
        "is missing; expected a number in m, beside inclination_deg",
    ),
    "a least perigee too": (
        PARK + ORBIT + "        min_perigee_altitude_m: 150000.0\n",
        "min_perigee_altitude_m",
        "is 150000.0; expected no such key beside perigee_altitude_m",
    ),
}


@pytest.mark.parametrize("slip", BROKEN_ORBITS)
def test_a_broken_parking_orbit_is_one_line(tmp_path, slip):
    new, key, rest = BROKEN_ORBITS[slip]
    text = message(edited(tmp_path, PARK, new, GTO))
    assert f"stages[0].arcs[2].{key} {rest}" in text


def test_a_coast_of_fixed_length_names_no_orbit(tmp_path):
    old = "        coast_s: free\n        min_s: 300.0\n        max_s: 2000.0\n"
    text = message(edited(tmp_path, old, "        coast_s: 500.0\n" + ORBIT, GTO))
    assert (
        "stages[0].arcs[2].perigee_altitude_m is 185000.0; expected no such key where coast_s is "
        "not free" in text
    )


def test_the_last_stage_has_no_ballistic_coefficient(tmp_path):
    named = "    ballistic_coefficient_kg_m2: 120.0\n    vertical_rise_s: 8.0"
    load_mission(edited(tmp_path, "    vertical_rise_s: 8.0", named, FALCON))
    last = FALCON[FALCON.index("  - name: second stage") :].splitlines()[1]
    named = f"    ballistic_coefficient_kg_m2: 120.0\n{last}"
    assert "stages[1].ballistic_coefficient_kg_m2 is 120.0; expected no such key in the last " in (
        message(edited(tmp_path, last, named, FALCON))
    )


def test_a_coast_before_the_first_burn_names_no_orbit(tmp_path):
    text = message(edited(tmp_path, "        coast_s: 13.0\n", PARK + ORBIT, GTO))
    assert (
        "stages[0].arcs[0].perigee_altitude_m is 185000.0; expected no such key in a coast before "
        "the first burn" in text
    )


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("isp_s: 453.8", "isp: 453.8", "isp is not a known key"),
        (
            "coast_s: free",
            "coast_s: 0",
            "coast_s is 0; expected a number from 0.001 to 864000 in s",
        ),
        (
            "thrust_n: 212600.0",
            "attitude: guided # ",
            "is missing; expected a number in N",
        ),
        ("right_ascension_deg", "longitude_deg", "did you mean right_ascension_deg, which counts"),
        ("{model: us76}", "us76", "is 'us76'; expected a mapping with model, such as us76"),
    ],
)
def test_of_one_slip_nothing_else_is_wrong(tmp_path, old, new, problem):
    text = MISSION.find("vulcan_gto").read_text()
    text = text.replace("atmosphere:\n    model: us76", "atmosphere: {model: us76}")
    assert old in text
    file = tmp_path / "slip.yaml"
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(MissionError) as caught:
        load_mission(file)
    assert problem in caught.value.problems[0]
    # a key that is misspelt is missing too; of the list around it nothing is said
    assert not [line for line in caught.value.problems if " is a list of " in line]


FALCON = MISSION.find("falcon9_leo_pad").read_text()
ARIANE = MISSION.find("ariane5_eca_pad").read_text()
_MERLIN = FALCON[FALCON.index("    thrust_n: 8227000.0") : FALCON.index("    vertical_rise_s: 8.0")]


@pytest.mark.parametrize(
    ("old", "new", "text", "key"),
    [
        ("[0.0, 5950.0e3]", "[0.0, 0.0]", ARIANE, "boosters[0].thrust_table[0][1] is 0.0"),
        (
            _MERLIN,
            "    thrust_table: [[0, 0], [1, 8.2e6], [152, 8.2e6]]\n    isp_s: 311\n",
            FALCON,
            "thrust_table[0][1] is 0.0",
        ),
        (
            _MERLIN,
            "    thrust_table: [[0, 0], [0, 5e6], [1, 8.2e6], [152, 8.2e6]]\n    isp_s: 311\n",
            FALCON,
            "thrust_table[1][1] is 5000000.0",
        ),
        ("thrust_n: 8227000.0", "thrust_n: 4e6", FALCON, "thrust_n is 4000000.0"),
    ],
)
def test_a_pad_that_is_not_left_names_the_thrust_at_lift_off(tmp_path, old, new, text, key):
    said = message(edited(tmp_path, old, new, text))
    assert f"stages[0].{key}; expected more thrust than weight at lift-off: " in said
    assert ("hold_down_s of the initial_state holds the vehicle until then" in said) == (
        "table" in key
    )
    assert said.endswith("; raise the thrust or lower the mass") == ("table" not in key)


def test_a_weak_lift_off_is_told_with_its_ratio(tmp_path):
    said = message(edited(tmp_path, "thrust_n: 8227000.0", "thrust_n: 4e6", FALCON))
    numbers = re.search(
        r"lift-off: (\S+) N at the air pressure of the pad \((\S+) N in vacuum, (\S+) N less by "
        r"exit_area_m2\), weight (\S+) N, ratio (\S+);",
        said,
    )
    thrust, vacuum, less, weight, ratio = (float(x.replace(",", "")) for x in numbers.groups())
    assert vacuum == 4e6
    assert thrust == pytest.approx(vacuum - less, abs=1.0)
    assert ratio == pytest.approx(thrust / weight, abs=0.005)


def test_a_vehicle_of_solids_alone_is_told_what_flies_it(tmp_path):
    table = "        thrust_table: [[0, 9e5], [300, 9e5]]\n        isp_s: 290\n"
    motor = FALCON[FALCON.index("        thrust_n: 981000.0") : FALCON.index("\njettisons:")]
    said = message(edited(tmp_path, motor, table, FALCON))
    assert (
        "stages[1].arcs[1].thrust_table is a list of 2; expected at least one burn of the mission "
        "that guidance can end, with thrust_n and burn_time_s: free, such as a small one after "
        "this motor; where all bur"
    ) in said
    programme = "programme: {over: time_s, table: [[0, 90, 90], [20, 90, 90], [160, 20, 90]]}\n"
    file = tmp_path / "flown.yaml"
    file.write_text(FALCON.replace(motor, table).replace("\ntarget:", f"\n{programme}\ntarget:"))
    assert flown_whole(load_mission(file))


def test_a_table_that_jumps_at_ignition_leaves_the_pad(tmp_path):
    table = "    thrust_table: [[0, 0], [0, 8.2e6], [152, 8.2e6]]\n    isp_s: 311\n"
    load_mission(edited(tmp_path, _MERLIN, table, FALCON))


def test_part_that_does_not_go_with_another_is_told_without_its_content():
    out = "    engine_out: {time_after_ignition_s: 20.0, engines: 9, lost: 1}\n"
    text = MISSION.find("falcon9_leo_pad").read_text()
    rise = "    vertical_rise_s: 8.0\n"
    assert rise in text
    with pytest.raises(MissionError) as refused:
        parse_mission(text.replace(rise, rise + out), "out.yaml")
    told = "stages[0].engine_out is a mapping; expected no such key beside vertical_rise_s"
    assert told in str(refused.value)


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ("initial_state", "time_s and one of six forms, such as geodetic_latitude_deg, longitude"),
        ("stages", "a list, each with name, dry_mass_kg, propellant_kg, thrust_n, isp_s and "),
        ("target", "an orbit by its elements, such as perigee_altitude_m, apogee_altitude_m and "),
    ],
)
@pytest.mark.parametrize("found", ["missing", "3", "empty"])
def test_a_whole_block_that_is_not_there_names_its_keys(block, expected, found):
    whole = re.compile(rf"^{block}:.*\n((  .*)?\n)*", re.MULTILINE)
    text = TEMPLATE.read_text()
    assert whole.search(text)
    instead = {"missing": "", "3": f"{block}: 3\n", "empty": f"{block}:\n"}[found]
    with pytest.raises(MissionError) as refused:
        parse_mission(whole.sub(instead, text), "my.yaml")
    said = str(refused.value)
    assert f"{block} is {found}; expected {expected}" in said
    assert "; also" not in said


@pytest.mark.parametrize("found", ["3", "empty"])
def test_an_environment_that_is_no_mapping_names_its_keys(found):
    text = re.sub(r"environment:\n(  .*\n)+", "", TEMPLATE.read_text())
    text += {"3": "environment: 3\n", "empty": "environment:\n"}[found]
    said = rf"environment is {found}; expected a mapping with mu_m3_s2, earth and atmosphere"
    with pytest.raises(MissionError, match=said):
        parse_mission(text, "my.yaml")


@pytest.mark.parametrize("block", ["earth", "atmosphere"])
def test_a_part_of_the_environment_that_is_missing_names_its_keys(block):
    text = re.sub(rf"  {block}:\n(    .*\n)+", "", TEMPLATE.read_text())
    with pytest.raises(MissionError, match=rf"environment\.{block} is missing; expected a mapping"):
        parse_mission(text, "my.yaml")

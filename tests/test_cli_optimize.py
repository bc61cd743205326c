# SPDX-License-Identifier: Apache-2.0
"""`ares optimize`: output and exit statuses."""

import json
import math
import re
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from ares_bringup.commands import interrupts, launch_window
from ares_bringup.commands import optimize as optimize_command
from ares_bringup.commands.cli import main
from ares_bringup.commands.optimize import (
    _coast_facts,
    constraint_table,
    optimize_payload,
    proof_facts,
)
from ares_bringup.commands.optimum_page import constraint_table as page_table
from ares_bringup.report import console
from ares_models.mission import MISSION, TEMPLATE, load_mission
from ares_optimizer.payload import PropellantMargin
from ares_optimizer.solution import Cause, Check, ConstraintCheck, Status, failed
from ares_optimizer.solve import solve
from ares_optimizer.window import Launch, Window, launched_later
from ares_studies.pages.parts import BLANK, MINUS

#: The second of its three stages burns in held attitude.
HELD = Path(__file__).parents[1] / "src/ares_optimizer/test/missions/solid_middle.yaml"


@pytest.fixture(scope="module")
def ares_v_solved():
    return solve(load_mission("ares_v"), "indirect")


def test_json_is_one_object_with_the_promised_keys(capsys):
    assert main(["optimize", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {
        *("method", "status", "search", "converged", "reason", "t_plf_s", "t_meco_s", "m_f_kg"),
        *("delta_v_m_s", "arcs", "iterations", "solve_ms", "verification"),
    }
    assert [arc["name"] for arc in found["arcs"]] == ["core", "upper stage"]
    assert found["arcs"][-1]["end_s"] == found["t_meco_s"]
    # by the mission: it is one for the fast method
    assert found["method"] == "indirect"
    assert found["status"] == "converged"
    assert found["search"][0] == "indirect: optimal, 174,183.1151 kg"
    assert found["converged"] is True
    assert found["m_f_kg"] == pytest.approx(174_183.1, abs=0.5)
    assert found["t_plf_s"] == pytest.approx(416.64, abs=0.1)
    assert found["t_meco_s"] == pytest.approx(766.907, abs=0.005)
    proof = found["verification"]
    assert proof["radius_m"] == pytest.approx(6_518_889.0, abs=0.1)
    assert proof["fmhr_w_m2"] == pytest.approx(1135.0, rel=1e-4)


def test_the_table_of_the_thesis_stands_beside_ours(capsys):
    assert main(["optimize", "--method", "indirect"]) == 0
    text = capsys.readouterr().out
    assert "Table 4.1" in text
    for number in ("166,630.00", "173,430.00", "174,183.1"):
        assert number in text
    assert "flown again by another integrator" in text
    assert max(len(line) for line in text.splitlines()) <= 100


def test_nothing_is_left_of_a_mission_that_its_programme_flies_whole(capsys, tmp_path):
    text = resources.files("ares_trials").joinpath("sweep", "programme.yaml").read_text()
    text = text.replace("  until: {end_of: first}\n", "").replace("_s: free", "_s: 300.0")
    file = tmp_path / "whole.yaml"
    file.write_text(text)
    assert main(["optimize", "--mission", str(file)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == (
        f"ares: {file}: line 46: programme has no until: it flies the whole mission, and nothing "
        "is left to optimize\n"
    )


def test_an_end_of_a_programme_that_never_comes_has_file_and_line(capsys, tmp_path):
    text = resources.files("ares_trials").joinpath("sweep", "programme.yaml").read_text()
    file = tmp_path / "late.yaml"
    file.write_text(text.replace("until: {end_of: first}", "until: {speed_m_s: 9e5}"))
    for verb in (["optimize"], ["montecarlo", "-n", "4"]):
        assert main([*verb, "--mission", str(file)]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"ares: {file}: line 50: programme.until.speed_m_s is 900000; ")


def test_a_jettison_can_be_held(capsys):
    assert main(["optimize", "--json", "--hold-jettison", "payload fairing=441.02"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["m_f_kg"] == pytest.approx(174_088.9, abs=0.5)
    assert found["t_plf_s"] == pytest.approx(441.02)


def test_without_the_heating_limit_more_mass_arrives(capsys):
    assert main(["optimize", "--json", "--heating", "ignored"]) == 0
    assert json.loads(capsys.readouterr().out)["m_f_kg"] > 174_200.0


def test_a_mission_that_cannot_be_flown_is_exit_4_with_a_reason(capsys, tmp_path):
    shipped = resources.files("ares_models").joinpath("missions", "ares_v.yaml").read_text()
    text = shipped.replace("    isp_s: 448.0 ", "    propellant_kg: 90000.0\n    isp_s: 448.0 ")
    file = tmp_path / "short.yaml"
    file.write_text(text)
    assert main(["optimize", "--json", "--mission", str(file)]) == 4
    found = json.loads(capsys.readouterr().out)
    assert found["converged"] is False
    assert "propellant" in found["reason"]


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--mission", "nope"], "no such mission"),
        (["--method", "magic"], "'magic'; expected one of auto"),
        (["--hold-jettison", "fairing=1"], "the name one of 'payload fairing'"),
        (["--hold-jettison", "payload fairing=soon"], "expected a number of seconds"),
        (["--mission", str(HELD), "--method", "jump"], ") has attitude: held"),
        (["--mission", str(HELD), "--method", "analytic"], "ares: "),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, argv, words):
    assert main(["optimize", *argv]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert words in captured.err


def test_arcs_and_jettisons_have_their_names_beside_their_numbers():
    mission = load_mission("falcon9_gto")
    text = "length of arc 1, s; arc 2: in arc 22; heating at jettison 0; jettison 1; q of stage 0"
    assert mission.with_names(text) == (
        "length of arc 1 (first burn), s; arc 2 (coast): in arc 22; heating at jettison 0 "
        "(fairing); jettison 1; q of stage 0 (S2)"
    )


def test_heating_far_above_the_limit_is_called_so():
    solution = solve(load_mission("ares_v"), "indirect")
    assert "times the limit" not in proof_facts(solution)["greatest heating"]
    hot = replace(solution.verification, peak_fmhr_after_jettison_w_m2=113_500.0)
    line = proof_facts(replace(solution, verification=hot))["greatest heating"]
    assert line == "113,500.0 W/m2 after the jettison, 100 times the limit"
    free = ConstraintCheck(Check.ARC_LENGTH, "length of arc 1", 9.0, 0.0, False, "s", True)
    free = replace(solution, verification=hot, constraints=(*solution.constraints, free))
    more = f"{line}; a higher min_altitude_m of arc 1 keeps it down"
    assert proof_facts(free)["greatest heating"] == more
    coasting = replace(free, arcs=tuple(replace(piece, delta_v_m_s=0.0) for piece in free.arcs))
    more = f"{line}; a higher min_perigee_altitude_m of arc 1 keeps it down"
    assert proof_facts(coasting)["greatest heating"] == more


def test_a_free_length_is_no_constraint_unless_a_bound_acts(capsys):
    mission = load_mission("falcon9_gto")
    length = ConstraintCheck(
        Check.ARC_LENGTH, "length of arc 1", 1_092.398, 0.001, False, "s", True, 0.0
    )
    held = replace(length, value=0.0, limit=0.0, active=True, multiplier=-0.5)
    beyond = replace(length, satisfied=False)
    solution = replace(
        solve(load_mission("ares_v"), "indirect"), constraints=(length, held, beyond)
    )
    console().print(constraint_table(mission, solution))
    free, acting, violated = (line.split() for line in capsys.readouterr().out.splitlines()[1:])
    assert free[-4:] == ["1,092.398", "-", "free", "-"]
    assert acting[-4:] == ["0", "0", "active", "-0.5"]
    assert violated[-4:-1] == ["1,092.398", "0.001", "VIOLATED"]
    rows = [[cell.text for cell in row.cells] for row in page_table(mission, solution).rows]
    assert rows[0] == [BLANK, "free", "1,092.39800", BLANK]
    assert rows[1][:2] == [f"{MINUS}0.5000", "active"]


def test_of_an_infeasible_mission_the_reason_is_said_once(capsys, tmp_path):
    file = tmp_path / "heavy.yaml"
    file.write_text(TEMPLATE.read_text().replace("payload_kg: 200.0", "payload_kg: 700.0"))
    assert main(["optimize", "--mission", str(file)]) == 4
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("infeasible: propellant of the last stage: 344 kg short")
    advice = "  --maximize payload finds the greatest payload that arrives, if any does"
    assert lines[2:] == [advice]


def test_of_a_mission_without_a_plan_the_reason_is_said_once(capsys, monkeypatch):
    missing = failed("auto", Cause(Status.STALLED, "no flight was found"))
    missing = replace(missing, steps=("collocation: no flight was found",))
    monkeypatch.setattr(optimize_command, "solve_once", lambda *_, **__: missing)
    assert main(["optimize"]) == 1
    assert capsys.readouterr().out.count("no flight was found") == 1


def test_a_value_that_is_rounding_is_zero(ares_v_solved):
    equator = ConstraintCheck(
        Check.INCLINATION, "inclination", 3.4e-25, 0.0, True, "deg", True, -0.0
    )
    table = constraint_table(load_mission("ares_v"), replace(ares_v_solved, constraints=(equator,)))
    assert [list(column.cells) for column in table.columns][1:3] == [["0"], ["0"]]
    assert list(table.columns[4].cells) == ["+0"]


def test_a_coast_of_many_hours_is_told(ares_v_solved):
    (first, *_) = ares_v_solved.arcs
    coast = replace(first, start_s=900.0, end_s=900.0 + 33.8 * 3600.0, delta_v_m_s=0.0)
    assert _coast_facts(ares_v_solved) == {}
    told = _coast_facts(replace(ares_v_solved, arcs=(first, coast)))
    assert told == {"longest coast": "33.8 h; max_s of a free coast bounds its length"}


@pytest.mark.trial
def test_the_greatest_dynamic_pressure_is_told(capsys):
    assert main(["optimize", "--mission", "delta_iii_pad"]) == 0
    out = capsys.readouterr().out
    said = re.search(r"greatest dynamic pressure: (\S+) kPa at (\S+) s and (\S+) km", out)
    assert said is not None
    pressure, time, height = map(float, said.groups())
    # as the simulator flies the plan, between the states of the plan
    assert (pressure, time) == (61.38, 57.1)
    # the flight's own speed there, in the exponential air of the problem
    speed = math.sqrt(2e3 * pressure / (1.225 * math.exp(-height / 7.2)))
    mission = load_mission("delta_iii_pad")
    track = solve(mission, "auto").trajectory
    k = int(np.argmin(np.abs(track.time_s - time)))
    turning = np.array([0.0, 0.0, mission.earth().rotation_rate])
    relative = track.velocity[k] - np.cross(turning, track.position[k])
    assert np.linalg.norm(relative) == pytest.approx(speed, rel=0.01)


@pytest.mark.trial
def test_a_dynamic_pressure_that_no_launcher_has_is_warned_of(capsys, monkeypatch):
    words = ("optimize", "--json", "--mission", "delta_iii_pad")
    main(words)
    assert "warning" not in capsys.readouterr().err
    monkeypatch.setattr("ares_models.mission_warnings.MOST_PRESSURE", 6e4)
    main(words)
    assert capsys.readouterr().err.startswith(
        "ares: warning: the planned flight passes through 61 kPa, launchers through 20 to 60 kPa; "
    )


@pytest.mark.trial
def test_the_wind_of_the_plan_is_told(tmp_path, capsys):
    text = MISSION.find("delta_iii_pad").read_text()
    table = "wind_table: [[0.0, 3.0, 4.0], [12000.0, -40.0, 30.0]]"
    path = tmp_path / "windy.yaml"
    path.write_text(text.replace("scale_height_m: 7200.0", f"scale_height_m: 7200.0\n    {table}"))
    assert main(["optimize", "--mission", str(path)]) == 0
    line = "planned in the wind of the mission: up to 50.0 m/s at 12.0 km"
    assert line in capsys.readouterr().out.splitlines()
    assert main(["optimize", "--mission", "delta_iii_pad"]) == 0
    assert "wind" not in capsys.readouterr().out


def test_no_dynamic_pressure_is_told_of_a_flight_above_the_air(capsys):
    assert main(["optimize", "--mission", "ares_v"]) == 0
    assert "dynamic pressure" not in capsys.readouterr().out


def made_up_window(mission):
    """Return three launches with one flight, that of another mission."""
    solution = solve(load_mission("ares_v"), "indirect")
    costs = (3.0, 0.0, 2.0)
    before, best, after = (
        Launch(late, launched_later(mission, late), replace(solution, m_f_kg=9000.0 - cost))
        for late, cost in zip((-50.0, 10.0, 70.0), costs, strict=True)
    )
    return Window(best, (before, best, after))


@pytest.mark.long
@pytest.mark.parametrize("made_up", [True, pytest.param(False, marks=pytest.mark.trial)])
def test_launch_window_is_a_table_or_one_object(capsys, monkeypatch, made_up):
    words = ("optimize", "--mission", "delta_iii_pad", "--window", "1")
    mission = load_mission("delta_iii_pad")
    found = made_up_window(mission) if made_up else launch_window.launch_window(mission, 1)
    monkeypatch.setattr(launch_window, "launch_window", lambda *_: found)
    assert main([*words]) == 0
    text = capsys.readouterr().out
    assert re.search(r"best launch time of delta_iii_pad: \d+ s after that of the file", text)
    assert re.search(r"\n  zero_longitude_deg: 80\.\d+\n", text)
    assert [line.split()[0] for line in text.splitlines()[4:]] == ["-1", "0", "+1"]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["launches"][1] == found["best"]
    assert found["best"]["cost_kg"] == 0.0
    # the published node is that of a launch at the best time, to the minute
    assert abs(found["best"]["after_file_s"]) < 60.0


def test_a_reason_in_the_table_of_a_window_leaves_the_other_columns_whole(capsys, monkeypatch):
    mission, reason = load_mission("falcon9_iss_pad"), "propellant: " + 30 * "too little "
    short = failed("collocation", Cause(Status.INFEASIBLE, reason))
    launch = Launch(0.0, mission, short)
    monkeypatch.setattr(launch_window, "launch_window", lambda *_: Window(launch, (launch,)))
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["optimize", "--mission", "falcon9_iss_pad", "--window", "1"]) == 4
    assert f"0    {mission.epoch.isoformat(timespec='milliseconds')}" in capsys.readouterr().out


def test_a_payload_that_is_still_sought_at_an_interrupt_is_told(capfd, monkeypatch):
    def left(_margin, mission):
        if mission.payload_kg > 200.0:
            raise interrupts.Interrupted
        return 0.8 * (900.0 - mission.payload_kg)

    monkeypatch.setattr(interrupts, "_told", [])
    monkeypatch.setattr(interrupts, "_found", [])
    monkeypatch.setattr(PropellantMargin, "of", left)
    with pytest.raises(KeyboardInterrupt):
        optimize_payload(str(TEMPLATE), as_json=True, time_limit_s=60.0)
    interrupts.report_interrupt()
    assert capfd.readouterr().err.endswith(
        "ares: interrupted; greatest payload so far: 200.00 kg, which leaves 560 kg of propellant\n"
    )


def test_launch_window_goes_with_no_other_search(capsys):
    assert main(["optimize", "--window", "1", "--maximize", "payload"]) == 2
    assert "--window does not go with --maximize" in capsys.readouterr().err
    assert main(["optimize", "--mission", "falcon9_leo_pad", "--window", "1"]) == 2
    assert "target has no node" in capsys.readouterr().err

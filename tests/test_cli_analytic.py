# SPDX-License-Identifier: Apache-2.0
"""`ares optimize --method analytic`, and the service with guidance's analytic guess."""

import json
from importlib import resources

import numpy as np
import pytest

from ares_bringup.commands.cli import main
from ares_models.mission import load_mission
from ares_msgs.msg import NavState
from ares_msgs.srv import SolveTrajectory
from ares_node.time import stamp_from_ns
from ares_optimizer.node import OptimizerNode
from ares_optimizer.solve import solve


def test_both_targets_stand_beside_the_optimum_and_the_thesis(capsys):
    assert main(["optimize", "--method", "analytic"]) == 0
    text = capsys.readouterr().out
    assert "analytic approximation, not an optimum" in text
    head, rows = text[: text.index("steering from")], {}
    for line in head.splitlines():
        cells = [cell.strip() for cell in line.split("  ") if cell.strip()]
        rows[cells[0] if cells else ""] = cells[1:]
    assert rows["jettison target of"] == ["mission", "optimizer", "optimum", "thesis"]
    assert rows["staging to jettison, s"] == ["79.40", "79.42", "79.49", "131.81"]
    assert rows["jettison to cut-off, s"] == ["350.31", "350.30", "350.27", "336.52"]
    assert rows["delta-V to jettison, m/s"][-1] == "562.00"
    assert "flown open loop" in text
    assert "VIOLATED" in text
    assert max(len(line) for line in text.splitlines()[2:]) <= 80


def test_json_has_everything(capsys):
    argv = ["optimize", "--method", "analytic", "--json", "--profile", "thesis"]
    argv += ["--position-integral", "trapezoid", "--steps", "50", "200"]
    assert main([*argv, "--jettison-target", "optimizer"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["method"] == "analytic"
    assert "not an optimum" in found["reason"]
    both = found["analytic"]["by_jettison_target"]
    assert set(both) == {"mission", "optimizer"}
    chosen = both[found["analytic"]["jettison_target"]]
    assert chosen["profile"] == "thesis"
    assert chosen["position_integral"] == "trapezoid"
    assert chosen["steps"] == [50, 200]
    assert chosen["jettison_target"]["source"] == "optimizer"
    part = chosen["part_one"]
    assert part["iterations"] <= 10
    assert part["time_to_go_s"] == pytest.approx(84.85, abs=0.1)
    assert set(part["partials_m_per_deg"]) == {"theta_end", "gamma_joint"}
    assert len(chosen["delta_v_m_s"]) == 3
    assert chosen["t_plf_s"] == found["t_plf_s"]
    optimum = found["analytic"]["optimum"]
    assert optimum["figures"]["theta_plf_deg"] == pytest.approx(17.88, abs=0.01)


def test_a_mission_that_is_not_the_thesis_has_no_thesis_column(capsys, tmp_path):
    shipped = resources.files("ares_models").joinpath("missions", "ares_v.yaml").read_text()
    file = tmp_path / "other.yaml"
    file.write_text(shipped.replace("name: ares_v", "name: other"))
    assert main(["optimize", "--method", "analytic", "--mission", str(file)]) == 0
    text = capsys.readouterr().out
    assert "131.81" not in text
    assert "79.40" in text


def test_what_stands_in_the_way_is_exit_1_with_a_reason(capsys, tmp_path):
    shipped = resources.files("ares_models").joinpath("missions", "ares_v.yaml").read_text()
    text = shipped.replace("    isp_s: 448.0 ", "    propellant_kg: 90000.0\n    isp_s: 448.0 ")
    file = tmp_path / "short.yaml"
    file.write_text(text)
    assert main(["optimize", "--json", "--method", "analytic", "--mission", str(file)]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["converged"] is False
    assert "propellant of the last stage" in found["reason"]


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--profile", "thesis"], "--profile goes with --method analytic only"),
        (["--position-integral", "exact"], "--position-integral goes with --method analytic"),
        (["--steps", "10", "10"], "--steps goes with --method analytic only"),
        (["--jettison-target", "mission"], "--jettison-target goes with --method analytic"),
        (["--method", "analytic", "--steps", "10", "10"], "--position-integral trapezoid only"),
        (
            [*("--method", "analytic", "--position-integral", "trapezoid"), "--steps", "0", "9"],
            "steps is (0, 9); expected two integers from 1 to 100,000",
        ),
        (["--method", "analytic", "--heating", "ignored"], "--heating does not go with"),
        (["--method", "analytic", "--hold-jettison", "x=1"], "--hold-jettison does not go with"),
        (["--method", "analytic", "--maximize", "payload"], "--maximize does not go with"),
        (["--method", "analytic", "--mission", "delta_iii"], "two stages of one burn each"),
        (["--method", "analytic", "--mission", "saturn_v_as506"], "two stages of one burn each"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, argv, words):
    assert main(["optimize", *argv]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert words in captured.err


def test_the_service_answers_from_a_navigation_state(graph):
    graph.start(OptimizerNode)
    client = graph.observer.create_client(SolveTrajectory, "solve_trajectory")
    graph.spin(client.service_is_ready)
    flight = solve(load_mission("ares_v")).trajectory
    k = int(np.searchsorted(flight.time_s, 250.0))
    state = NavState(
        stamp=stamp_from_ns(round(1e9 * flight.time_s[k])),
        position=flight.position[k],
        velocity=flight.velocity[k],
        mass=flight.mass[k],
        arc=0,
        arc_start_time=155.9,
        heating_rate=float("nan"),
    )
    request = SolveTrajectory.Request(
        mission="ares_v", method="analytic", use_nav_state=True, nav_state=state
    )
    call = client.call_async(request)
    graph.spin(call.done)
    answer = call.result()
    assert answer.error_code == SolveTrajectory.Response.NONE, answer.message
    assert answer.converged
    assert answer.jettison_time == pytest.approx(416.64, abs=0.3)
    assert answer.cutoff_time == pytest.approx(766.907, abs=0.1)
    assert len(answer.arc_delta_v) == 3
    times = np.array(answer.sample_time)
    at = np.flatnonzero(np.abs(times - answer.jettison_time) < 1e-6)
    assert len(at) == 2
    mass = np.array(answer.sample_mass)[at]
    assert mass[0] - mass[1] == pytest.approx(5837.0)
    radius = np.linalg.norm(np.reshape(answer.sample_position, (-1, 3))[at], axis=1)
    assert radius == pytest.approx(6_497_750.0, abs=100.0)

# SPDX-License-Identifier: Apache-2.0
"""Start and stop transients: their mission, its flights, and the cost of each."""

import math

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_optimizer.solution import OptimizerError
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled
from ares_thesis.transients import (
    PLAIN,
    WITH_TRANSIENTS,
    Transients,
    mass_after_full_flow,
    transient_mission,
    transient_study,
)
from ares_trials.testing.arrivals import assert_within, errors

OTIS_S = 784.0
OTIS_KG = 166_630.0


@pytest.fixture(scope="module")
def rows():
    return {row.name: row for row in transient_study(OTIS_S)}


@pytest.fixture(scope="module")
def mission():
    return load_mission(WITH_TRANSIENTS)


class TestMission:
    def test_is_the_plain_one_but_for_its_arcs(self, mission):
        plain = load_mission(PLAIN)
        for part in ("environment", "initial_state", "jettisons", "target"):
            assert getattr(mission, part) == getattr(plain, part)
        for stage, other in zip(mission.stages, plain.stages, strict=True):
            assert stage.ignition_mass_kg == other.ignition_mass_kg
            (burn,), (same,) = stage.burns, other.burns
            assert (burn.thrust_n, burn.isp_s) == (same.thrust_n, same.isp_s)

    def test_closes_with_table_2_2(self, mission):
        """Check that the core burns as much as without transients: 450,600 kg are left."""
        core = mission.stages[0]
        (burn,) = core.burns
        assert burn.tail_gain_s == pytest.approx(0.958, abs=1e-9)
        g0 = mission.environment.g0_m_s2
        taken = burn.propellant(g0, core.ignition_mass_kg)
        (plain,) = load_mission(PLAIN).stages[0].burns
        assert taken == pytest.approx(plain.propellant(g0, core.ignition_mass_kg), abs=1e-3)
        left = core.ignition_mass_kg - taken
        assert left == pytest.approx(450_600.0, abs=1.0)
        assert left - mission.stages[1].ignition_mass_kg == pytest.approx(142_763.0, abs=1.0)

    def test_its_timeline(self, mission):
        core, tail, separation, upper = mission.arrays().arcs
        assert core["duration"] + tail["duration"] == pytest.approx(338.108 - 155.9)
        assert tail["duration"] >= core["tail_time"][core["tail_knots"] - 1]
        assert mission.ignition_times()[1] == pytest.approx(338.808)
        assert separation["duration"] == pytest.approx(0.7)
        assert upper["start_loss"] == pytest.approx(2.1)

    @pytest.mark.parametrize("method", ["direct11", "direct14", "direct20", "jump", "indirect"])
    def test_every_method_solves_it(self, mission, method):
        solution = solve(mission, method)
        assert solution.converged, solution.reason
        near = 1.0 if method == "jump" else 0.1
        assert solution.m_f_kg == pytest.approx(173_932.9, abs=near)
        assert solution.t_meco_s == pytest.approx(771.506, abs=0.003)
        assert solution.verification.position_defect_m < 0.1

    def test_peg_flies_it(self, mission):
        flight = fly_compiled(mission)
        assert_within(errors(mission, flight), [10.0, 0.05, 1e-3, 1e-3])
        optimum = solve(mission, verify=False)
        assert 0.0 < optimum.m_f_kg - flight.plant["mass"] < 100.0


class TestStudy:
    def test_begins_without_and_ends_with_all(self, rows, mission):
        plain = solve(load_mission(PLAIN), "indirect", verify=False)
        full = solve(mission, "indirect", verify=False)
        for name, solution in (("no transients", plain), ("all three", full)):
            assert rows[name].m_f_kg == pytest.approx(solution.m_f_kg, abs=1e-3)
            assert rows[name].t_meco_s == pytest.approx(solution.t_meco_s, abs=1e-6)
            assert rows[name].t_plf_s == pytest.approx(solution.t_plf_s, abs=1e-4)
        assert next(iter(rows)) == "no transients"
        assert rows["no transients"].m_f_change_kg == 0.0

    def test_each_alone_adds_up(self, rows):
        alone = ("RS-68 tail-off", "separation", "J-2X start")
        for name in alone:
            assert rows[name].m_f_change_kg < 0.0 < rows[name].t_meco_change_s
        total = sum(rows[name].m_f_change_kg for name in alone)
        assert rows["all three"].m_f_change_kg == pytest.approx(total, rel=0.02)
        assert rows["all three"].m_f_change_kg == pytest.approx(-250.2, abs=0.5)
        assert rows["all three"].t_meco_s == pytest.approx(771.506, abs=0.001)

    def test_what_a_second_costs(self, rows):
        lost = rows["1 s of RS-68 thrust lost"]
        assert lost.t_meco_change_s == pytest.approx(6.7, abs=0.1)
        assert lost.m_f_change_kg == pytest.approx(-2000.0, abs=50.0)
        assert lost.t_plf_change_s == pytest.approx(-6.2, abs=0.1)
        dead = rows["1 s of J-2X dead time"]
        assert dead.t_meco_change_s == pytest.approx(1.2, abs=0.05)
        assert dead.m_f_change_kg == pytest.approx(-66.0, abs=0.5)
        assert dead.t_plf_change_s == pytest.approx(-0.8, abs=0.05)

    def test_seconds_that_reach_the_published_cut_off(self, rows):
        thrust = rows["all three, and RS-68 thrust lost"]
        dead = rows["all three, and J-2X dead time"]
        alone = rows["RS-68 thrust lost, nothing else"]
        for row in (thrust, dead, alone):
            assert row.t_meco_s == pytest.approx(OTIS_S, abs=1e-3)
        assert thrust.transients.lost_thrust_s == pytest.approx(1.842, abs=0.005)
        assert thrust.m_f_kg == pytest.approx(170_217.0, abs=1.0)
        assert dead.transients.dead_time_s == pytest.approx(10.15, abs=0.02)
        assert dead.m_f_kg == pytest.approx(173_235.0, abs=1.0)
        assert alone.transients.lost_thrust_s == pytest.approx(2.541, abs=0.005)

    def test_no_transient_explains_the_rest(self, rows):
        """Burn at full flow from 337.15 s, the most possible by 784 s."""
        least = rows["full flow from staging on"]
        assert math.isnan(least.t_plf_s)
        assert least.m_f_kg - OTIS_KG == pytest.approx(2469.0, abs=1.0)
        flights = [row for row in rows.values() if row.t_meco_s == pytest.approx(OTIS_S, abs=1e-3)]
        assert len(flights) == 4
        assert all(row.m_f_kg > least.m_f_kg - 1.0 for row in flights)
        # nothing lost above, all of it below
        alone = rows["RS-68 thrust lost, nothing else"]
        assert alone.m_f_kg == pytest.approx(least.m_f_kg, abs=1.0)

    def test_verified_flights(self):
        for transients in (Transients(lost_thrust_s=1.8), Transients(True, True, True, 0.0, 10.0)):
            case = transient_mission(transients)
            solution = solve(case, "indirect")
            assert solution.converged, solution.reason
            assert solution.verification.position_defect_m < 0.01
            assert_within(errors(case, fly_compiled(case)), [10.0, 0.05, 1e-3, 1e-3])

    def test_shape_matters_little(self, mission):
        """Compare tail-offs of equal area and length: equal optima within 0.5 kg."""
        core, upper = mission.stages
        burn, coast = core.flight_arcs
        masses = []
        for high in (0.6, 0.8, 1.0):
            # steep first or steep in the middle
            kinks = ((0.4, high), (1.516, 1.0 - high))
            bent = burn.model_copy(update={"tail_off": ((0.0, 1.0), *kinks, (1.916, 0.0))})
            assert bent.tail_gain_s == pytest.approx(0.958)
            stage = core.model_copy(update={"arcs": (bent, coast)})
            case = mission.model_copy(update={"stages": (stage, upper)})
            masses.append(solve(case, "indirect", verify=False).m_f_kg)
        assert np.ptp(masses) < 0.5

    def test_mass_after_full_flow(self):
        """Check with Table 2.2: 302,000 kg at ignition without the fairing, 297.417 kg/s."""
        expected = 302_000.0 - 297.417 * (769.45 - 337.15)
        assert mass_after_full_flow(load_mission(PLAIN), 769.45) == pytest.approx(expected, abs=1.0)

    def test_a_time_that_no_loss_leads_to(self):
        with pytest.raises(
            OptimizerError, match=r"^published_t_meco_s is 770 s; expected at least"
        ):
            transient_study(770.0)

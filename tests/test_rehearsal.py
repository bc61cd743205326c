# SPDX-License-Identifier: Apache-2.0
"""Planned missions are flown ahead: a miss is refused before the start, a loss is reported."""

import re
from pathlib import Path

import pytest
import yaml

from ares_bringup.options import CannotStart
from ares_bringup.rehearsal import rehearse
from ares_studies.closed_loop import plan_solution
from ares_trials.random_vehicles import random_coasting_mission
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.simulator import CommandRefused, Simulator

LAUNCHERS = Path(__file__).parent.parent / "benchmarks" / "launchers"
MISSIONS = Path(__file__).parents[1] / "src/ares_optimizer/test/missions"
FROM_PADS = Path(__file__).parents[1] / "src/ares_studies/test/missions"


@pytest.fixture(scope="module", autouse=True)
def plans():
    """Solve each plan once for all callers."""
    found = {}

    def once(mission, law, time_limit_s):
        if mission.name not in found:
            found[mission.name] = plan_solution(mission, law, time_limit_s=time_limit_s)
        return found[mission.name]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ares_studies.closed_loop.plan_solution", once)
        yield


def parameters(name, law):
    return {"mission": str(LAUNCHERS / f"{name}.yaml"), "law": law}


def test_a_mission_that_needs_no_plan_is_not_flown_ahead():
    assert rehearse({"mission": "ares_v"}) == ""


@pytest.mark.trial
def test_a_law_that_arrives_with_what_is_planned_is_no_matter():
    assert rehearse(parameters("atlas401_gto", "peg")) == ""


def test_a_law_that_cannot_fly_a_mission_is_told_before_a_plan_is_searched(monkeypatch):
    monkeypatch.setattr("ares_studies.closed_loop.plan_solution", None)
    with pytest.raises(CannotStart, match=r"law is 'peg_thesis'; expected .* \("):
        rehearse({"mission": str(FROM_PADS / "black_arrow_pad.yaml"), "law": "peg_thesis"})


def test_a_loss_is_told_before_anything_starts(monkeypatch):
    monkeypatch.setattr("ares_bringup.rehearsal.TOLERATED", 1e-5)
    said = rehearse({"mission": "ariane5_eca", "law": "igm"})
    found = re.fullmatch(
        r"law igm is expected to end with ([\d,.]+) kg, ([\d.]+) % less than the plan's "
        r"([\d,.]+) kg",
        said,
    )
    flown, lost, planned = (float(text.replace(",", "")) for text in found.groups())
    assert planned == pytest.approx(21_170.8, abs=0.1)
    assert 0.0 < lost < 0.1
    assert lost == pytest.approx(100.0 * (1.0 - flown / planned), abs=0.006)


@pytest.mark.parametrize("law", ["peg", "optimal"])
def test_a_loss_is_that_of_the_stage_below_a_solid(monkeypatch, law):
    """Compare what is dropped with the stage: the mass at cut-off is that of the solid."""
    monkeypatch.setattr("ares_bringup.rehearsal.TOLERATED", -1.0)
    said = rehearse({"mission": str(MISSIONS / "solid_kick.yaml"), "law": law})
    found = re.fullmatch(
        rf"law {law} is expected to end arc 2 \(coast\) with ([\d,.]+) kg, (-?[\d.]+) % less than "
        r"the plan's ([\d,.]+) kg",
        said,
    )
    assert found, said
    flown, lost, planned = (float(text.replace(",", "")) for text in found.groups())
    assert flown == pytest.approx(planned, rel=1e-3)
    assert planned > 900.0
    assert lost == pytest.approx(100.0 * (1.0 - flown / planned), abs=0.01)


@pytest.mark.trial
def test_an_implausible_dynamic_pressure_is_told_before_anything_starts(monkeypatch):
    mission = {"mission": "electron_sso_pad", "law": "optimal"}
    assert "kPa" not in rehearse(mission)
    monkeypatch.setattr("ares_models.mission_warnings.MOST_PRESSURE", 2e4)
    said = r"the planned flight passes through \d\d kPa, launchers through 20 to 60 kPa; "
    assert re.search(said, rehearse(mission))


def test_a_law_that_misses_is_refused_and_one_that_arrives_named():
    flown = {"mission": "ariane5_eca", "law": "peg", "max_iterations": 1}
    said = (
        r"law is 'peg', which misses the target when the mission is flown ahead \("
        r".*; apogee radius off by -3\.56e\+07 m, allowed 1\.19e\+03 m\); try law optimal"
    )
    with pytest.raises(CannotStart, match=f"^{said}$"):
        rehearse(flown)


@pytest.mark.trial
def test_a_command_that_the_vehicle_refuses_is_told_with_its_reason(monkeypatch):
    def command(vehicle, _steering):
        if vehicle.sequence == 5:
            raise CommandRefused("cutoff_time is 3 s; expected 155.9 s or later, or nan")

    monkeypatch.setattr(Simulator, "command", command)
    said = (
        r"the vehicle refuses its command at [\d.]+ s: cutoff_time is 3 s; expected 155\.9 s or "
        r"later, or nan"
    )
    with pytest.raises(CannotStart, match=rf"^law is 'peg', which misses .* \({said}\); no other"):
        rehearse(parameters("atlas401_gto", "peg"))


@pytest.mark.trial
@pytest.mark.parametrize("law", one_in(2, ["peg", "igm"]))
def test_the_shipped_mission_that_one_law_alone_flies(law):
    """Check the statement in docs/missions.md."""
    refused = rf"^law is '{law}', which misses .* off by .*; try law optimal$"
    with pytest.raises(CannotStart, match=refused):
        rehearse({"mission": "delta_iii_coast", "law": law})


SAID_BY_THE_THESIS = (
    r"^law is 'peg_thesis'; expected peg, igm or optimal, which fly arcs before the last that are "
    r"free, as arc 1 \(.+\) and arc 2 \(.+\)$"
)


@pytest.mark.parametrize("name", one_in(2, ["nearly_there", "long_weak_burn"]))
def test_a_law_that_finds_no_way_by_itself_asks_for_a_plan(name):
    """Nothing of these missions is free but the end of their one burn."""
    mission = str(MISSIONS / f"{name}.yaml")
    assert rehearse({"mission": mission, "law": "optimal"}) == ""
    for law in ("peg", "igm"):
        with pytest.raises(CannotStart, match=rf"^law is '{law}', which .*; try law optimal$"):
            rehearse({"mission": mission, "law": law})


def test_a_law_that_flies_no_plan_says_so():
    with pytest.raises(CannotStart, match=SAID_BY_THE_THESIS):
        rehearse({"mission": "falcon9_gto", "law": "peg_thesis"})


@pytest.mark.trial
def test_burns_of_fixed_length_that_give_too_much_are_told(tmp_path):
    data = random_coasting_mission(50_056).model_dump(exclude_unset=True, mode="json")
    path = tmp_path / "surplus.yaml"
    path.write_text(yaml.safe_dump(data))
    remedy = r"without the last one, .*; give it a longer least length \(min_s\), or add payload$"
    with pytest.raises(CannotStart, match=remedy):
        rehearse({"mission": str(path), "law": "peg"})


def test_a_law_that_starts_from_the_optimizer_is_checked_before_it_is_asked():
    refused = (
        r"^law is 'peg_thesis'; expected peg, .* with max_acceleration_m_s2, as arc \d \(.+\)$"
    )
    with pytest.raises(CannotStart, match=refused):
        rehearse({"mission": "space_shuttle_sts121", "law": "peg_thesis"})


@pytest.mark.trial
def test_where_no_law_arrives_nothing_is_begun(ares, tmp_path):
    bag = tmp_path / "bag"
    mission = parameters("pegasus_haps", "optimal")["mission"]
    done = ares("fly", "--mission", mission, "--guidance", "optimal", "--bag", str(bag))
    assert done.returncode == 2
    assert done.stdout == ""
    assert re.fullmatch(
        r"ares: law is 'optimal', which misses the target when the mission is flown ahead \("
        r"(.* off by .*, allowed .*)+\); no other law reaches it: the burns of fixed length reach "
        r"the target without the last one, which leaves it no time to correct the flight; give it "
        r"a longer least length \(min_s\), or add payload\n",
        done.stderr,
    )
    assert not bag.exists()


@pytest.mark.trial
@pytest.mark.parametrize("law", one_in(3, ["peg", "igm", "optimal"]))
def test_a_last_burn_too_short_to_mend_the_place_meets_the_orbit(law):
    """Fly a last burn of 0.2 s, after a coast of more than an hour."""
    assert rehearse(parameters("f9_tli", law)) == ""

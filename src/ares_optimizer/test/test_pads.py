# SPDX-License-Identifier: Apache-2.0
"""Real launchers from the pad, from files that were written by the docs alone."""

from pathlib import Path

import pytest

from ares_models.mission import load_mission
from ares_optimizer.solution import Status
from ares_optimizer.solve import solve

PADS = Path(__file__).parents[3] / "benchmarks" / "pads"


def test_verniers_that_burn_on_alone_are_found_from_several_starts():
    # of the propellant of two free burns the first fit leaves most to the weak one
    found = solve(load_mission(PADS / "cz2f_shenzhou.yaml"), "auto")
    assert found.status == Status.CONVERGED
    assert found.m_f_kg == pytest.approx(15_358.118, rel=1e-6)


def test_a_coast_is_a_revolution_longer_only_where_that_pays():
    # to the north the longer coast is better by 0.03 kg on the first intervals, to the south it is
    # worse by 0.05 kg
    found = solve(load_mission(PADS / "alpha_sso.yaml"), "auto")
    assert found.status == Status.CONVERGED
    assert found.m_f_kg == pytest.approx(1_636.640, rel=1e-6)
    assert found.lengths_s[1] == pytest.approx(2831.3, abs=2.0)


@pytest.mark.trial
def test_a_load_that_a_weak_last_stage_cannot_bring_up_is_called_too_heavy():
    found = solve(load_mission(PADS / "electron_kick_sso.yaml"), "auto")
    assert found.status == Status.STALLED
    assert found.reason.endswith("with 120.5 kg less on the last stage there is one")

# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the bringup tests."""

import os
from pathlib import Path

import pytest

from ares_bringup.facts import MissionFacts
from ares_trials.testing.flights import made_up_mission
from ares_trials.testing.ros import ros_context, ros_domain

__all__ = ["facts", "fake_nodes", "ros_context", "ros_domain"]

HERE = Path(__file__).parent


@pytest.fixture
def facts() -> MissionFacts:
    """Make a mission with one arc and one jettison."""
    return made_up_mission()


@pytest.fixture
def fake_nodes(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Return the modules of the stand-ins, importable in children."""
    paths = [str(HERE), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path for path in paths if path))
    return {name: f"fake_{name}" for name in ("vehicle_sim", "guidance", "recorder")}

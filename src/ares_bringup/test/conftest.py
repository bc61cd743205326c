"""Fixtures of the bringup tests."""

import os
from pathlib import Path

import numpy as np
import pytest

from ares_bringup.summary import MissionFacts
from ares_models.arrays import TARGET, TARGET_RADIUS_SPEED_ANGLE_INCLINATION
from ares_node.testing import ros_context, ros_domain

__all__ = ["facts", "fake_nodes", "ros_context", "ros_domain"]

HERE = Path(__file__).parent


@pytest.fixture
def facts() -> MissionFacts:
    """A mission with one arc, one jettison and a circular target at 28.5 deg."""
    target = np.zeros(1, TARGET)
    target["kind"] = TARGET_RADIUS_SPEED_ANGLE_INCLINATION
    target["radius"] = 6.6e6
    target["speed"] = 7700.0
    target["inclination"] = np.radians(28.5)
    return MissionFacts(
        name="fake",
        title="Fake flight",
        mu=3.986004418e14,
        target=target[0],
        arcs=["burn"],
        stages=["only stage"],
        jettisons=["fairing"],
        fairing=0,
    )


@pytest.fixture
def fake_nodes(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Modules of the stand-ins, importable in children."""
    paths = [str(HERE), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path for path in paths if path))
    return {name: f"fake_{name}" for name in ("vehicle_sim", "guidance", "recorder")}

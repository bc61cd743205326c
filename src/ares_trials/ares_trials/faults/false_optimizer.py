# SPDX-License-Identifier: Apache-2.0
"""Answer wrongly in place of the optimizer: nonsense, or a plan for another vehicle.

python -m ares_trials.faults.false_optimizer --ros-args ... -p kind:=nonsense -p seed:=7
"""

import sys
from typing import Any

import numpy as np
from numpy.random import Generator

from ares_bringup.discovery import apply_discovery_settings
from ares_node.parameters import Parameter
from ares_node.run import run_node
from ares_optimizer.node import OptimizerNode
from ares_optimizer.worker import Job

NONSENSE, WRONG_PLAN, ANOTHER_VEHICLE = KINDS = ("nonsense", "wrong plan", "another vehicle")
#: Lists in an answer that guidance reads; valid values are neither all zero nor huge.
LISTS = ("arc_start_time", "arc_end_time", "arc_start_mass", "steering_direction")
PARAMETERS = (
    Parameter("kind", NONSENSE, "What is wrong.", choices=KINDS),
    Parameter("seed", 0, "Of what is drawn.", minimum=0),
)


class FalseOptimizer(OptimizerNode):
    """Solve the request and return a wrong answer."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(PARAMETERS, **kwargs)

    def _solve(self, job: Job) -> Any:
        if self.values["kind"] == ANOTHER_VEHICLE:
            # solve for the node's own mission
            job.request.mission = job.request.mission_text = job.request.method = ""
            job.request.use_nav_state = False
            return super()._solve(job)
        answer = super()._solve(job)
        change = spoil if self.values["kind"] == NONSENSE else distort
        change(answer, np.random.default_rng(self.values["seed"]))
        return answer


def spoil(answer: Any, rng: Generator) -> None:
    """Replace one list of an answer, or its cut-off, by values that are impossible in any plan."""
    name = str(rng.choice(LISTS))
    values = np.array(getattr(answer, name))
    kind = rng.integers(5)
    if kind == 0:
        values[rng.integers(len(values))] = np.nan
    elif kind == 1:
        values = values[:-1]
    elif kind == 2:
        values *= -1e30
    elif kind == 3:
        values[:] = 0.0
    else:
        answer.cutoff_time = float(rng.choice([-1.0, 0.0, -np.inf, np.nan]))
    setattr(answer, name, values.tolist())


def distort(answer: Any, rng: Generator) -> None:
    """Distort one list of an answer, and its cut-off, to that of a plausible but wrong plan."""
    name = str(rng.choice(LISTS))
    values = np.array(getattr(answer, name))
    kind = rng.integers(4)
    if kind == 0:
        values *= rng.uniform(0.3, 3.0)
    elif kind == 1:
        values = values[::-1]
    elif kind == 2:
        values = -values
    else:
        values += values * rng.normal(0.0, 0.3, values.shape)
    setattr(answer, name, values.tolist())
    answer.cutoff_time *= float(rng.uniform(0.5, 2.0))


if __name__ == "__main__":
    apply_discovery_settings()
    sys.exit(run_node(FalseOptimizer, name="optimizer"))

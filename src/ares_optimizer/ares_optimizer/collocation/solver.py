# SPDX-License-Identifier: Apache-2.0
"""Solve the sparse program by IPOPT (Waechter and Biegler, Math. Program. 106, 2006)."""

from dataclasses import dataclass
from typing import Any

import ipyopt
import numpy as np
from numpy.typing import NDArray

from ares_optimizer.collocation.transcription import CollocationProgram
from ares_optimizer.deadline import Deadline, Progress
from ares_optimizer.registry import COLLOCATION

Array = NDArray[np.float64]

SOLVED = 0
ACCEPTABLE = 1
LOCALLY_INFEASIBLE = 2
#: Status of IPOPT where it had too many iterations.
GIVEN_UP = -1

_OPTIONS: dict[str, Any] = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-9,
    "constr_viol_tol": 1e-9,
    "mu_strategy": "adaptive",
    # back to a monotone one it takes more iterations
    "adaptive_mu_globalization": "never-monotone-mode",
    # approximate minimum degree: 10 % faster on these chains than what is chosen by itself
    "mumps_pivot_order": 0,
    "fixed_variable_treatment": "make_parameter",
    "bound_relax_factor": 0.0,
    # steps that leave all constraints far behind are too long
    "theta_max_fact": 1.0,
}
#: Dual infeasibility beyond which a search fails, with steps that take seconds.
_DIVERGED = 1e9
#: Options of a warm start from a solution with its multipliers.
_WARM: dict[str, Any] = {
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-7,
    "warm_start_bound_frac": 1e-7,
    "warm_start_slack_bound_push": 1e-7,
    "warm_start_slack_bound_frac": 1e-7,
    "warm_start_mult_bound_push": 1e-7,
    "mu_init": 1e-7,
    "mu_strategy": "monotone",
}


@dataclass(frozen=True)
class StoppingPoint:
    """Hold the point at which the solver stopped.

    Attributes:
        x: shape (n,), variables.
        status: of IPOPT: SOLVED, ACCEPTABLE, LOCALLY_INFEASIBLE or another failure.
        multipliers: shape (m,), of the rows.
        at_lower, at_upper: shape (n,), multipliers of the bounds.
        violation: largest violation of a row or bound.
        iterations: of the solver.
        regularized: the Hessian was regularised in the last iteration: no strict minimum.
        unsettled: relative gain of mass by the next step, where the length of a coast was held near
            where it was, and its best is not known; 0: it was not held.
    """

    x: Array
    status: int
    multipliers: Array
    at_lower: Array
    at_upper: Array
    violation: float
    iterations: int
    regularized: bool
    unsettled: float = 0.0

    @property
    def solved(self) -> bool:
        """Return true if the first-order conditions are met."""
        return self.status in (SOLVED, ACCEPTABLE)


def solve_program(
    program: CollocationProgram,
    guess: Array | StoppingPoint,
    deadline: Deadline,
    mu: float | None = None,
    most: int = 200,
) -> StoppingPoint:
    """Solve a program from a guess.

    Args:
        program: the program.
        guess: shape (n,), or the solution of a program of the same pattern.
        deadline: time limit.
        mu: initial barrier parameter, for a guess near a solution; None: that of IPOPT.
        most: most iterations.
    """
    seen = {"iterations": 0, "regularization": 0.0}

    def watch(*iterate: float) -> bool:
        # from IPOPT: mode, iteration, objective, primal and dual infeasibility, ...
        seen["iterations"] = iterate[1]
        seen["regularization"] = iterate[7]
        deadline.report(
            Progress(COLLOCATION, int(iterate[1]), iterate[3], -iterate[2] * program.mass)
        )
        return not deadline.passed and iterate[4] < _DIVERGED

    chosen = _OPTIONS | {"max_iter": most}
    if program.phases["in_air"].any():
        # the mass at the end is a small share of that on the pad
        last = program.arrays.arcs[program.segments["arc"][-1]]
        chosen |= {"obj_scaling_factor": program.mass / float(last["stack_mass"])}
        chosen["theta_max_fact"] = 0.1
    if mu is not None:
        chosen |= {"mu_init": mu, "mu_strategy": "monotone"}
    if isinstance(guess, StoppingPoint):
        chosen |= _WARM
    problem = ipyopt.Problem(
        program.size,
        program.lower,
        program.upper,
        program.row_lower.size,
        program.row_lower,
        program.row_upper,
        program.jacobian_pattern,
        program.hessian_pattern,
        program.objective,
        program.gradient,
        program.rows,
        program.jacobian,
        program.hessian,
        intermediate_callback=watch,
        ipopt_options=chosen,
    )
    if isinstance(guess, StoppingPoint):
        x, multipliers = guess.x.copy(), guess.multipliers.copy()
        at_lower, at_upper = guess.at_lower.copy(), guess.at_upper.copy()
    else:
        x, multipliers = guess, np.zeros(program.row_lower.size)
        at_lower, at_upper = np.zeros(program.size), np.zeros(program.size)
    x = np.clip(x, program.lower, program.upper)
    x, _, status = problem.solve(x, mult_g=multipliers, mult_x_L=at_lower, mult_x_U=at_upper)
    rows = np.zeros(program.row_lower.size)
    program.rows(x, rows)
    violation = max(
        float(np.maximum(program.row_lower - rows, rows - program.row_upper).max(initial=0.0)),
        float(np.maximum(program.lower - x, x - program.upper).max(initial=0.0)),
    )
    return StoppingPoint(
        x,
        int(status),
        multipliers,
        at_lower,
        at_upper,
        violation,
        int(seen["iterations"]),
        seen["regularization"] > 0.0,
    )

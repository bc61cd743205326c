# SPDX-License-Identifier: Apache-2.0
"""Solve for the optimum by the indirect method, as the root of a two-point problem.

Costates follow Eqs. 3.15-3.21 under inverse-square or linear gravity, thrust is along lambda_v, the
interior condition is that of Eqs. 3.44-3.51 with the term that the print lacks, and reduced
transversality covers the free elements of the target. The kernels (``two_point/kernels``) solve;
this module converts a mission to their input, :mod:`.report` their result to a :class:`Solution`.
"""

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    MissionArrays,
)
from ares_optimizer.deadline import Deadline
from ares_optimizer.indirect.continuation import (
    from_high_limits,
    from_light_drops,
    from_linear_gravity,
    from_open_orbit,
    with_work_of,
)
from ares_optimizer.indirect.free_arcs import find_planned, lengths_of, refine_planned
from ares_optimizer.indirect.report import (
    _CAUSES,
    _SEARCH_STEP_S,
    Array,
    closed_form_notes,
    failure_cause,
    solution_of,
    verified,
)
from ares_optimizer.indirect.solver import (
    Guess,
    IndirectGuess,
    Root,
    TwoPointOptions,
    TwoPointSolver,
)
from ares_optimizer.obstacles import target_obstacle
from ares_optimizer.request import Request
from ares_optimizer.solution import (
    OUT_OF_TIME,
    OptimizerError,
    Solution,
    failed,
    infeasible,
)
from ares_optimizer.two_point.arrays import (
    RUNGE_KUTTA,
)

_LEAST_STEPS = 16  # in a flight


def solve_indirect(
    arrays: MissionArrays,
    start: NDArray[np.void],
    options: TwoPointOptions | None = None,
    *,
    guess: Guess = None,
    finish: bool = True,
    deadline: Deadline | None = None,
    verify: bool = True,
) -> Solution:
    """Compute the optimal ascent by the indirect method.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION, see :func:`navigation`.
        options: physical model and step sizes.
        guess: an :class:`IndirectGuess`, an earlier solution of this method, or its parameters,
            shape (7 + 2 drops,); None: the built-in guesses. When a guess leads to a root, the
            built-in guesses are tried too and the better root is kept.
        finish: under inverse-square gravity, refine the root of the closed form to the exact one
            by Runge-Kutta; the result of the closed form is in ``notes``.
        deadline: time limit; None: no limit.
        verify: fly the solution again and fill ``verification``, ``constraints``,
            ``trajectory`` and ``costates``. Without it ``converged`` is not verified.

    Returns:
        the solution with sampled ``costates``. ``hamiltonian_spread`` has one entry per piece of
        constant thrust and includes the mass costate term.

    Raises:
        OptimizerError: the guess or the mission is not valid for this method.
    """
    options = options or TwoPointOptions()
    method = "closed_form" if options.in_closed_form else "indirect"
    solver = TwoPointSolver(arrays, options, deadline)
    unknowns = _as_unknowns(guess, solver, start)
    began = time.perf_counter()
    cause = infeasible(target_obstacle(arrays))
    if cause is None and solver.deadline.passed:
        cause = OUT_OF_TIME
    if cause is not None:
        return failed(method, cause, solve_ms=_elapsed_ms(began))
    root = _find(solver, start, unknowns)
    notes: dict[str, float] = {}
    if root.converged and options.in_closed_form and options.gravity == "inverse_square":
        fine = TwoPointOptions(
            heating=options.heating, step_s=_final_step(options.step_s, start, root)
        )
        notes = closed_form_notes(solver, start, root, options)
        if finish:
            solver = TwoPointSolver(arrays, fine, solver.deadline)
            root = with_work_of(solver.solve(start, root.unknowns), root, 0)
    elapsed = _elapsed_ms(began)
    if not root.converged:
        return _not_found(method, solver, start, root, elapsed)
    solution = solution_of(method, solver, start, root, elapsed, notes)
    return verified(solver, start, root, solution) if verify else solution


def _not_found(
    method: str, solver: TwoPointSolver, start: NDArray[np.void], root: Root, elapsed: float
) -> Solution:
    """Return the solution of a search without a root, with its cause."""
    late = solver.deadline.passed
    cause = OUT_OF_TIME if late else failure_cause(solver, start, root)
    return replace(
        failed(method, cause, iterations=root.iterations),
        solve_ms=elapsed,
        parameters=root.unknowns,
        restarts=root.restarts,
    )


def refine_root(request: Request, unknowns: Array) -> Solution:
    """Refine unknowns near a root by Newton's method, without any other search.

    Args:
        request: request for the indirect method.
        unknowns: shape (n,), see :attr:`ares_optimizer.indirect.solver.Root.unknowns`.

    Raises:
        OptimizerError: the mission is not valid for this method.
    """
    began = time.perf_counter()
    start = request.state
    options = TwoPointOptions(heating=request.heating)
    solver = TwoPointSolver(request.arrays, options, request.deadline)
    _as_unknowns(unknowns, solver, start)
    if solver.plans_arcs(start):
        solver.hold_at_bounds(start, lengths_of(solver, start, unknowns))
    root = solver.solve(start, unknowns, restart=False)
    if root.converged:
        fine = _final_step(float(solver.options["step"][0]), start, root)
        if fine < float(solver.options["step"][0]):
            solver.options["step"] = fine
            root = with_work_of(solver.solve(start, root.unknowns, restart=False), root, 0)
    elapsed = _elapsed_ms(began)
    if not root.converged:
        return failed("indirect", _CAUSES[root.status], iterations=root.iterations)
    solution = solution_of("indirect", solver, start, root, elapsed, {})
    return verified(solver, start, root, solution) if request.verify else solution


def _elapsed_ms(began: float) -> float:
    """Return the time since ``began``, ms."""
    return 1e3 * (time.perf_counter() - began)


def _as_unknowns(guess: Guess, solver: TwoPointSolver, start: NDArray[np.void]) -> Array | None:
    if guess is None:
        return None
    size = solver.size(start)
    if isinstance(guess, IndirectGuess):
        known = guess.unknowns(solver.drops(start))
        # the solver sets the directions of held burns
        return np.concatenate((known, np.zeros(size - known.size)))
    values = guess if isinstance(guess, np.ndarray) else guess.parameters
    if values is None:
        raise OptimizerError("guess: the solution has no parameters")
    values = np.asarray(values, dtype=np.float64)
    if values.shape != (size,) or not np.isfinite(values).all():
        raise OptimizerError(
            f"guess: parameters have shape {values.shape}; expected ({size},), finite"
        )
    return values


def _find(solver: TwoPointSolver, start: NDArray[np.void], guess: Array | None) -> Root:
    """Find the best root on a coarse grid, by continuation where needed; refine it.

    The guess and the built-in guesses come first, then the continuations.
    """
    fine = float(solver.options["step"][0])
    if solver.options["propagator"][0] == RUNGE_KUTTA:
        solver.options["step"] = max(fine, _SEARCH_STEP_S)
    planned = solver.plans_arcs(start)
    if planned:
        root = find_planned(solver, start, guess)
    else:
        root = solver.solve(start, guess, thorough=True)
    if not root.converged and not planned:
        for ladder in (
            from_linear_gravity,
            from_light_drops,
            from_high_limits,
            from_open_orbit,
        ):
            if solver.deadline.passed:
                break
            further = ladder(solver, start)
            if further is not None and further.converged:
                root = with_work_of(further, root, 1)
                break
    solver.options["step"] = fine
    if not root.converged:
        return root
    if solver.options["propagator"][0] == RUNGE_KUTTA:
        solver.options["step"] = _final_step(fine, start, root)
    if planned:
        return with_work_of(refine_planned(solver, start, root), root, 0)
    return with_work_of(solver.solve(start, root.unknowns, restart=False), root, 0)


def _final_step(step_s: float, start: NDArray[np.void], root: Root) -> float:
    """Return the step of the final grid, s; a short flight gets _LEAST_STEPS too."""
    return min(step_s, float(root.cutoff_s - start["time"][0]) / _LEAST_STEPS)

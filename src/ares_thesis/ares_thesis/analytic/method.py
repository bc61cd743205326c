# SPDX-License-Identifier: Apache-2.0
"""Method `analytic` of the optimizer."""

from ares_optimizer.methods import MethodKind
from ares_optimizer.request import Heating, Request
from ares_optimizer.solution import OUT_OF_TIME, OptimizerError, Solution, UnfitMethod, failed
from ares_thesis.analytic.solve import METHOD, solve_analytic


def _solve(request: Request) -> Solution:
    if request.guess is not None:
        raise OptimizerError(f"guess is a {type(request.guess).__name__}; analytic takes none")
    if request.heating is not Heating.AT_JETTISON:
        raise UnfitMethod(f"heating is {str(request.heating)!r}; analytic takes at_jettison")
    if request.deadline.passed:
        return failed(METHOD, OUT_OF_TIME)
    return solve_analytic(
        request.arrays, state=request.state, verify=request.verify, deadline=request.deadline
    ).solution


ANALYTIC = MethodKind(METHOD, _solve)

# SPDX-License-Identifier: Apache-2.0
"""Measure the time to the default mission's optimum: ours, CasADi SX with IPOPT, Dymos with SLSQP.

All solve the 11-parameter problem with the same physics and the same density table, from the
same guesses, in a warm process. A peer that ends more than 1 kg from our optimum has failed.
"""

import argparse
import importlib.util
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from ascent_problem import FAIR, THESIS, Array, Ascent, guesses, load_ascent
from figures import Figures, keep_option
from rich.console import Console
from rich.table import Table

from ares_optimizer.direct.search import Guess
from ares_optimizer.solve import solve

AGREEMENT_KG = 1.0


@dataclass(frozen=True)
class Row:
    """Hold one line of the table.

    Attributes:
        name: of the solver.
        guess: name of the guess.
        median_ms: of the repeats.
        m_f_kg: final mass reached.
        iterations: number of iterations.
        success: as reported by the solver.
        note: remark.
        miss: errors of radius (m) and speed (m/s) of its answer flown by our kernels.
    """

    name: str
    guess: str
    median_ms: float
    m_f_kg: float
    iterations: int
    success: bool
    note: str = ""
    miss: tuple[float, float] | None = None


def median_ms(work: Callable[[], object], repeats: int) -> float:
    """Return the median wall time of ``repeats`` calls after one that does not count."""
    times = []
    for _ in range(repeats + 1):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return 1e3 * statistics.median(times[1:])


def ours(ascent: Ascent, name: str, guess: Guess, repeats: int) -> Row:
    """Time ``direct11`` through the public call, without the verification flight."""

    def work() -> object:
        return solve(ascent.mission, "direct11", guess=guess, verify=False)

    solution = solve(ascent.mission, "direct11", guess=guess, verify=False)
    return Row(
        "direct11",
        name,
        median_ms(work, repeats),
        solution.m_f_kg,
        solution.iterations,
        solution.converged,
        f"{solution.restarts} restarts",
        ascent.terminal_miss(solution.parameters),
    )


def own_start(ascent: Ascent, method: str, repeats: int) -> Row:
    """Time the search of one of our methods from its own start."""
    solutions = [solve(ascent.mission, method, verify=False) for _ in range(repeats + 1)][1:]
    last = solutions[-1]
    return Row(
        method,
        "own start",
        statistics.median(s.solve_ms for s in solutions),
        last.m_f_kg,
        last.iterations,
        last.converged,
        "search alone",
    )


def casadi_rows(
    ascent: Ascent,
    starts: dict[str, Array],
    repeats: int,
    optimum: float,
    grid: str,
    compiled: bool = False,
) -> list[Row]:
    """Time CasADi with every set of options; keep the fastest that reaches the optimum."""
    from casadi_ascent import BOXES, OPTIONS, STEPS, CasadiAscent, build

    begun = time.perf_counter()
    programme = build(ascent, STEPS[grid])
    graph_s = time.perf_counter() - begun
    best: dict[str, Row] = {}
    tried = [("adaptive", "wide")] if compiled else [(o, b) for o in OPTIONS for b in BOXES]
    reached = dict.fromkeys(starts, 0)
    for options, box in tried:
        solver = CasadiAscent(programme, options, box, compiled)
        for name, x in starts.items():
            attempt = solver.solve(x)
            mass = ascent.final_mass(100.0 * float(attempt.variables[10]))
            good = attempt.success and abs(mass - optimum) <= AGREEMENT_KG
            reached[name] += good
            times = [attempt.seconds]
            if good:
                times = [solver.solve(x).seconds for _ in range(repeats)]
            row = Row(
                "CasADi, compiled, IPOPT" if compiled else "CasADi SX, IPOPT",
                name,
                1e3 * statistics.median(times),
                mass,
                attempt.iterations,
                attempt.success,
                f"{grid}; {options}, {box}; build {graph_s + solver.build_s:.2f} s",
                ascent.terminal_miss(attempt.variables) if good else None,
            )
            old = best.get(name)
            if old is None or _order(row, optimum) < _order(old, optimum):
                best[name] = row
    return [
        Row(**{**row.__dict__, "note": f"{row.note}; {reached[name]}/{len(tried)} sets succeed"})
        for name, row in best.items()
    ]


def _order(row: Row, optimum: float) -> tuple[bool, float]:
    return not (row.success and abs(row.m_f_kg - optimum) <= AGREEMENT_KG), row.median_ms


def dymos_rows(ascent: Ascent, starts: dict[str, Array], repeats: int, optimum: float) -> list[Row]:
    """Time Dymos with Gauss-Lobatto and Radau; keep the fastest that reaches the optimum."""
    from dymos_ascent import GRIDS, DymosAscent

    best: dict[str, Row] = {}
    for label, (segments, order, radau) in GRIDS.items():
        solver = DymosAscent(ascent, segments, order, radau)
        solver.solve(starts["fair"])  # finds the colouring
        for name, x in starts.items():
            found, success, iterations, seconds = solver.solve(x)
            mass = ascent.final_mass(100.0 * float(found[10]))
            good = success and abs(mass - optimum) <= AGREEMENT_KG
            times = [seconds]
            if good:
                times += [solver.solve(x)[3] for _ in range(repeats - 1)]
            row = Row(
                "Dymos, SLSQP",
                name,
                1e3 * statistics.median(times),
                mass,
                iterations,
                success,
                label,
                ascent.terminal_miss(found) if good else None,
            )
            old = best.get(name)
            if old is None or _order(row, optimum) < _order(old, optimum):
                best[name] = row
    return list(best.values())


def show(rows: list[Row], reference: dict[str, float], optimum: float) -> None:
    """Print the table."""
    table = Table(title="Time to the optimum, warm process")
    for column in ("solver", "guess"):
        table.add_column(column)
    for column in ("median ms", "peer/ours", "m_f kg", "iterations", "miss m, m/s"):
        table.add_column(column, justify="right")
    table.add_column("reached")
    table.add_column("note")
    for row in rows:
        failed, _ = _order(row, optimum)
        ratio = row.median_ms / reference[row.guess] if row.guess in reference else 0.0
        table.add_row(
            row.name,
            row.guess,
            f"{row.median_ms:.2f}",
            f"{ratio:.1f}" if ratio and not failed else "",
            f"{row.m_f_kg:,.2f}",
            str(row.iterations),
            f"{row.miss[0]:.1f}, {row.miss[1]:.3f}" if row.miss else "",
            "FAILED" if failed else "yes",
            row.note,
        )
    Console(width=150).print(table)


def keep(rows: list[Row], optimum: float) -> None:
    """Write the medians of the solvers that reached the optimum."""
    figures = Figures(__file__, "Time to the optimum of ares_v, warm process, medians.")
    for row in rows:
        if not _order(row, optimum)[0]:
            grid = f", {row.note.partition(';')[0]}" if ";" in row.note else ""
            figures.add(f"{row.name}, {row.guess}{grid}", row.median_ms, "ms")
    figures.keep()


def main() -> None:
    """Run all solvers that are installed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=51, help="of ours and CasADi's solutions")
    parser.add_argument("--dymos-repeats", type=int, default=3)
    parser.add_argument("--no-dymos", action="store_true")
    parser.add_argument(
        "--compiled", action="store_true", help="also CasADi's functions compiled by gcc: minutes"
    )
    keep_option(parser)
    options = parser.parse_args()
    ascent = load_ascent()
    begins = guesses(ascent)
    starts = {name: ascent.variables(guess) for name, guess in begins.items()}
    rows = [ours(ascent, name, guess, options.repeats) for name, guess in begins.items()]
    reference = {row.guess: row.median_ms for row in rows}
    optimum = rows[0].m_f_kg
    rows += [own_start(ascent, method, options.repeats) for method in ("direct11", "indirect")]
    print(f"fair guess: {FAIR}\nthesis' guess: {THESIS}")
    missing = [name for name in ("casadi", "dymos") if importlib.util.find_spec(name) is None]
    if missing:
        print(f"not installed, left out: {', '.join(missing)} (requirements/bench.txt)")
    if "casadi" not in missing:
        for grid in ("coarse", "as fine as ours"):
            rows += casadi_rows(ascent, starts, options.repeats, optimum, grid)
        if options.compiled:
            rows += casadi_rows(ascent, starts, options.repeats, optimum, "coarse", compiled=True)
    if "dymos" not in missing and not options.no_dymos:
        rows += dymos_rows(ascent, starts, options.dymos_repeats, optimum)
    show(rows, reference, optimum)
    if options.keep:
        keep(rows, optimum)


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Select the most important numbers."""

from ares_studies.pages.parts import Column, PageTable, Role, Row, number, word
from ares_thesis.reproduce import printed
from ares_thesis.reproduce.analytic_tables import parts
from ares_thesis.reproduce.model import Dot
from ares_thesis.reproduce.sources import ALL_PINS, SETTLED, Sources


def headline(s: Sources) -> PageTable:
    """Tabulate optimum, PEG, jump condition and start: thesis and here."""
    optimum = printed.values("table-4.1")["thesis"]
    peg = printed.values("table-6.7")
    flown = s.peg.flight.plant
    cold, warm = s.first_solution(), s.first_solution(s.analytic_alone.solution)
    table_6_1 = printed.values("table-6.1")["optimum"]
    table_6_3 = printed.values("table-6.3")[0]
    part_one, _ = parts(s.analytic_improved)
    rows = (
        Row(
            "Optimum, final mass, kg",
            (number(optimum["final_mass_kg"], 0), number(s.optimum.m_f_kg, 1)),
            "Proven by costates and by an independent integrator; no cause is known for the "
            "difference [E2].",
        ),
        Row(
            "PEG, closed loop, final mass, kg",
            (number(peg["final_mass_kg"], 0), number(float(flown["mass"]), 1)),
            "Multi-stage PEG with one target, at cut-off. The thesis' own PEG, flown here, arrives "
            f"with {s.pins[ALL_PINS].m_f_kg:,.1f} kg, and with {s.pins[SETTLED].m_f_kg:,.1f} kg if "
            "every cycle is iterated until it has settled [E29].",
        ),
        Row(
            "Jump condition at the jettison",
            (word("does not converge"), number(s.jump.m_f_kg, 1)),
            f"Within {s.facts['jump_loss_kg']:.2f} kg of the optimum, with three unknowns fewer "
            "[E19, E26].",
        ),
        Row(
            "PEG, start from the navigation state",
            (word("does not converge"), word(f"{cold} iterations")),
            f"From the analytic solution it takes {warm} and flies the same flight [E27].",
        ),
        Row(
            "Analytic part one, T_go off its optimum, s",
            (
                number(table_6_3["time_to_go_s"] - table_6_1["time_to_go_s"], 2, signed=True),
                number(part_one.time_to_go_s - (s.optimum.t_plf_s - s.staging_s), 2, signed=True),
            ),
            f"In {part_one.iterations} iterations, in closed form throughout, with better "
            "polynomials; see Table 6.2 for those of the thesis.",
        ),
    )
    return PageTable((Column("thesis", "thesis"), Column("here", "here")), rows)


def masses(s: Sources) -> tuple[Dot, ...]:
    """Return the final masses, smallest first."""
    table = printed.values("table-4.1")
    peg = printed.values("table-6.7")["final_mass_kg"]
    dots: list[tuple[str, Role, float, int]] = [
        ("OTIS", "otis", table["otis"]["final_mass_kg"], 0),
        ("thesis, PEG", "thesis", peg, 0),
        ("thesis, optimum", "thesis", table["thesis"]["final_mass_kg"], 0),
        ("thesis' PEG, flown here", "third", s.pins[ALL_PINS].m_f_kg, 1),
        ("thesis' PEG, settled", "third", s.pins[SETTLED].m_f_kg, 1),
        ("multi-stage PEG", "here", float(s.peg.flight.plant["mass"]), 1),
        ("jump condition", "here", s.jump.m_f_kg, 1),
        ("optimum", "here", s.optimum.m_f_kg, 1),
        ("optimum, heating ignored", "other", s.unheated.m_f_kg, 1),
    ]
    dots.sort(key=lambda dot: dot[2])
    return tuple(Dot(name, role, number(value, digits)) for name, role, value, digits in dots)

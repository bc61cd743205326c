"""The few numbers that matter most."""

from ares_studies.reproduce import printed
from ares_studies.reproduce.model import Column, Dot, Role, Row, Table, number, word
from ares_studies.reproduce.sources import Sources


def headline(s: Sources) -> Table:
    """Optimum, PEG, jump condition and start: thesis and here."""
    optimum = printed.values("table-4.1")["thesis"]
    peg = printed.values("table-6.7")
    flown = s.peg.flight.plant
    start = s.first_solution
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
            "The fairing is a stage boundary and there is one target, at cut-off.",
        ),
        Row(
            "Jump condition at the jettison",
            (word("does not converge"), number(s.jump.m_f_kg, 1)),
            f"Within {s.facts['jump_loss_kg']:.2f} kg of the optimum, with three unknowns fewer "
            "[E19, E26].",
        ),
        Row(
            "PEG, start from the navigation state",
            (word("does not converge"), word(f"{start} iterations")),
            "What stood in the way were the targets at staging and jettison [E27].",
        ),
    )
    return Table((Column("thesis", "thesis"), Column("here", "here")), rows)


def masses(s: Sources) -> tuple[Dot, ...]:
    """Final masses, least first."""
    table = printed.values("table-4.1")
    peg = printed.values("table-6.7")["final_mass_kg"]
    dots: list[tuple[str, Role, float, int]] = [
        ("OTIS", "otis", table["otis"]["final_mass_kg"], 0),
        ("thesis, PEG", "thesis", peg, 0),
        ("thesis, optimum", "thesis", table["thesis"]["final_mass_kg"], 0),
        ("multi-stage PEG", "here", float(s.peg.flight.plant["mass"]), 1),
        ("jump condition", "here", s.jump.m_f_kg, 1),
        ("optimum", "here", s.optimum.m_f_kg, 1),
        ("optimum, heating ignored", "other", s.unheated.m_f_kg, 1),
    ]
    dots.sort(key=lambda dot: dot[2])
    return tuple(Dot(name, role, number(value, digits)) for name, role, value, digits in dots)

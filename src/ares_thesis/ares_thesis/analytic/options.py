# SPDX-License-Identifier: Apache-2.0
"""Define the options of the analytic method: chapter 5 as printed, or improved."""

from dataclasses import dataclass
from typing import Literal

from ares_optimizer.solution import OptimizerError
from ares_thesis.analytic import arrays

POSITION_INTEGRALS = {
    "exact": arrays.EXACT,
    "trapezoid": arrays.TRAPEZOID,
    "quadratic": arrays.QUADRATIC_SPEED,
}
STEERINGS = {"local": arrays.LOCAL, "inertial": arrays.INERTIAL, "primer": arrays.PRIMER}
JETTISON_TARGETS = ("mission", "optimizer")

_MOST_STEPS = 100_000


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise OptimizerError(f"{name} is {value!r}; expected one of {', '.join(choices)}")


@dataclass(frozen=True)
class ThesisGuess:
    """Hold the guess of Table 6.1 of the thesis, with the angle assumed at the start."""

    theta_0_deg: float = 27.0
    theta_plf_deg: float = 17.0
    gamma_staging_deg: float = 5.0
    time_to_go_s: float = 100.0


@dataclass(frozen=True)
class Profile:
    """Select the polynomials and the conditions that determine them.

    Attributes:
        sine: ``printed``: sin(gamma) quadratic, linear, quadratic (5.8, 5.9); ``cubic``: with
            the slope of 5.6 at both ends of every burn; ``fitted``: the cubic plus a correction
            at three nodes between, cos(alpha) through all five.
        steering: ``local``: tan(theta) linear against the local horizon (5.16);
            ``inertial``: against the horizon at the start of the part; ``primer``: with the
            curvature of the primer vector by the gravity gradient.
        solved: true: gamma follows from the motion, and both steering angles are iterated; false,
            as printed: theta at the start is assumed, and gamma at staging is an unknown.
        mean_gravity: gravity of a burn from the radii at both ends, not at its start.
    """

    sine: Literal["printed", "cubic", "fitted"]
    steering: Literal["local", "inertial", "primer"]
    solved: bool
    mean_gravity: bool

    def __post_init__(self) -> None:
        _check_choice("sine", self.sine, ("printed", "cubic", "fitted"))
        _check_choice("steering", self.steering, tuple(STEERINGS))
        if not self.solved and (self.sine, self.steering) != ("printed", "local"):
            raise OptimizerError(
                f"solved is False with sine {self.sine!r} and steering {self.steering!r}; "
                "expected 'printed' and 'local', for which the thesis has equations"
            )


PROFILES = {
    "thesis": Profile("printed", "local", solved=False, mean_gravity=False),
    "improved": Profile("fitted", "primer", solved=True, mean_gravity=True),
}


@dataclass(frozen=True)
class AnalyticOptions:
    """Select the options of the analytic method.

    Attributes:
        profile: ``thesis``, ``improved`` or another :class:`Profile`.
        position_integral: ``exact``; ``trapezoid``; ``quadratic``, the quadratic speed of 5.25.
        steps: N1 and N2 of the trapezoid: before staging and after the jettison; between.
        jettison_target: ``mission``: the state at the jettison of the shortest projected flight
            within the heating limit; ``optimizer``: radius, speed and flight-path angle of the
            optimum at its jettison, as in the thesis.
        step_scale: alpha_s of Eq. 5.31.
        guess: first guess of a profile that is not ``solved``.
    """

    profile: str | Profile = "improved"
    position_integral: str = "exact"
    steps: tuple[int, int] = (100, 100)
    jettison_target: str = "mission"
    step_scale: float = 1.0
    guess: ThesisGuess = ThesisGuess()

    def __post_init__(self) -> None:
        if isinstance(self.profile, str):
            _check_choice("profile", self.profile, tuple(PROFILES))
        _check_choice("position_integral", self.position_integral, tuple(POSITION_INTEGRALS))
        _check_choice("jettison_target", self.jettison_target, JETTISON_TARGETS)
        for n in self.steps:
            if not 1 <= n <= _MOST_STEPS:
                raise OptimizerError(
                    f"steps is {self.steps}; expected two integers from 1 to {_MOST_STEPS:,}"
                )
        if not 0.0 < self.step_scale <= 1.0:
            raise OptimizerError(
                f"step_scale is {self.step_scale:g}; expected more than 0 and at most 1"
            )

    @property
    def ties(self) -> Profile:
        """Return the profile as an object."""
        return self.profile if isinstance(self.profile, Profile) else PROFILES[self.profile]

# SPDX-License-Identifier: Apache-2.0
"""A guidance law as an object: navigation states in, steering out."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance import arrays as layout
from ares_guidance.kernels.plans.legs import step_by_legs
from ares_guidance.kernels.plans.programme import flies_programme
from ares_guidance.kernels.prediction.segments import TABLE_PIECES
from ares_guidance.own_law import one_line_each
from ares_guidance.plan import ArcPlan, plan_of
from ares_guidance.programme import Programme
from ares_guidance.settings import LawSettings
from ares_guidance.trajectory import OfflineTrajectory
from ares_models.arrays import BURN, HEATING_LIMIT, MissionArrays
from ares_models.jit import specialised
from ares_models.mission_target import leaves_end_free
from ares_models.plans import coasts_long, flies_in_air, leaves_arcs_free, needs_plan

#: Propellant by which a law may differ from the plan at the hand-over, as a fraction of the mass at
#: the end: a law that needs more is lost, one that believes to need less finds its way.
SAME_END = 0.005
MOST_EARLY = 0.1
#: Time to a second answer, s.
_NEXT_S = 1e-3
#: Least cosine of the angle between the law's direction and the planned one at the hand-over.
MOST_ASIDE = math.cos(math.radians(30.0))
#: Share of the planned velocity from which a law must find its way too.
SLOWER = 1.0 - 1e-4


@dataclass(frozen=True)
class LawKind:
    """Describe a guidance law; a package registers one under `ares_guidance.laws`.

    Attributes:
        name: by which a user selects it.
        code: `law` of GuidanceStatus; 128 or more for laws of other packages.
        step: kernel with the arguments of `kernels.cycle.guidance_step`; for a law with a memory of
            its own, a record of it is the last argument.
        build: constructor of the law from arrays and settings; None: `Law`.
        trajectory_method: method of the optimizer that solves the trajectory without which the law
            cannot start; "": the navigation state is enough.
        holds_attitude: it can aim burns in held attitude; the shared cycle does, by PEG.
        meets_place: it can meet a target that names both argument of perigee and true anomaly.
        flies_boost: kernel that answers in the air, with the arguments and result of
            `kernels.plans.programme.flies_programme`.
        memory: dtype of the law's own memory between navigation states, besides GUIDANCE_STATE.
            It is zero at the start of a flight; when navigation is acquired anew, it stays and
            the phase in GUIDANCE_STATE is PHASE_IDLE.
    """

    name: str
    code: int
    step: Callable[..., None]
    build: "Callable[[MissionArrays, LawSettings | None], Law] | None" = None
    trajectory_method: str = ""
    holds_attitude: bool = False
    meets_place: bool = False
    flies_boost: Callable[..., bool] = flies_programme
    memory: np.dtype[Any] = layout.NO_MEMORY

    @property
    def needs_trajectory(self) -> bool:
        """Return whether the law cannot start from the navigation state alone."""
        return self.trajectory_method != ""


#: The law of the shared cycle without any replacement.
PEG = LawKind("peg", layout.LAW_PEG, step_by_legs, holds_attitude=True)


def law_of_seek(name: str, code: int, seek: Callable[..., tuple[int, bool]]) -> LawKind:
    """Build a law from a search of its own, run in the shared cycle.

    Args:
        name: of the law.
        code: `law` of GuidanceStatus.
        seek: kernel with the arguments and results of `kernels.laws.convergence.seek`.
    """
    cycle = specialised("ares_guidance.kernels.cycle", f"of_{name}", seek=seek)
    legs = specialised(
        "ares_guidance.kernels.plans.legs", f"of_{name}", guidance_step=cycle.guidance_step
    )
    return LawKind(name, code, legs.step_by_legs, holds_attitude=True)


def law_of_pass(name: str, code: int, iterate: Callable[..., tuple[float, float, bool]]) -> LawKind:
    """Build a law from a pass of its own, iterated to convergence in the shared cycle.

    Args:
        name: of the law.
        code: `law` of GuidanceStatus.
        iterate: kernel with the arguments and results of `kernels.laws.peg.iterate`.
    """
    convergence = specialised(
        "ares_guidance.kernels.laws.convergence", f"of_{name}", iterate=iterate, LAW=code
    )
    return law_of_seek(name, code, convergence.seek)


def name_free_arcs(arrays: MissionArrays) -> str:
    """Name the free arcs before the last, such as "arc 1 and arc 2"."""
    free = np.flatnonzero(np.isinf(arrays.arcs["duration"][:-1]))
    return " and ".join(f"arc {k}" for k in free)


def name_what_is_free(arrays: MissionArrays) -> str:
    """Name the quantities that a plan fixes: free arcs, the place on the target orbit."""
    parts = [name_free_arcs(arrays)] * leaves_arcs_free(arrays.arcs)
    parts += ["the burn before a long coast"] * coasts_long(arrays.arcs)
    parts += ["the attitude in the air"] * flies_in_air(arrays.arcs)
    parts += ["the place on the target's orbit"] * leaves_end_free(arrays.target[0])
    return " and ".join(parts)


def why_no_plan(law: str, arrays: MissionArrays, reason: str) -> str:
    """Build the message of a flight that is refused for lack of a plan, with advice; one line.

    Args:
        law: name of the law.
        arrays: the mission.
        reason: given by the optimizer.
    """
    if not needs_plan(arrays.arcs, arrays.target[0], arrays.environment[0]):
        return (
            f"law is {law!r}, which finds no steering from the start of the mission to its target "
            f"without a plan, and there is none: {reason}"
        )
    bounds = "other bounds (min_s, max_s), " * leaves_arcs_free(arrays.arcs)
    return (
        f"no plan was found: {reason}; law {law} needs one for what the mission leaves free, "
        f"{name_what_is_free(arrays)}; {bounds}less payload or another method of `ares optimize` "
        "may give one"
    )


@cache
def guarded(kind: LawKind) -> Callable[..., None]:
    """Return the step of a law between navigation gate and monitors, a `guarded_step`."""
    place = "guidance_step" if kind.memory == layout.NO_MEMORY else "step_law"
    step: Callable[..., None] = specialised(
        "ares_guidance.kernels.guarded",
        f"of_{kind.name}",
        flies_programme=kind.flies_boost,
        **{place: kind.step},
    ).guarded_step
    return step


@cache
def _entry(kind: LawKind) -> Callable[[MissionArrays, layout.OnboardArrays], None]:
    """Return the step of a law for calls from Python."""
    entry: Callable[[MissionArrays, layout.OnboardArrays], None] = specialised(
        "ares_guidance.kernels.entry", f"of_{kind.name}", guarded_step=guarded(kind)
    ).answer
    return one_line_each(kind.name)(entry)


class Law:
    """Hold a guidance law and its memory between navigation states.

    Attributes:
        kind: which law.
        asks: it flies by a plan though the mission needs none; see `laws.asks_for_plan`.
        onboard: arrays of guidance for the flight; callers only read them.
    """

    asks = False

    def __init__(
        self, arrays: MissionArrays, settings: LawSettings | None = None, kind: LawKind = PEG
    ) -> None:
        """Prepare for the first navigation state.

        Args:
            arrays: the mission as guidance believes it.
            settings: cycle and gates.
            kind: which law.

        Raises:
            ValueError: the mission has more arcs and jettisons than the law has room for, or a
                burn that it cannot fly.
        """
        arcs = arrays.arcs
        throttled = (arcs["kind"] == BURN) & np.isfinite(arcs["max_acceleration"])
        parts = len(arcs) + 2 * int(np.sum(throttled)) + len(arrays.jettisons)
        parts += (TABLE_PIECES - 1) * int(np.sum(arcs["tabled"]))
        if parts > layout.MAX_SEGMENTS:
            raise ValueError(
                f"mission has {parts} arcs and jettisons, throttled burns counted thrice, "
                f"solid motors {TABLE_PIECES} times; guidance has room for {layout.MAX_SEGMENTS}"
            )
        if np.any(arcs["held"]) and not kind.holds_attitude:
            raise ValueError(
                f"law is {kind.name!r}; expected {PEG.name}, which flies burns with attitude: "
                f"held, as arc {int(np.argmax(arcs['held']))} is"
            )
        replans = settings is not None and settings.boost_steering == "replan"
        if replans and kind.flies_boost is flies_programme:
            raise ValueError(
                f"boost_steering is 'replan' and law is {kind.name!r}; expected law optimal, which "
                "solves the flight through the air"
            )
        self._arrays = arrays
        self._needs_plan = needs_plan(arrays.arcs, arrays.target[0], arrays.environment[0])
        self.kind = kind
        self._answer = _entry(kind)
        self._settings = (settings or LawSettings()).record()
        self._arc_plan: ArcPlan | None = None
        self._programme: Programme | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the flight, and a plan that was made in flight."""
        if self._arc_plan is not None and self._arc_plan.resumes:
            self._arc_plan = self._programme = None
        self._begin()

    def _begin(self) -> None:
        """Initialize the arrays of guidance for a flight, with the plan."""
        self.onboard = layout.blank_onboard(self._settings, self.kind.memory)
        if self._arc_plan is not None:
            self.state["plan"] = self._arc_plan.record(self._arrays, not self.kind.meets_place)[0]
        if self._arc_plan is not None and self._programme is not None:
            self.state["programme"] = self._programme.record()[0]

    def _choose_programme(self, plan: ArcPlan) -> Programme | None:
        """Return the programme after which the law takes over.

        It is the first if the law then finds a way to the planned end; else that from which on the
        law predicts this end well, to the end of the leg, or to its last burn if the law takes over
        before that; else the first that leaves a way.
        """
        left = self._past_surplus(plan)
        if not left or not len(left[0].time):
            return None
        first = left[0]
        if self._finds_way(*self._excess(plan, first)):
            return first
        chosen, way, leg = None, first, -1
        for programme in left[1:]:
            ends, excess = self._excess(plan, programme)
            if chosen is not None and ends != leg:
                break
            leg = ends
            if way is first and self._finds_way(ends, excess):
                way = programme
            began = chosen is not None and chosen.state["arc"][0] < ends
            if abs(excess) <= SAME_END:
                chosen = chosen or programme
            elif not (began and programme.state["arc"][0] == ends):
                chosen = None
        return chosen or way

    def _past_surplus(self, plan: ArcPlan) -> tuple[Programme, ...]:
        """Return the programmes past all burns of fixed length that the law cannot end a leg with.

        Such a burn gives more than the leg takes, and the law finds no way to waste it.
        """
        left = plan.programmes
        for k in np.flatnonzero(np.isfinite(self._arrays.arcs["duration"][:-1])):
            begun = next((p for p in left if p.state["arc"][0] == k), None)
            if begun is None or not self._burns(begun):
                continue
            ends, excess = self._excess(plan, begun)
            later = tuple(p for p in left if p.state["arc"][0] > k and self._burns(p))
            if ends == k and later and not self._finds_way(ends, excess):
                left = later
        return left

    def _burns(self, programme: Programme) -> bool:
        """Return whether the law takes over in a burn."""
        return bool(self._arrays.arcs["kind"][programme.state["arc"][0]] == BURN)

    def _finds_way(self, last: int, excess: float) -> bool:
        """Return whether a law that believes in such an excess finds its way, see :meth:`_excess`.

        A leg that ends by the clock leaves nothing over: it must be wasted.
        """
        most_early = MOST_EARLY if np.isinf(self._arrays.arcs["duration"][last]) else SAME_END
        return -most_early <= excess <= SAME_END

    def _excess(self, plan: ArcPlan, programme: Programme) -> tuple[int, float]:
        """Return the leg after a programme, and how much more the law believes that it burns.

        A law that finds its way from the planned state alone, and not from one beside it, finds
        none: a solid motor that must give all it has meets the planned end exactly, or not at all.

        Args:
            plan: of the mission.
            programme: after which the law takes over, at the planned state.

        Returns:
            index of the last arc of the leg; propellant beyond the plan as a fraction of the mass
            at the end of the leg, inf if the law finds no steering.
        """
        for share in (SLOWER, 1.0):
            last, late = self._first_answer(plan, programme, share)
            if math.isinf(late):
                return last, late
        if self._turns_away(programme):
            return last, math.inf
        burnt_kg = late * float(self._arrays.arcs["mass_flow"][last])
        return last, burnt_kg / plan.arc_ends_kg[last] - self._unspent()

    def _turns_away(self, programme: Programme) -> bool:
        """Return whether the law begins in another direction than planned: with another flight."""
        if programme.next_thrust is None:
            return False
        lit, planned = programme.next_thrust
        answer = self.steering[0]
        begun = answer["direction"] + (lit - answer["reference_time"]) * answer["direction_rate"]
        return bool(planned @ begun < MOST_ASIDE * np.linalg.norm(begun))

    def _unspent(self) -> float:
        """Return the delta-V that the law does not know how to spend, over the exhaust velocity."""
        state, solution = self.state, self.state["solution"]
        segments = state["segments"][: state["segment_count"]]
        if state["turn"]["held"] > 0.0 or not len(segments):
            return 0.0
        burn = np.clip(solution["time_to_go"] - segments["start"], 0.0, segments["duration"])
        throttled = segments["acceleration"] * burn
        gains = -segments["exhaust_velocity"] * np.log1p(-burn / segments["tau"])
        gained = float(np.where(throttled > 0.0, throttled, gains).sum())
        speed = float(np.linalg.norm(solution["velocity_to_go"]))
        return max(0.0, gained - speed) / float(segments["exhaust_velocity"][-1])

    def _first_answer(self, plan: ArcPlan, programme: Programme, share: float) -> tuple[int, float]:
        """Return the leg after a programme, and how much later than planned the law ends it, s.

        Args:
            plan, programme: as in :meth:`_excess`.
            share: of the planned velocity at which the law begins.
        """
        self._programme = None
        self._begin()
        self.onboard.navigation[0] = programme.state[0]
        self.onboard.navigation[0]["velocity"] *= share
        self._answer(self._arrays, self.onboard)
        # the first cycle takes the time of a heating jettison from the plan, the next its own
        navigation = self.onboard.navigation[0]
        navigation["time"] += _NEXT_S
        navigation["position"] += _NEXT_S * navigation["velocity"]
        self.state["next_cycle_time"] = self.state["leg"]["cycle_time"] = navigation["time"]
        self._answer(self._arrays, self.onboard)
        by_legs = bool(self.state["plan"]["made"]) and int(self.state["leg"]["count"]) > 0
        last = int(self.state["leg"]["count"]) - 1 if by_legs else len(self._arrays.arcs) - 1
        answer = self.state["leg"]["steering"] if by_legs else self.steering[0]
        late = float(answer["cutoff_time"]) - plan.arc_ends_s[last]
        sound = self.phase > layout.PHASE_CONVERGING and self.state["error"] == layout.ERROR_NONE
        return last, late if sound and math.isfinite(late) else math.inf

    @property
    def by_plan(self) -> bool:
        """Return whether the law flies by a plan."""
        return self.asks or self._needs_plan

    @property
    def plan(self) -> ArcPlan | None:
        """Return the plan that the law flies by; None: it has none."""
        return self._arc_plan

    @property
    def lacks_plan(self) -> bool:
        """Return whether the law flies by a plan and has none."""
        return self.by_plan and self._arc_plan is None

    def check_plan(self) -> None:
        """Check that the law has a plan if it flies by one.

        Raises:
            ValueError: there is none; one line.
        """
        if self.lacks_plan:
            free = "" if self.asks else f" of what is free, {name_what_is_free(self._arrays)}"
            raise ValueError(
                f"law is {self.kind.name!r}, which needs a plan{free}; "
                "use --initial-guess optimizer"
            )

    def follow_arcs(self, plan: ArcPlan) -> None:
        """Fly by a plan; one that was made in flight holds for this flight only.

        Raises:
            ValueError: the plan is not of this mission.
        """
        plan.record(self._arrays)
        self._arc_plan = plan
        self._programme = self._choose_programme(plan)
        self._begin()

    def seed(
        self, velocity_to_go: NDArray[np.float64], jettison_times: NDArray[np.float64]
    ) -> None:
        """Start the next flight from a guess instead of the scalar impulse.

        Args:
            velocity_to_go: shape (3,), m/s, finite and not zero.
            jettison_times: one per jettison of the mission, mission elapsed time, s; inf for
                one that is not planned.

        Raises:
            ValueError: the guess is not usable.
        """
        speed = float(np.linalg.norm(velocity_to_go))
        if not (math.isfinite(speed) and speed > 0.0):
            raise ValueError(f"velocity_to_go is {velocity_to_go}; expected finite, not zero")
        if np.any(np.isnan(jettison_times)) or len(jettison_times) != len(self._arrays.jettisons):
            raise ValueError(
                f"jettison_times is {jettison_times}; expected {len(self._arrays.jettisons)} times"
            )
        self.reset()
        solution = self.state["solution"]
        solution["velocity_to_go"] = velocity_to_go
        solution["jettison_time"] = math.inf
        solution["jettison_time"][: len(jettison_times)] = jettison_times
        self.state["seeded"] = 1

    def start_from(self, trajectory: OfflineTrajectory) -> None:
        """Start the next flight from an optimized trajectory.

        Args:
            trajectory: begins at the present state.

        Raises:
            ValueError: the trajectory is not usable.
        """
        planned = np.full(len(self._arrays.jettisons), math.inf)
        if self.by_plan:
            self.follow_arcs(plan_of(trajectory, self._arrays))
            return
        if math.isfinite(trajectory.jettison_time):
            heating = self._arrays.jettisons["criterion"] == HEATING_LIMIT
            planned[heating] = trajectory.jettison_time
        self.seed(trajectory.velocity_to_go(), planned)

    @property
    def state(self) -> Any:
        """Return the guidance state, record GUIDANCE_STATE."""
        return self.onboard.state[0]

    @property
    def memory(self) -> Any:
        """The law's own memory, a record."""
        return self.onboard.memory[0]

    @property
    def steering(self) -> NDArray[np.void]:
        """Return the present answer, shape (1,), dtype STEERING."""
        return self.onboard.steering

    @property
    def phase(self) -> int:
        """Return the phase of guidance, PHASE_*: the law's, or PHASE_BOOST in the air."""
        return layout.PHASE_BOOST if self.state["programme"]["active"] else int(self.state["phase"])

    @property
    def cycle(self) -> int:
        """Return the number of guidance cycles, of the programme and of the law."""
        return int(self.state["programme"]["cycle"]) + int(self.state["cycle"])

    @property
    def steered(self) -> bool:
        """Return whether the answer holds a thrust direction and may be flown."""
        return self.phase != layout.PHASE_IDLE

    @property
    def converged(self) -> bool:
        """Return whether the answer is a converged solution, or steering held from one."""
        return self.phase > layout.PHASE_CONVERGING

    def step(self, nav: Any) -> bool:
        """Answer one navigation state.

        Args:
            nav: record NAVIGATION.

        Returns:
            whether a guidance cycle was due; `steering` is the answer either way.

        Raises:
            ValueError: the mission needs a plan, and there is none, or the law fails; one line.
        """
        self.check_plan()
        before = self.cycle
        self.onboard.navigation[0] = nav
        self._answer(self._arrays, self.onboard)
        return self.cycle != before

# SPDX-License-Identifier: Apache-2.0
"""Plan launches from the pad by the peer of `casadi_pad.py`, from ten starts that are flown.

From the vertical the pitch falls as a power of time, in planes that lead north and south. With a
free coast the ascent is solved alone first, to a low circle and to a low perigee with the target's
apogee; a coast and a burn along the velocity follow. The best is solved again on finer intervals,
until its mass no longer changes.
"""

import argparse
import math
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from casadi_pad import Array, Flight, Launch, Program
from scipy.integrate import solve_ivp

from ares_models.arrays import HEATING_LIMIT
from ares_models.mission import Mission, load_mission

STARTS = 10
#: Exponents of the pitch over time, and pitches at the end, deg.
EXPONENTS = (0.3, 0.45, 0.6, 0.8, 1.1)
LAST_PITCHES = (-20.0, -10.0, 0.0, 8.0, 16.0, 25.0, 35.0)
#: Lengths of a free coast, revolutions.
COASTS = (0.03, 0.12, 0.3, 0.5, 0.8)
PARKED_M = 185e3
#: Ascents to a low orbit are tried from so many starts for each plane.
ASCENTS = 2
#: Steps of the flown guesses, s: at first, and later than 150 s.
STEPS_S = (1.5, 6.0)
#: Between states of a flown coast, s.
DENSE_S = 5.0
#: Share of a piece: nearer to one of its ends a drop is tried on the other side.
NEAR = 1e-3
#: Intervals of the last solutions are so many times shorter, in turn, until the mass changes by a
#: smaller share.
FINER = (1.7, 3.0, 5.0, 8.0)
SAME = 2e-5
#: A miss of one: altitude, m, flight-path angle, rad, and speed, m/s.
MISS = (100e3, 0.06, 200.0)


class Ascents:
    """Fly all guesses of an ascent at once; its last piece alone is free.

    What waits for heating is carried to the end, but the time is kept when it would drop.
    """

    def __init__(self, launch: Launch) -> None:
        """Draw up the guesses of a launch."""
        self._launch = launch
        self._tries = [
            (normal, power, pitch)
            for normal in launch.normals()
            for power in EXPONENTS
            for pitch in LAST_PITCHES
        ]
        arcs, pieces = launch.arrays.arcs, launch.pieces
        self._lengths = [piece.length for piece in pieces]
        last, masses = pieces[-1], launch.masses(pieces, [*self._lengths[:-1], 0.0])
        same = [p for p in pieces[:-1] if arcs[p.arc]["stage"] == arcs[-1]["stage"]]
        spare = float(arcs[-1]["propellant"]) - sum(p.burnt(p.length, p.length) for p in same)
        self._lengths[-1] = min(spare, 0.95 * masses[-1]) / last.flow[0]
        self._masses = launch.masses(pieces, self._lengths)
        self._normals = np.array([normal for normal, _, _ in self._tries])
        self._powers = np.array([power for _, power, _ in self._tries])
        self._pitches = np.radians([pitch for _, _, pitch in self._tries])

    def flights(self) -> list[Flight]:
        """Return the flights that end nearest to the target, the nearest first."""
        launch = self._launch
        states, begin = [], 0.0
        first = np.r_[launch.start.position / launch.radius, launch.start.velocity / launch.speed]
        x = np.tile(first, (len(self._tries), 1))
        times, colds = [], []
        for k, length in enumerate(self._lengths):
            count = max(1, math.ceil(length / STEPS_S[int(begin > 150.0)]))
            for i in range(count):
                t = i * length / count
                times.append(begin + t)
                states.append(np.c_[x, self._direction(begin + t, x)])
                x, heating = self._step(k, begin, t, length / count, x)
                colds.append(heating)
            begin += length
        times.append(begin)
        states.append(np.c_[x, self._direction(begin, x)])
        return self._nearest(np.array(times), np.array(states), np.array(colds))

    def _direction(self, t: float, x: Array) -> Array:
        share = min(1.0, max(0.0, t - self._launch.rise) / (sum(self._lengths) - self._launch.rise))
        pitch = 0.5 * math.pi - (0.5 * math.pi - self._pitches) * share**self._powers
        up = x[:, :3] / np.linalg.norm(x[:, :3], axis=1)[:, None]
        ahead = np.cross(self._normals, up)
        ahead /= np.linalg.norm(ahead, axis=1)[:, None]
        return np.sin(pitch)[:, None] * up + np.cos(pitch)[:, None] * ahead

    def _step(self, k: int, begin: float, t: float, step: float, x: Array) -> tuple[Array, Array]:
        """Return the states after a step of order 4, and the heating before it."""
        h = step * self._launch.speed / self._launch.radius
        k1, heating = self._rate(k, begin, t, x)
        k2, _ = self._rate(k, begin, t + 0.5 * step, x + 0.5 * h * k1)
        k3, _ = self._rate(k, begin, t + 0.5 * step, x + 0.5 * h * k2)
        k4, _ = self._rate(k, begin, t + step, x + h * k3)
        return x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), heating

    def _rate(self, k: int, begin: float, t: float, x: Array) -> tuple[Array, Array]:
        piece, length = self._launch.pieces[k], self._lengths[k]
        thrust = piece.thrust[0] + (piece.thrust[1] - piece.thrust[0]) * t / length
        mass = self._masses[k] - piece.burnt(t, length)
        u = self._direction(begin + t, x)
        forces = self._launch.arc_forces[piece.arc]
        motion, _, _, heating = forces(x[:, :3].T, x[:, 3:].T, u.T, thrust, mass)
        return np.c_[x[:, 3:], motion.full().T], heating.full().ravel()

    def _nearest(self, times: Array, states: Array, heating: Array) -> list[Flight]:
        """Cut flights off where they are nearest to the target, and sort them."""
        launch = self._launch
        perigee, c3 = launch.orbit
        begin = sum(self._lengths[:-1])
        first = int(np.searchsorted(times, begin + 1.0))
        scale = np.r_[[launch.radius] * 3, [launch.speed] * 3, 1.0, 1.0, 1.0]
        states = states * scale
        r, v = (np.linalg.norm(states[first:, :, i : i + 3], axis=2) for i in (0, 3))
        angle = (states[first:, :, :3] * states[first:, :, 3:6]).sum(axis=2) / (r * v)
        wanted = np.sqrt(np.maximum(c3 + 2.0 * launch.speed**2 * launch.radius / r, 1.0))
        misses = ((r - perigee) / MISS[0]) ** 2 + (angle / MISS[1]) ** 2
        misses += ((v - wanted) / MISS[2]) ** 2
        misses[~np.isfinite(misses)] = math.inf
        groups: dict[Any, list[tuple[float, int]]] = {}
        for i, (normal, power, _) in enumerate(self._tries):
            groups.setdefault((*normal, power), []).append((float(misses[:, i].min()), i))
        of_each = max(1, STARTS // len(groups))
        flights = []
        for _, i in sorted(one for group in groups.values() for one in sorted(group)[:of_each]):
            end = first + int(np.argmin(misses[:, i])) + 1
            lengths = [*self._lengths[:-1], float(times[end - 1] - begin)]
            heat = self._heat(times, heating[:, i], lengths)
            plane = tuple(self._normals[i])
            flights.append(Flight(times[:end], states[:end, i], lengths, heat, plane=plane))
        return flights

    def _heat(self, times: Array, heating: Array, lengths: list[float]) -> Any:
        """Return piece and time in it of each drop that waits for heating."""
        places, begins = {}, np.r_[0.0, np.cumsum(lengths)]
        for j, drop in enumerate(self._launch.arrays.jettisons):
            if drop["criterion"] != HEATING_LIMIT:
                continue
            late = times[:-1] >= begins[self._launch.ignition(int(drop["stage"]))] - 1e-6
            cold = np.flatnonzero(late & (heating < math.log(float(drop["value"]))))
            at = min(times[cold[0]] if cold.size else math.inf, begins[-1] - 1.0)
            k = min(int(np.searchsorted(begins, at, side="right")) - 1, len(lengths) - 1)
            places[j] = (k, float(at - begins[k]))
        return places


def with_coast(launch: Launch, ascent: Flight, coast_s: float) -> Flight:
    """Fly a coast and a last burn along the velocity after an ascent, to the target's energy."""
    _, c3 = launch.orbit
    mu = launch.speed**2 * launch.radius
    burn = launch.pieces[-1]

    def rate(t: float, x: Array, thrust: float) -> Array:
        push = thrust / (ascent.mass - burn.flow[0] * t) / np.linalg.norm(x[3:])
        return np.r_[x[3:], push * x[3:] - mu * x[:3] / np.linalg.norm(x[:3]) ** 3]

    def short(_t: float, x: Array, _thrust: float) -> float:
        return float(x[3:] @ x[3:] - 2.0 * mu / np.linalg.norm(x[:3]) - c3)

    short.terminal, short.direction = True, 1.0  # type: ignore[attr-defined]
    t, x = float(ascent.t[-1]), ascent.x[-1, :6]
    times, rows, lengths = [ascent.t], [ascent.x], [*ascent.lengths]
    longest = 0.7 * ascent.mass / burn.flow[0]
    for length, thrust in ((coast_s, 0.0), (longest, burn.thrust[0])):
        events = short if thrust else None
        path = solve_ivp(
            rate, (0.0, length), x, args=(thrust,), events=events, rtol=1e-8, dense_output=True
        )
        after = np.linspace(0.0, path.t[-1], 2 + math.ceil(path.t[-1] / DENSE_S))[1:]
        states = path.sol(after)
        x = states[:, -1]
        times.append(t + after)
        rows.append(np.vstack((states, states[3:] / np.linalg.norm(states[3:], axis=0))).T)
        lengths.append(float(path.t[-1]))
        t += lengths[-1]
    return Flight(np.concatenate(times), np.vstack(rows), lengths, ascent.heat)


@dataclass
class Answer:
    """Hold what was found.

    Attributes:
        flight: the best solution; None: there is none.
        solved: of so many starts.
        starts: so many were tried.
        cpu_s: CPU time of all, with the building of functions.
    """

    flight: Flight | None
    solved: int
    starts: int
    cpu_s: float


class Peer:
    """Plan a mission from the pad."""

    def __init__(self, mission: Mission) -> None:
        """Keep the mission; programs are built once for all starts alike."""
        self._mission = mission
        self._programs: dict[Any, Program] = {}

    def plan(self) -> Answer:
        """Solve from ten starts, and the best again on finer intervals.

        Raises:
            ValueError: the mission has what is left out here.
        """
        began = time.process_time()
        launch = Launch(self._mission)
        count = len(launch.pieces)
        free = [count - k for k, one in enumerate(launch.pieces) if math.isinf(one.length)]
        if free == [1]:
            guesses, relaxed = Ascents(launch).flights()[:STARTS], {}
        elif free == [3, 2, 1]:
            guesses, relaxed = self._coasting(launch), {"relaxed": (1.0,)}
        else:
            raise ValueError("the peer leaves out free arcs like these")
        found = [self._solve(launch, guess, **relaxed) for guess in guesses]
        good = [flight for flight in found if flight is not None]
        best = max(good, key=lambda flight: flight.mass) if good else None
        if best is not None:
            best = self._moved(launch, best)
            best = self._refined(launch, best)
        return Answer(best, len(good), len(guesses), time.process_time() - began)

    def _solve(self, launch: Launch, guess: Flight, **options: Any) -> Flight | None:
        """Solve from a guess, on a program that is built once for guesses of one layout."""
        program = Program(launch, guess)
        return self._programs.setdefault(program.key, program).solve(guess, **options)

    def _coasting(self, launch: Launch) -> list[Flight]:
        """Return ascents to a low circle and to the target's apogee, and what follows each."""
        perigee, c3 = launch.orbit
        mu = launch.speed**2 * launch.radius
        low = launch.radius + PARKED_M
        guesses: list[Flight] = []
        for high, shares in ((low, COASTS), (-2.0 * mu / c3 - perigee, (0.5,))):
            ascent = Launch(self._mission, len(launch.arrays.arcs) - 2)
            ascent.aim(low, high)
            tries = Ascents(ascent).flights()
            period = 2.0 * math.pi * math.sqrt((0.5 * (low + high)) ** 3 / mu)
            for normal in ascent.normals():
                near = [one for one in tries if one.plane == tuple(normal)][:ASCENTS]
                solved = (self._solve(ascent, one) for one in near)
                flight = next((one for one in solved if one is not None), None)
                if flight is not None:
                    guesses += [with_coast(launch, flight, share * period) for share in shares]
            if not guesses:
                break
        return guesses

    def _refined(self, launch: Launch, flight: Flight) -> Flight:
        """Solve on finer intervals until the mass no longer changes, or none is found."""
        for finer in FINER:
            before, found = flight.mass, Program(launch, flight, finer).solve(flight, (1.0,))
            if found is None:
                break
            flight = found
            if abs(flight.mass - before) < SAME * before:
                break
        return flight

    def _moved(self, launch: Launch, flight: Flight) -> Flight:
        """Move drops that would rather be in the next piece, or in the one before."""
        for _ in range(3):
            moved = {}
            for j, (k, t) in flight.heat.items():
                length = flight.lengths[k]
                to = k + int(t > (1.0 - NEAR) * length) - int(t < NEAR * length)
                first = launch.ignition(int(launch.arrays.jettisons[j]["stage"]))
                if to != k and first <= to < len(launch.pieces):
                    moved[j] = (to, (0.02 if to > k else 0.98) * flight.lengths[to])
            if not moved:
                break
            guess = replace(flight, heat=flight.heat | moved)
            other = self._solve(launch, guess, relaxed=(1.0,))
            if other is None or other.mass <= flight.mass:
                break
            flight = other
        return flight


def main() -> None:
    """Print the answers for missions by name."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=["delta_iii_pad"])
    for name in parser.parse_args().names:
        answer = Peer(load_mission(name)).plan()
        best = answer.flight
        said = f"{best.mass:.6f} kg at {best.t[-1]:.6f} s" if best else "no solution"
        of = f"{answer.solved} of {answer.starts} starts"
        print(f"{name}: {said}, {of}, {answer.cpu_s:.1f} s", flush=True)


if __name__ == "__main__":
    main()

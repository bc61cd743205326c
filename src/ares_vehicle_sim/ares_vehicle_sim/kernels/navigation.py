# SPDX-License-Identifier: Apache-2.0
"""Navigation model: the truth with the errors of the flight.

The noise is counter-based: it depends only on seed, flight and number of the state, so that any
flight can be flown again alone. The generator is Philox 4x64-10 (Salmon, Moraes, Dror, Shaw:
"Parallel random numbers: as easy as 1, 2, 3", 2011), as in ``numpy.random.Philox``, which a kernel
cannot use.
"""

import math
import zlib

import numpy as np

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, add, axpy, load, store
from ares_vehicle_sim.arrays import Vehicle

Word = np.uint64
Words = tuple[np.uint64, np.uint64, np.uint64, np.uint64]


def stream_number(name: str) -> int:
    """Return the number of the random stream of a quantity, by its name."""
    return zlib.crc32(name.encode())


POSITION_NOISE = np.uint64(stream_number("navigation.position_noise_m"))
VELOCITY_NOISE = np.uint64(stream_number("navigation.velocity_noise_m_s"))
HEATING_NOISE = np.uint64(stream_number("navigation.heating_noise"))

MULTIPLIER_0 = np.uint64(0xD2E7470EE14C6C93)
MULTIPLIER_1 = np.uint64(0xCA5A826395121157)
KEY_STEP_0 = np.uint64(0x9E3779B97F4A7C15)
KEY_STEP_1 = np.uint64(0xBB67AE8584CAA73B)
ROUNDS = 10

LOW_HALF = np.uint64(0xFFFFFFFF)
HALF = np.uint64(32)
SPARE_BITS = np.uint64(12)
ZERO = np.uint64(0)
#: Step of the uniform numbers: 52 bits of a word plus half a step lie strictly within 0 and 1.
STEP = 2.0**-52


@kernel
def high_word(a: Word, b: Word) -> Word:
    """Return the upper 64 bits of the product of two words."""
    a_low, a_high = a & LOW_HALF, a >> HALF
    b_low, b_high = b & LOW_HALF, b >> HALF
    middle = a_high * b_low + ((a_low * b_low) >> HALF)
    rest = a_low * b_high + (middle & LOW_HALF)
    return a_high * b_high + (middle >> HALF) + (rest >> HALF)


@kernel
def philox(key_0: Word, key_1: Word, counter: Words) -> Words:
    """Generate four random words from a key and a counter."""
    c0, c1, c2, c3 = counter
    for _ in range(ROUNDS):
        h0, l0 = high_word(MULTIPLIER_0, c0), MULTIPLIER_0 * c0
        h1, l1 = high_word(MULTIPLIER_1, c2), MULTIPLIER_1 * c2
        c0, c1, c2, c3 = h1 ^ c1 ^ key_0, l1, h0 ^ c3 ^ key_1, l0
        key_0 += KEY_STEP_0
        key_1 += KEY_STEP_1
    return c0, c1, c2, c3


@kernel
def fraction(word: Word) -> float:
    """Convert a word to a number strictly between 0 and 1."""
    return (float(word >> SPARE_BITS) + 0.5) * STEP


@kernel
def noise(errors: Record, stream: Word, state: Word) -> Vector:
    """Generate three standard normal numbers for a navigation state (Box and Muller).

    Args:
        errors: record NAVIGATION_ERRORS.
        stream: number of the noise's stream.
        state: number of the navigation state, from 0.
    """
    w0, w1, w2, w3 = philox(errors.seed, stream, (state, errors.flight, ZERO, ZERO))
    long = math.sqrt(-2.0 * math.log(fraction(w0)))
    turn = 2.0 * math.pi * fraction(w1)
    other = math.sqrt(-2.0 * math.log(fraction(w2)))
    return (
        long * math.cos(turn),
        long * math.sin(turn),
        other * math.cos(2.0 * math.pi * fraction(w3)),
    )


@kernel
def corrupt(errors: Record, state: Word, nav: Record) -> None:
    """Add the navigation errors to the true state in ``nav``.

    Args:
        errors: record NAVIGATION_ERRORS.
        state: number of the navigation state, from 0.
        nav: record NAVIGATION. Changed.
    """
    r = add(load(nav.position), load(errors.position_bias))
    v = add(load(nav.velocity), load(errors.velocity_bias))
    heating = 1.0 + errors.heating_scale
    if errors.position_noise > 0.0:
        r = axpy(errors.position_noise, noise(errors, POSITION_NOISE, state), r)
    if errors.velocity_noise > 0.0:
        v = axpy(errors.velocity_noise, noise(errors, VELOCITY_NOISE, state), v)
    if errors.heating_noise > 0.0:
        heating += errors.heating_noise * noise(errors, HEATING_NOISE, state)[0]
    store(nav.position, r)
    store(nav.velocity, v)
    for i in range(3):
        nav.sensed_delta_v[i] *= 1.0 + errors.sensed_delta_v_scale[i]
    nav.mass *= 1.0 + errors.mass_scale
    nav.heating_rate *= heating


@kernel
def measure(vehicle: Vehicle) -> None:
    """Write the navigated state into ``vehicle.navigation``."""
    plant = vehicle.plant
    nav = vehicle.navigation
    nav.time = plant.time
    store(nav.position, load(plant.position))
    store(nav.velocity, load(plant.velocity))
    store(nav.sensed_delta_v, load(plant.sensed_delta_v))
    nav.mass = plant.mass
    nav.heating_rate = plant.heating_rate
    nav.arc = plant.arc
    nav.arc_start_time = plant.arc_start_time
    nav.jettisoned = plant.jettisoned
    if plant.errors.active != 0:
        corrupt(plant.errors, plant.measurements, nav)
    plant.measurements += np.uint64(1)

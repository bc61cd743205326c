# SPDX-License-Identifier: Apache-2.0
"""Fly RocketPy's Monte Carlo: a sounding rocket to its apogee. Run by montecarlo.py.

    python benchmarks/montecarlo_rocketpy.py FLIGHTS PROCESSES

A flight: rigid body with six degrees of freedom in a standard atmosphere, drag and fins, a
solid motor of constant thrust for 3.9 s, launch rail, LSODA (RocketPy's default), open loop to
the apogee at about 28 s. Dispersed: impulse 1 %, mass, inclination and heading.
"""

import io
import json
import sys
import tempfile
import time
import warnings
from contextlib import redirect_stdout
from pathlib import Path

warnings.filterwarnings("ignore")

from rocketpy import (  # noqa: E402
    Environment,
    Flight,
    MonteCarlo,
    Rocket,
    SolidMotor,
    StochasticEnvironment,
    StochasticFlight,
    StochasticNoseCone,
    StochasticRocket,
    StochasticSolidMotor,
    StochasticTrapezoidalFins,
)


def make_motor():
    return SolidMotor(
        thrust_source=2000.0,
        burn_time=3.9,
        dry_mass=1.8,
        dry_inertia=(0.125, 0.125, 0.002),
        nozzle_radius=0.033,
        throat_radius=0.011,
        grain_number=5,
        grain_density=1815.0,
        grain_outer_radius=0.033,
        grain_initial_inner_radius=0.015,
        grain_initial_height=0.12,
        grain_separation=0.005,
        grains_center_of_mass_position=0.397,
        center_of_dry_mass_position=0.317,
        nozzle_position=0.0,
    )


def make_campaign(folder):
    environment = Environment(latitude=28.5, longitude=-80.5, elevation=0.0)
    environment.set_atmospheric_model(type="standard_atmosphere")
    motor = make_motor()
    rocket = Rocket(
        radius=0.0635,
        mass=14.4,
        inertia=(6.321, 6.321, 0.034),
        power_off_drag=0.45,
        power_on_drag=0.45,
        center_of_mass_without_motor=0.0,
        coordinate_system_orientation="tail_to_nose",
    )
    rocket.add_motor(motor, position=-1.255)
    rocket.set_rail_buttons(0.08, -0.62, 45.0)
    nose = rocket.add_nose(length=0.558, kind="von karman", position=1.278)
    fins = rocket.add_trapezoidal_fins(
        n=4, root_chord=0.12, tip_chord=0.06, span=0.11, position=-1.05
    )
    flight = Flight(
        rocket=rocket,
        environment=environment,
        rail_length=5.2,
        inclination=85.0,
        heading=90.0,
        terminate_on_apogee=True,
    )
    varied = StochasticRocket(rocket=rocket, mass=(14.4, 0.05))
    impulse = float(motor.total_impulse)
    varied.add_motor(
        StochasticSolidMotor(solid_motor=motor, total_impulse=(impulse, 0.01 * impulse)),
        position=0.001,
    )
    varied.add_nose(StochasticNoseCone(nosecone=nose, length=0.001))
    varied.add_trapezoidal_fins(StochasticTrapezoidalFins(trapezoidal_fins=fins))
    return MonteCarlo(
        filename=str(Path(folder) / "campaign"),
        environment=StochasticEnvironment(environment=environment),
        rocket=varied,
        flight=StochasticFlight(flight=flight, inclination=(85.0, 1.0), heading=(90.0, 2.0)),
    )


def main():
    flights, processes = (int(text) for text in sys.argv[1:3])
    with tempfile.TemporaryDirectory() as folder, redirect_stdout(io.StringIO()):
        campaign = make_campaign(folder)
        begun = time.perf_counter()
        campaign.simulate(
            number_of_simulations=flights,
            append=False,
            parallel=processes > 1,
            n_workers=processes if processes > 1 else None,
        )
        seconds = time.perf_counter() - begun
    print(json.dumps({"flights_per_s": flights / seconds}))


if __name__ == "__main__":
    main()

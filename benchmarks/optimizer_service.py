# SPDX-License-Identifier: Apache-2.0
"""Compare an answer of `solve_trajectory`, by a node in its own process, with the bare solution."""

import argparse
import os
import subprocess
import sys
import time

import numpy as np
import rclpy
from figures import Figures, keep_option
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node

from ares_models.mission import load_mission
from ares_msgs.srv import SolveTrajectory
from ares_node.domains import claimed_domain
from ares_optimizer.solve import solve

READY_TIMEOUT = 600.0  # s, the first start compiles


def bare(mission: str, method: str, count: int) -> list[float]:
    """Return the wall time of the solver's own calls, s."""
    read = load_mission(mission)
    arrays, start = read.arrays(), read.start().navigation()
    times = []
    for _ in range(count + 3):
        begun = time.perf_counter()
        solve(
            arrays,
            method,
            state=start,
            heating=read.heating_limit_holds,
            verify=method not in ("indirect", "closed_form"),
        )
        times.append(time.perf_counter() - begun)
    return times[3:]


def answered(mission: str, method: str, count: int) -> tuple[list[float], list[float]]:
    """Return the wall time of requests, and the solution time in their answers, s."""
    rclpy.init()
    node = Node("client", namespace="ares")
    executor = EventsExecutor()
    executor.add_node(node)
    client = node.create_client(SolveTrajectory, "solve_trajectory")
    deadline = time.monotonic() + READY_TIMEOUT
    while not client.service_is_ready():
        if time.monotonic() > deadline:
            raise SystemExit("no optimizer on the graph")
        executor.spin_once(timeout_sec=0.1)
    times, solved = [], []
    for _ in range(count + 3):
        begun = time.perf_counter()
        call = client.call_async(SolveTrajectory.Request(mission=mission, method=method))
        while not call.done():
            executor.spin_once(timeout_sec=1.0)
        times.append(time.perf_counter() - begun)
        answer = call.result()
        if answer.error_code != SolveTrajectory.Response.NONE:
            raise SystemExit(answer.message)
        solved.append(answer.solve_time)
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown()
    return times[3:], solved[3:]


def main() -> None:
    """Measure and print one line per method."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mission", default="ares_v")
    parser.add_argument("-n", type=int, default=100, help="requests per method")
    keep_option(parser)
    options = parser.parse_args()
    with claimed_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        server = subprocess.Popen([sys.executable, "-m", "ares_optimizer"])
        try:
            figures = Figures(
                __file__,
                f"{options.n} requests of each method for {options.mission}, medians.",
            )
            for method in ("indirect", "direct11", "analytic"):
                times, solved = answered(options.mission, method, options.n)
                alone = bare(options.mission, method, options.n)
                middle, late = 1e3 * np.median(times), 1e3 * np.percentile(times, 99)
                inside, own = 1e3 * np.median(solved), 1e3 * np.median(alone)
                figures.add(f"{method}, answered", middle, "ms")
                figures.add(f"{method}, answered, 99th percentile", late, "ms")
                figures.add(f"{method}, solved there", inside, "ms")
                figures.add(f"{method}, the same call alone", own, "ms")
                figures.add(f"{method}, answered / alone", middle / own, "")
        finally:
            server.terminate()
            server.wait()
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()

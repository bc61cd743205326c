# SPDX-License-Identifier: Apache-2.0
"""Fly the laws over a link with latency and loss (docs/hardware_in_the_loop.md)."""

import argparse
import json
import math
import sys
from functools import partial
from typing import Any

from figures import RESULTS, Figures, keep_option
from rclpy.node import Node

from ares_bringup.keeper import SIMULATOR
from ares_trials.faults.link import LOOK_PERIOD, Link, LinkOptions
from ares_trials.faults.scene import PATIENCE, Scene

LAWS = ("peg", "igm", "optimal")
#: One way, s of flight time.
LATENCIES = (0.001, 0.01, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
LOSSES = (0.0, 0.01, 0.05, 0.1, 0.3)
#: Longest age of a command that is flown by, s: beyond any that the grid leads to.
AGE = 60.0


def join(options: LinkOptions, node: Node) -> Link:
    """Insert a link by a node."""
    link = Link(node, options)
    if options.wall:
        node.create_timer(LOOK_PERIOD, link.look)
    return link


def fly(
    law: str, latency_s: float, loss: float, jitter: float, seed: int, pace: float
) -> dict[str, Any]:
    """Fly Ares V over a link.

    Args:
        law: guidance law.
        latency_s: one way, s of flight time; with a pace, of the wall clock.
        loss: fraction of messages lost, either way.
        jitter: largest jitter, as a fraction of the latency.
        seed: of jitter and loss.
        pace: real-time factor; 0: lock-step.
    """
    link = LinkOptions(latency_s, jitter * latency_s, loss, seed, wall=pace > 0.0)
    options = {"guidance": law, "navigation_period_s": 0.1, "pace": pace}
    arguments = {SIMULATOR: ("-p", f"longest_command_age_s:={AGE}")}
    with Scene(options, arguments, relay=partial(join, link)) as scene:
        flown = scene.finish(math.inf if pace else PATIENCE)
    summary = flown.summary
    if not summary:
        raise SystemExit(f"{law}, {latency_s} s, {loss}: {flown.status}: {flown.said}")
    return {
        "law": law,
        "latency_s": latency_s,
        "loss": loss,
        "jitter_s": link.jitter_s,
        "seed": seed,
        "mass_kg": summary["m_f_kg"],
        "outcome": summary["outcome"],
        "status": flown.status,
        "shortcomings": summary["shortcomings"],
        "said": [line["message"] for line in summary["diagnostics"]],
    }


def main() -> None:
    """Fly the grid."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--laws", nargs="+", default=LAWS, choices=LAWS)
    parser.add_argument("--latencies", nargs="+", type=float, default=LATENCIES, help="one way, s")
    parser.add_argument("--losses", nargs="+", type=float, default=LOSSES, help="shares")
    parser.add_argument("--jitter", type=float, default=0.2, help="share of the latency")
    parser.add_argument("--seed", type=int, default=1, help="of jitter and loss")
    parser.add_argument("--pace", type=float, default=0.0, help="0: lock-step; 1: real time")
    keep_option(parser)
    given = parser.parse_args()
    figures = Figures(__file__, "Ares V by each law over a link with latency and loss.")
    rows = []
    for law in given.laws:
        for loss in given.losses:
            for latency in given.latencies:
                row = fly(law, latency, loss, given.jitter, given.seed, given.pace)
                rows.append(row)
                figures.add(f"{law}, {1e3 * latency:g} ms, {loss:.0%}", row["mass_kg"], "kg")
                print(
                    row["outcome"],
                    row["status"],
                    *row["shortcomings"],
                    *row["said"],
                    file=sys.stderr,
                )
    if given.keep:
        figures.keep()
        path = RESULTS / "latency.json"
        path.write_text(json.dumps({**json.loads(path.read_text()), "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()

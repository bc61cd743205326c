# SPDX-License-Identifier: Apache-2.0
"""Define the verbs that join a running graph."""

import os
import signal
import sys
from dataclasses import replace
from typing import Annotated

import typer

from ares_bringup.options import MAX_DOMAIN_ID
from ares_bringup.verbs import app as shared
from ares_bringup.verbs.app import BadInput, app, needs

NODES = {
    "sim": "ares_vehicle_sim",
    "guidance": "ares_guidance",
    "optimizer": "ares_optimizer",
    "recorder": "ares_bags",
    "view": "ares_view.standard",
}


@app.command()
def live(
    mission: Annotated[
        str, typer.Option(help="Name or path of the mission; default: as announced by the flight.")
    ] = "",
    host: shared.LiveHost = shared.LOOPBACK,
    port: shared.LivePort = 0,
    no_browser: shared.NoBrowser = False,
    domain_id: Annotated[
        int | None,
        typer.Option(min=0, max=MAX_DOMAIN_ID, help="ROS domain; default: ROS_DOMAIN_ID, else 0."),
    ] = None,
    namespace: shared.Namespace = "ares",
) -> None:
    """Follow any flight or replay on a page in the browser, until Ctrl-C."""
    needs("live")
    from ares_bringup.audience import follow

    page = replace(shared.live_options(host, port, no_browser, False), prefix="")
    follow(page, mission, namespace, domain_id)


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
def node(
    context: typer.Context,
    name: Annotated[
        str, typer.Argument(metavar="sim|guidance|optimizer|recorder|view", help="Which node.")
    ],
) -> None:
    """Run one node; what follows its name goes to it."""
    if name not in NODES:
        raise BadInput(f"node is {name!r}; expected one of {', '.join(NODES)}")
    from ares_bringup.discovery import apply_discovery_settings

    apply_discovery_settings()
    # blocked until the node handles them, since Python would print a traceback during start-up
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    os.execv(sys.executable, [sys.executable, "-P", "-m", NODES[name], *context.args])

# SPDX-License-Identifier: Apache-2.0
"""Build src/ with colcon, and compile the kernels."""

import os
import shlex
from collections.abc import Mapping
from pathlib import Path

from preparation.digests import interfaces
from preparation.installing import tool_environment
from preparation.layout import Workspace
from preparation.needs import ALL_KERNELS
from preparation.paths import below, split_path
from preparation.progress import say
from preparation.running import WorkspaceError, remove, run_logged
from preparation.stamps import build_digests, build_stamp, kernel_stamp, read_stamp, write_stamp


def repair_scripts(install: Path, interpreter: Path) -> None:
    """Let the shell start the node executables if a ``#!`` line cannot hold the Python's path.

    The system accepts no blanks there and cuts long lines.
    """
    start = f"#!{interpreter}"
    if " " not in start and len(start) < 127:
        return
    for path in sorted(install.glob("lib/ares_*/*")):
        first, _, rest = path.read_text(encoding="utf-8").partition("\n")
        if first.startswith("#!") and str(interpreter) in first:
            # a comment-like string to Python, a command to the shell
            shell = f"#!/bin/sh\n'''exec' {shlex.quote(str(interpreter))} \"$0\" \"$@\"\n' '''\n"
            path.write_text(shell + rest, encoding="utf-8")


def missing_interfaces(workspace: Workspace, environ: Mapping[str, str]) -> list[Path]:
    """Return the `interfaces` that the ROS 2 in use lacks."""
    install = str(workspace.root / "install")
    found = split_path(environ.get("AMENT_PREFIX_PATH", ""))
    shares = [Path(prefix, "share") for prefix in found if not below(prefix, [install])]
    return [
        package
        for package in interfaces(workspace.root)
        if not any((share / package.name / "package.xml").exists() for share in shares)
    ]


def build(workspace: Workspace, environ: Mapping[str, str], lock: int) -> None:
    """Build src/ with colcon into build/ and install/."""
    root = workspace.root
    stamp = build_stamp(root)
    digests = build_digests(workspace)
    if (
        read_stamp(stamp).get("interfaces") == digests["interfaces"]
        and (root / "install/setup.sh").exists()
    ):
        say("building the Python packages anew")
    else:
        say("building the messages and packages (half a minute)")
        for path in [*(root / "build").glob("ares_*"), *(root / "build").glob("*_msgs")]:
            remove(path)
        remove(root / "install")
    remove(stamp)
    build_environ = tool_environment(workspace, environ) | {
        # no user settings, no desktop notification
        "COLCON_HOME": str(root / "build" / ".colcon"),
        "COLCON_DEFAULTS_FILE": os.devnull,
        "COLCON_EXTENSION_BLOCKLIST": "colcon_core.event_handler.desktop_notification",
        "PYTHONWARNINGS": "ignore",
        "MAKEFLAGS": f"-j{os.cpu_count() or 1}",
    }
    colcon = [str(workspace.interpreter), "-m", "colcon", "--log-base", "log", "build"]
    also = [str(path) for path in missing_interfaces(workspace, build_environ)]
    colcon += ["--base-paths", "src", *also, "--build-base", "build", "--install-base", "install"]
    colcon += ["--merge-install", "--symlink-install"]
    colcon += ["--event-handlers", "console_cohesion+"]
    colcon += ["--cmake-args", "-G", "Ninja", "-DBUILD_TESTING=OFF", "-DCMAKE_BUILD_TYPE=Release"]
    colcon += [f"-DPython3_EXECUTABLE={workspace.interpreter}"]
    # the wheels hold no C++ program that would read the messages
    colcon += [f"-DPYTHON_ONLY={'OFF' if workspace.ros else 'ON'}"]
    run_logged(colcon, workspace, build_environ, lock, "colcon build")
    repair_scripts(root / "install", workspace.interpreter)
    run_logged(
        [
            str(workspace.interpreter),
            "-c",
            "import rclpy, ares_msgs.action, ares_msgs.msg, ares_msgs.srv, tf2_msgs.msg",
        ],
        workspace,
        workspace.environment(environ),
        lock,
        "importing the built messages",
    )
    write_stamp(stamp, digests)


def warm_kernels(workspace: Workspace, environ: Mapping[str, str], lock: int, what: str) -> None:
    """Compile kernels into a folder of their own and drop outdated ones.

    Args:
        workspace: with the requirements of flying installed.
        environ: the user's environment.
        lock: descriptor of the lock.
        what: ALL_KERNELS or a law.
    """
    folder = workspace.kernels
    folder.mkdir(parents=True, exist_ok=True)
    law = [] if what == ALL_KERNELS else [what]
    try:
        run_logged(
            [str(workspace.interpreter), "-m", "ares_studies.warm_up", *law],
            workspace,
            workspace.environment(environ),
            lock,
            "compiling the kernels",
        )
    except WorkspaceError as problem:
        # the caller compiles the kernels on demand, or fails with the true reason
        say(f"{problem}; going on without")
        return
    kernel_stamp(folder, what).touch()
    for other in folder.parent.iterdir():
        if other != folder:
            remove(other)

# SPDX-License-Identifier: Apache-2.0
"""Kill, stop and end each process of a flight under the real `ros2 launch` at random times.

    ./ares exec python benchmarks/launch_kills.py [-n N] [--seed S] [--workers W] [--keep]

`ros2` must be that of a full ROS 2 (docs/install.md). A trial starts a flight of a short burn with
all seven nodes, waits for a random time, sends SIGKILL, SIGTERM, or SIGSTOP and some seconds later
SIGCONT, to one process, and examines the end of the launch.
"""

import argparse
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import yaml
from figures import Figures, keep_option

from ares_bags.verify import verify
from ares_node.domains import claimed_domain
from ares_trials.testing.flights import short_burn

LAUNCHER = "launcher"
NODES = ("vehicle_sim", "guidance", "optimizer", "recorder", "judge", "view", "live")
SIGNALS = (signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM)
#: Wall time in s within which a launch must come to its end, and its nodes to theirs after it.
PATIENCE, LEFT_BEHIND = 120.0, 5.0
#: Wall time in s for which a process is stopped.
STOPPED = (0.5, 6.0)
LOOK_PERIOD = 0.05
PACE = 10.0
MARK = "ARES_LAUNCH_KILLS"

#: A traceback through code of ours; none leaves Python's own start, which takes some 20 ms.
_OWN_TRACE = re.compile(r'File "[^"]*/ares_\w+/[^"]*\.py", line')

#: Exit statuses that are documented.
TARGET, NOT_AS_IT_SHOULD, CANNOT_START, INTERRUPTED = 0, 1, 2, 130
#: Flights go on without these, and say so.
SPARED = ("optimizer", "view", "live")


class Trial(NamedTuple):
    """Hold a signal, its process, its time (s after the start), and the duration of a stop."""

    name: str
    number: signal.Signals
    after: float
    stopped: float


@dataclass
class End:
    """Hold the outcome of a trial.

    Attributes:
        trial: the trial.
        status: of the launcher.
        phase: time of the signal: `before the flight`, `in flight`, `after the flight`.
        output: everything printed.
        ended_s: wall time from the last signal to the launcher's end.
        left: processes alive LEFT_BEHIND later.
        wrong: deviations from the documentation, one line each.
    """

    trial: Trial | None
    status: int | None
    phase: str
    output: str
    ended_s: float
    left: list[str]
    wrong: list[str]


def marked(mark: str) -> dict[int, str]:
    """Return the command lines of a trial's running processes, by process id."""
    found = {}
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            if entry.name.isdigit() and mark.encode() in (entry / "environ").read_bytes():
                line = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                if line:
                    found[int(entry.name)] = line
    return found


def wait_for(condition: Callable[[], bool], seconds: float) -> bool:
    """Tell whether a condition becomes true in time."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(LOOK_PERIOD)
    return True


def pid_of(name: str, mark: str) -> int:
    """Return the process id of a running node; 0 without one."""
    lines = marked(mark)
    return next((pid for pid, line in lines.items() if f"__node:={name} " in line + " "), 0)


def fly(trial: Trial | None, folder: Path) -> End:
    """Run one flight with its trial."""
    mission = folder / "mission.yaml"
    mission.write_text(yaml.safe_dump(short_burn()))
    mark = uuid.uuid4().hex
    words = [f"mission:={mission}", f"bag:={folder / 'bag'}", f"pace:={PACE}", "live:=true"]
    words.append("initial_guess:=optimizer")
    with claimed_domain() as domain, (folder / "out").open("w") as out:
        process = subprocess.Popen(
            ["ros2", "launch", "ares_bringup", "flight.launch.py", *words],
            env={
                **os.environ,
                "ROS_DOMAIN_ID": str(domain),
                "ROS_LOG_DIR": str(folder / "log"),
                MARK: mark,
            },
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=out,
            process_group=0,
        )
        phase = "undisturbed"
        try:
            if trial is not None:
                phase = disturb(trial, process, mark)
            begun = time.monotonic()
            wait_for(lambda: process.poll() is not None, PATIENCE)
            ended = time.monotonic() - begun
            wait_for(lambda: not marked(mark), LEFT_BEHIND)
            left = [line.split()[0] for line in marked(mark).values()]
        finally:
            process.kill()
            process.wait()
            for pid in marked(mark):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
    text = (folder / "out").read_text()
    end = End(trial, process.returncode, phase, text, ended, left, [])
    end.wrong = list(complaints(end, folder / "bag"))
    return end


def disturb(trial: Trial, process: "subprocess.Popen[bytes]", mark: str) -> str:
    """Send the signals; return the phase of the flight at the first one."""
    time.sleep(trial.after)

    def there() -> bool:
        return process.poll() is not None or bool(pid_of(trial.name, mark))

    if trial.name == LAUNCHER:
        pid = process.pid
    else:
        wait_for(there, PATIENCE)
        pid = pid_of(trial.name, mark)
    ended = process.poll() is not None
    for number, wait in ((trial.number, trial.stopped), (signal.SIGCONT, 0.0)):
        if number != signal.SIGCONT or trial.number == signal.SIGSTOP:
            with suppress(ProcessLookupError):
                if pid:
                    os.kill(pid, number)
            time.sleep(wait)
    return "after the launch" if ended or not pid else "under way"


def complaints(end: End, bag: Path) -> Iterator[str]:
    """Yield the deviations of an end from the documentation."""
    status, said = end.status, end.output
    arrived = "main-engine cut-off" in said
    if status is None or end.ended_s >= PATIENCE:
        yield f"no end within {PATIENCE:.0f} s"
        return
    if end.left:
        yield f"left after {LEFT_BEHIND:g} s: {', '.join(end.left)}"
    if _OWN_TRACE.search(said):
        yield "a traceback"
    if status == TARGET and not arrived:
        yield "status 0 without a flight"
    if status == TARGET and " in flight" in said:
        yield "status 0 of a flight that lost a node"
    if status == TARGET and (not bag.exists() or verify(bag).findings):
        yield "status 0 without a whole bag"
    if f"exit status {status}" not in said and status not in (
        -signal.SIGKILL,
        -signal.SIGTERM,
        INTERRUPTED,
    ):
        yield f"status {status}, which no line says"
    allowed = {TARGET} if end.trial is None else documented(end.trial, end)
    if status not in allowed:
        yield f"status {status}; expected one of {sorted(allowed)}"


def documented(trial: Trial, end: End) -> set[int]:
    """Return the exit statuses that are valid for the output of a launch."""
    if end.phase == "after the launch":
        return {TARGET}
    if trial.number == signal.SIGSTOP:
        # a guidance that is missed is said; one that holds its answer for less is not
        late = "flown without an answer from guidance" in end.output
        return {NOT_AS_IT_SHOULD} if late else {TARGET}
    if trial.name == LAUNCHER:
        if trial.number == signal.SIGKILL:
            return {-signal.SIGKILL}
        # launch has not read the file yet: Python dies of it
        early = {-signal.SIGTERM} if "flight " not in end.output else set()
        return {INTERRUPTED, TARGET} | early
    if trial.name in SPARED:
        return {TARGET}
    if trial.name == "judge":
        # one that is asked to end says so; in Python's own start it is killed by either
        asked = {INTERRUPTED} if trial.number == signal.SIGTERM else set()
        return {NOT_AS_IT_SHOULD, TARGET} | asked
    if " in flight" in end.output:
        # said by launch whether the flight had begun or not: the judge knows
        return {NOT_AS_IT_SHOULD, CANNOT_START}
    if f"{trial.name} was killed" in end.output:
        # before the judge was up
        return {CANNOT_START}
    # it ended when the flight was over
    return {TARGET, NOT_AS_IT_SHOULD}


def trials(count: int, seed: int, duration: float) -> list[Trial]:
    """Draw the trials by a seed."""
    draw = random.Random(seed)
    return [
        Trial(
            name,
            number,
            draw.uniform(0.0, duration),
            draw.uniform(*STOPPED) if number == signal.SIGSTOP else 0.0,
        )
        for name in (LAUNCHER, *NODES)
        for number in SIGNALS
        for _ in range(count)
    ]


def attempt(trial: Trial | None) -> End:
    """Run one trial in a folder of its own."""
    with tempfile.TemporaryDirectory(prefix="ares-launch-") as folder:
        return fly(trial, Path(folder))


def main() -> int:
    """Print and keep the counts; return 1 if anything deviated from the documentation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=5, help="times for each process and signal")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=None, choices=(LAUNCHER, *NODES))
    keep_option(parser)
    options = parser.parse_args()
    if shutil.which("ros2") is None:
        print("launch_kills: ros2 is not installed; docs/install.md says how it may be had")
        return 2
    figures = Figures(__file__, "Processes of a flight under ros2 launch killed, stopped, ended.")
    begun = time.monotonic()
    clean = attempt(None)
    duration = time.monotonic() - begun
    print(f"undisturbed: status {clean.status} after {duration:.1f} s {clean.wrong}", flush=True)
    planned = trials(options.n, options.seed, duration)
    planned = [trial for trial in planned if not options.only or trial.name in options.only]
    ends: list[End] = []
    with ThreadPoolExecutor(options.workers) as pool:
        for end in pool.map(attempt, planned):
            ends.append(end)
            said = f"{end.trial}: {end.status}, {end.ended_s:.1f} s later, {end.phase}"
            print(said, *end.wrong, sep="; ", flush=True)
            if end.wrong:
                print(end.output, flush=True)
    for name in (LAUNCHER, *NODES):
        for number in SIGNALS:
            mine = [end for end in ends if end.trial and end.trial[:2] == (name, number)]
            if not mine:
                continue
            what = f"{name} {number.name}"
            figures.add(f"{what}: trials", len(mine), "")
            for status in sorted({end.status for end in mine if end.status is not None}):
                count = sum(end.status == status for end in mine)
                figures.add(f"{what}: status {status}", count, "")
            figures.add(f"{what}: not as documented", sum(bool(end.wrong) for end in mine), "")
            longest = max(end.ended_s for end in mine)
            figures.add(f"{what}: longest until the launch had ended", longest, "s")
    wrong = sum(bool(end.wrong) for end in ends) + bool(clean.wrong)
    figures.add("all: trials", len(ends), "")
    figures.add("all: not as documented", wrong, "")
    if options.keep:
        figures.keep()
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())

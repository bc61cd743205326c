# SPDX-License-Identifier: Apache-2.0
"""Send SIGINT and SIGTERM at random moments to every long-running verb."""

import atexit
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from numpy.random import Generator

from ares_bags.errors import BagError
from ares_bags.verify import verify
from ares_bringup.held import PORT, SHARED, all_pids, shared_memory
from ares_node.domains import claimed_domain
from ares_trials.faults.scene import MARK, leftovers, marked

#: Time in s for a command to end after a signal, corrected for the machine's load; see `Given`.
END_WITHIN = 2.0
#: Wall time in s after which a command that does not end is killed.
HUNG_AFTER = 60.0
#: Wall time in s within which the signal is sent, after the command has its handlers; the same for
#: a short command.
MOMENTS = 5.0
SOON = 1.0
LOOK_PERIOD = 0.005


@dataclass(frozen=True)
class Verb:
    """Hold a command line that runs for a while.

    Attributes:
        words: after `ares`; {bag} is a bag to read, {torn} one without an end, {new} a name in a
            new folder.
        terminated: exit statuses after SIGTERM; a flight that has begun treats it as an
            interruption.
        moments: wall time in s within which the signal is sent.
    """

    words: tuple[str, ...]
    terminated: tuple[int, ...] = (143,)
    moments: float = MOMENTS


#: Mission of its flights, which needs no plan.
FLOWN = ("--mission", "ares_v")
VERBS = {
    "fly": Verb(("fly", *FLOWN, "--pace", "200", "--bag", "{new}"), (130, 143)),
    "fly --in-process": Verb(
        ("fly", *FLOWN, "--in-process", "--pace", "200", "--bag", "{new}"), (130, 143)
    ),
    "fly --live": Verb(
        ("fly", *FLOWN, "--live", "--no-browser", "--pace", "200", "--bag", "{new}"), (130, 143)
    ),
    "montecarlo": Verb(("montecarlo", "-n", "30000", "--workers", "1", "--out", "{new}")),
    "optimize": Verb(("optimize", "--method", "direct20")),
    "reproduce": Verb(("reproduce", "--out", "{new}")),
    "replay": Verb(("replay", "{bag}", "--pace", "100")),
    "replay --check": Verb(("replay", "{bag}", "--check")),
    "report": Verb(("report", "{bag}", "--out", "{new}.html")),
    "export": Verb(("export", "{bag}", "--format", "csv", "--out", "{new}.csv"), moments=SOON),
    "plot": Verb(("plot", "{bag}", "--out", "{new}.png")),
    "live": Verb(("live", "--no-browser")),
    "faults": Verb(("faults", "-n", "3", "--rows", "guidance")),
    "aborts": Verb(("aborts", "--step-s", "20", "--out", "{new}.html")),
    "node": Verb(("node", "sim", "--ros-args", "-p", "pace:=1.0"), terminated=(0,)),
    "bag verify": Verb(("bag", "verify", "{bag}"), moments=SOON),
    "bag info": Verb(("bag", "info", "{bag}"), moments=SOON),
    "bag repair": Verb(("bag", "repair", "{torn}", "--into", "{new}"), moments=SOON),
    "missions": Verb(("missions",), moments=SOON),
    "missions new": Verb(("missions", "new", "rocket", "--out", "{new}.yaml"), moments=SOON),
    "dispersions": Verb(("dispersions",), moments=SOON),
}


@cache
def _a_bag() -> Path:
    """Record a bag to read, removed at the end of this process."""
    folder = Path(tempfile.mkdtemp(prefix="ares-fault-bag-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    bag = folder / "bag"
    words = ("fly", *FLOWN, "--in-process", "--bag", str(bag))
    subprocess.run(
        [sys.executable, "-m", "ares_bringup", *words], check=True, capture_output=True, timeout=300
    )
    return bag


def _a_torn_bag() -> Path:
    """Make a bag without its last third."""
    torn = _a_bag().with_name("torn")
    if not torn.exists():
        shutil.copytree(_a_bag(), torn)
        file = next(torn.glob("*.mcap"))
        os.truncate(file, file.stat().st_size * 2 // 3)
    return torn


class Given:
    """Measure the time for which a machine under load serves some processes.

    With n runnable threads of theirs and m of others on c cores, each thread gets c / (n + m) of a
    core instead of c / n, or of a whole one. Without other runnable threads this is wall time.

    Attributes:
        time_s: time so far, s.
    """

    def __init__(self, pids: Sequence[int]) -> None:
        """Start measuring.

        Args:
            pids: of the processes.
        """
        self.time_s = 0.0
        self._pids = pids
        self._cores = len(os.sched_getaffinity(0))
        self._now = time.monotonic()

    def look(self) -> None:
        """Add the time since the last call."""
        now = time.monotonic()
        own = _runnable(self._pids)
        # all runnable threads of the machine, without this one
        others = int(Path("/proc/loadavg").read_text().split()[3].partition("/")[0]) - 1 - own
        self.time_s += (now - self._now) / slowed(own, max(others, 0), self._cores)
        self._now = now


def slowed(own: int, others: int, cores: int) -> float:
    """Return the factor by which other runnable threads slow some threads down.

    Args:
        own: number of these threads that are runnable.
        others: number of other runnable threads.
        cores: number of shared cores.
    """
    if not own:
        return 1.0
    return max(1.0, (own + others) / cores) / max(1.0, own / cores)


def _runnable(pids: Sequence[int]) -> int:
    """Count the runnable threads of some processes."""
    count = 0
    for pid in pids:
        tasks: list[Path] = []
        # the process, or the thread, may have ended
        with suppress(OSError):
            tasks = sorted(Path(f"/proc/{pid}/task").iterdir())
        for task in tasks:
            with suppress(OSError):
                count += (task / "stat").read_text().rpartition(")")[2].split()[0] == "R"
    return count


def interrupt(name: str, rng: Generator) -> str:
    """Start a verb and send it a signal at a random moment; return a complaint or "".

    Args:
        name: of VERBS.
        rng: draws signal and moment.
    """
    verb = VERBS[name]
    number = signal.SIGINT if rng.random() < 0.5 else signal.SIGTERM
    moment = float(rng.uniform(0.0, verb.moments))
    mark = uuid.uuid4().hex
    with claimed_domain() as domain, tempfile.TemporaryDirectory(prefix="ares-fault-") as text:
        folder = Path(text)
        names = {"{bag}": "", "{new}": str(folder / "new")}
        if "{bag}" in verb.words:
            names["{bag}"] = str(_a_bag())
        if "{torn}" in verb.words:
            names["{torn}"] = str(_a_torn_bag())
        words = list(verb.words)
        for key, value in names.items():
            words = [word.replace(key, value) for word in words]
        before = set(map(str, SHARED.iterdir()))
        with (folder / "said").open("w+") as said:
            process = subprocess.Popen(
                [sys.executable, "-m", "ares_bringup", *words],
                env={**os.environ, "ROS_DOMAIN_ID": str(domain), MARK: mark},
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                cwd=folder,
                process_group=0,
            )
            try:
                complaint, mapped = _end(process, number, moment, mark)
            finally:
                process.kill()
                process.wait()
            left = leftovers(mark)
            said.seek(0)
            output = said.read()
        if complaint:
            return f"{complaint}: {output.strip()[-200:]}"
        if "Traceback" in output:
            return f"a traceback: {output.strip()[-300:]}"
        # files left by others may be mapped too, or in use; ports stay for reuse, and those below
        # 7400 are shared by the flights of all domains
        new = {path for path in mapped - before if PORT not in path}
        kept = {path for path in new if Path(path).exists()}
        left += sorted(kept - shared_memory(all_pids()))
        if left:
            return "left behind: " + "; ".join(left)
        interrupted = (130,) if number == signal.SIGINT else verb.terminated
        expected = (0, 1, *interrupted)
        if process.returncode not in expected:
            return f"exit status {process.returncode} after {signal.Signals(number).name}"
        return _unreadable(folder / "new") if name.startswith(("fly", "bag repair")) else ""


def _end(
    process: "subprocess.Popen[bytes]", number: int, moment: float, mark: str
) -> tuple[str, set[str]]:
    """Send the signal at its moment and wait for the end.

    Returns:
        A complaint or ""; the files in shared memory that its processes had mapped.
    """
    while not _takes_signals(process.pid) and process.poll() is None:
        time.sleep(LOOK_PERIOD)
    with suppress(subprocess.TimeoutExpired):
        process.wait(moment)
        return "", set()
    pids = list(marked(mark))
    mapped = shared_memory(pids)
    what = f"after {signal.Signals(number).name} at {moment:.2f} s"
    begun = time.monotonic()
    given = Given(pids)
    process.send_signal(number)
    while process.poll() is None:
        if time.monotonic() - begun > HUNG_AFTER:
            return f"hung {what}", mapped
        time.sleep(LOOK_PERIOD)
        given.look()
    if given.time_s > END_WITHIN:
        took = time.monotonic() - begun
        return f"took {took:.1f} s to end, {given.time_s:.1f} s of them its own, {what}", mapped
    return "", mapped


def _takes_signals(pid: int) -> bool:
    """Tell whether a process has a handler, so that Python's own start-up is over."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return False
    caught = next((int(line.split()[1], 16) for line in lines if line.startswith("SigCgt")), 0)
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def _unreadable(bag: Path) -> str:
    """Describe the faults of a bag; "" if it has none or does not exist."""
    if not bag.exists():
        return ""
    try:
        return "; ".join(map(str, verify(bag).findings))
    except BagError as error:
        return str(error)

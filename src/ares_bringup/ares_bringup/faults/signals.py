"""SIGINT and SIGTERM at any moment of every verb that takes a while."""

import atexit
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from numpy.random import Generator

from ares_bags.errors import BagError
from ares_bags.verify import verify
from ares_bringup.faults.scene import MARK, leftovers, marked
from ares_node.domains import claimed_domain

#: Wall time in s for a command to end after a signal. On a machine that does more than it has
#: cores for it is longer in proportion.
END_WITHIN = 2.0
#: Wall time in s after which a command that does not end is killed.
HUNG_AFTER = 60.0
#: Wall time in s in which the signal comes, counted from when the command takes signals.
MOMENTS = 5.0
LOOK_PERIOD = 0.005
SHARED_MEMORY = Path("/dev/shm")


@dataclass(frozen=True)
class Verb:
    """A command line that runs for a while.

    Attributes:
        words: after `ares`; {bag} is a bag to read, {new} a name in a new folder.
        terminated: exit statuses after SIGTERM; a flight that has begun takes it for an
            interruption.
    """

    words: tuple[str, ...]
    terminated: tuple[int, ...] = (143,)


VERBS = {
    "fly": Verb(("fly", "--pace", "100", "--bag", "{new}"), (130, 143)),
    "fly --in-process": Verb(
        ("fly", "--in-process", "--pace", "100", "--bag", "{new}"), (130, 143)
    ),
    "fly --live": Verb(
        ("fly", "--live", "--no-browser", "--pace", "100", "--no-record"), (130, 143)
    ),
    "montecarlo": Verb(("montecarlo", "-n", "30000", "--workers", "1", "--out", "{new}")),
    "optimize": Verb(("optimize", "--method", "direct20")),
    "reproduce": Verb(("reproduce", "--out", "{new}")),
    "replay": Verb(("replay", "{bag}", "--pace", "100")),
    "replay --check": Verb(("replay", "{bag}", "--check")),
    "report": Verb(("report", "{bag}", "--out", "{new}.html")),
    "plot": Verb(("plot", "{bag}", "--out", "{new}.png")),
    "live": Verb(("live", "--no-browser")),
    "faults": Verb(("faults", "-n", "3", "--rows", "guidance")),
    "bag verify": Verb(("bag", "verify", "{bag}")),
}


@cache
def _a_bag() -> Path:
    """A bag to read; removed with this process."""
    folder = Path(tempfile.mkdtemp(prefix="ares-fault-bag-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    bag = folder / "bag"
    words = ("fly", "--in-process", "--bag", str(bag))
    subprocess.run(
        [sys.executable, "-m", "ares_bringup", *words], check=True, capture_output=True, timeout=300
    )
    return bag


def shared_memory(pids: list[int]) -> set[str]:
    """Files in shared memory that processes have mapped."""
    found = set()
    for pid in pids:
        with suppress(OSError):
            lines = Path(f"/proc/{pid}/maps").read_text().splitlines()
            found |= {line.split()[-1] for line in lines if f"{SHARED_MEMORY}/" in line}
    return found


def _all_pids() -> list[int]:
    return [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]


def interrupt(name: str, rng: Generator) -> str:
    """Start a verb, send it a signal at a random moment; what was wrong, or nothing.

    Args:
        name: of VERBS.
        rng: draws signal and moment.
    """
    verb = VERBS[name]
    number = signal.SIGINT if rng.random() < 0.5 else signal.SIGTERM
    moment = float(rng.uniform(0.0, MOMENTS))
    mark = uuid.uuid4().hex
    with claimed_domain() as domain, tempfile.TemporaryDirectory(prefix="ares-fault-") as text:
        folder = Path(text)
        names = {"{bag}": "", "{new}": str(folder / "new")}
        if any("{bag}" in word for word in verb.words):
            names["{bag}"] = str(_a_bag())
        words = list(verb.words)
        for key, value in names.items():
            words = [word.replace(key, value) for word in words]
        before = set(map(str, SHARED_MEMORY.iterdir()))
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
                complaint = _end(process, number, moment, mark, before)
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
        if left:
            return "left behind: " + "; ".join(left)
        interrupted = (130,) if number == signal.SIGINT else verb.terminated
        expected = (0, 1, *interrupted)
        if process.returncode not in expected:
            return f"exit status {process.returncode} after {signal.Signals(number).name}"
        return _unreadable(folder / "new") if name.startswith("fly") else ""


def _end(
    process: "subprocess.Popen[bytes]", number: int, moment: float, mark: str, before: set[str]
) -> str:
    """Send the signal when it is time, and wait for the end; what was wrong, or nothing."""
    while not _takes_signals(process.pid) and process.poll() is None:
        time.sleep(LOOK_PERIOD)
    with suppress(subprocess.TimeoutExpired):
        process.wait(moment)
        return ""
    # what somebody else has left there is mapped too
    ours = shared_memory(list(marked(mark))) - before
    begun = time.monotonic()
    process.send_signal(number)
    try:
        process.wait(HUNG_AFTER)
    except subprocess.TimeoutExpired:
        return f"hung after {signal.Signals(number).name} at {moment:.2f} s"
    took = time.monotonic() - begun
    load = max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
    if took > END_WITHIN * load:
        return f"took {took:.1f} s to end after {signal.Signals(number).name} at {moment:.2f} s"
    kept = {path for path in ours if Path(path).exists()} - shared_memory(_all_pids())
    return f"left in shared memory: {', '.join(sorted(kept))}" if kept else ""


def _takes_signals(pid: int) -> bool:
    """Whether Python's own start is over, in which no program can do anything about a signal."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return False
    caught = next((int(line.split()[1], 16) for line in lines if line.startswith("SigCgt")), 0)
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def _unreadable(bag: Path) -> str:
    """What is wrong with a bag, if there is one."""
    if not bag.exists():
        return ""
    try:
        return "; ".join(map(str, verify(bag).findings))
    except BagError as error:
        return str(error)

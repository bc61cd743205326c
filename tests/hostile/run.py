# SPDX-License-Identifier: Apache-2.0
"""The loop: numbered inputs from a seed, their outcomes, and each failing one in a file."""

import faulthandler
import resource
import time
import traceback
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from struct import Struct

from hostile.target import Target

#: Time in s that one input may take, CPU time and time in which it waits for something else than a
#: processor, however busy the machine is; inputs that take longer than DEAD, wall time in s, end
#: the process with a trace of where it is: nothing else could.
LONGEST = 5.0
DEAD = 120.0
#: Inputs that may take so long together: to watch each would take as long as a fast one.
WATCHED = 32
#: Inputs of all targets in a round, and of one after how many it forgets, if it has a memory.
ROUND = 20_000
FORGET_EVERY = 5_000
#: Inputs before memory is measured the first time, and how much the process may then grow, bytes.
WARM = 50_000
MOST_GROWTH = 100 * 2**20
#: Failures of one kind that are kept as files.
MOST_KEPT = 3
#: Its descriptor: a target that draws takes `sys.stderr`.
STANDARD_ERROR = 2
_LENGTH = Struct("<I")


def queued() -> float:
    """Return the time in s for which this thread was runnable without a processor."""
    return int(Path("/proc/thread-self/schedstat").read_text().split()[1]) / 1e9


def memory() -> int:
    """Return the resident memory of this process, bytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize()


def pack(inputs: Iterable[bytes]) -> bytes:
    """Join inputs to one file."""
    return b"".join(_LENGTH.pack(len(data)) + data for data in inputs)


def unpack(data: bytes) -> Iterator[bytes]:
    """Yield the inputs of a file."""
    at = 0
    while at < len(data):
        (length,) = _LENGTH.unpack_from(data, at)
        at += _LENGTH.size
        yield data[at : at + length]
        at += length


@dataclass
class Account:
    """Count the outcomes of one target's inputs.

    Attributes:
        inputs: number of inputs.
        outcomes: counts by word.
        failures: counts by text.
        slowest_s: CPU time of the slowest input.
        seconds: wall time of all.
    """

    inputs: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    failures: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0
    seconds: float = 0.0

    def as_json(self) -> dict[str, object]:
        """Return the account for a file."""
        return {
            "inputs": self.inputs,
            "outcomes": dict(self.outcomes.most_common()),
            "failures": dict(self.failures.most_common()),
            "slowest_s": round(self.slowest_s, 3),
            "seconds": round(self.seconds, 1),
        }


class Run:
    """Run inputs on some targets in turn.

    Attributes:
        accounts: by name of the target.
    """

    def __init__(self, targets: Sequence[Target], seed: int, folder: Path) -> None:
        """Start without inputs.

        Args:
            targets: already entered.
            seed: of all inputs.
            folder: for failing inputs.
        """
        self.targets = targets
        self.accounts = {target.name: Account() for target in targets}
        self._seed = seed
        self._folder = folder
        self._settled: int | None = None
        self._before: dict[str, deque[bytes]] = {
            target.name: deque(maxlen=FORGET_EVERY if target.stateful else 1) for target in targets
        }

    @property
    def inputs(self) -> int:
        """Return the number of inputs so far."""
        return sum(account.inputs for account in self.accounts.values())

    @property
    def failures(self) -> int:
        """Return the number of failures; growth counts as one."""
        failed = sum(account.failures.total() for account in self.accounts.values())
        return failed + (self.grown > MOST_GROWTH)

    @property
    def grown(self) -> int:
        """Return the growth of the process since WARM inputs, bytes, without the inputs kept."""
        return 0 if self._settled is None else memory() - self._kept - self._settled

    @property
    def _kept(self) -> int:
        return sum(len(data) for before in self._before.values() for data in before)

    def input(self, target: Target, number: int) -> bytes:
        """Make the input of a number."""
        return target.make(Random(f"{self._seed} {target.name} {number}"))

    def round(self, inputs: int = ROUND) -> None:
        """Run inputs on each target, by its share."""
        for target in self.targets:
            self.block(target, max(1, round(inputs * target.share / 100.0)))
        if self._settled is None and self.inputs >= WARM:
            self._settled = memory() - self._kept

    def block(self, target: Target, count: int) -> None:
        """Run the next `count` inputs on a target."""
        account = self.accounts[target.name]
        for k in range(count):
            if k % WATCHED == 0:
                faulthandler.dump_traceback_later(DEAD, exit=True, file=STANDARD_ERROR)
            self._one(target, account)
        faulthandler.cancel_dump_traceback_later()

    def _one(self, target: Target, account: Account) -> None:
        number = account.inputs
        if target.stateful and number and number % FORGET_EVERY == 0:
            target.begin()
            self._before[target.name].clear()
        waited = queued()
        begun = time.perf_counter()
        cpu = time.process_time()
        try:
            data = self.input(target, number)
            self._before[target.name].append(data)
            cpu = time.process_time()
            account.outcomes[target.run(data)] += 1
        except Exception as error:
            account.outcomes["broken"] += 1
            self._failed(target, account, _where(error))
            if target.stateful:
                target.begin()
                self._before[target.name].clear()
        took = time.process_time() - cpu
        passed = time.perf_counter() - begun
        account.inputs += 1
        account.seconds += passed
        account.slowest_s = max(account.slowest_s, took)
        if took > LONGEST or (passed > LONGEST and passed - (queued() - waited) > LONGEST):
            self._failed(target, account, f"took more than {LONGEST:g} s")

    def _failed(self, target: Target, account: Account, text: str) -> None:
        account.failures[text] += 1
        if account.failures[text] > MOST_KEPT:
            return
        self._folder.mkdir(parents=True, exist_ok=True)
        name = f"{target.name.replace(' ', '_')}_{account.inputs}"
        (self._folder / f"{name}.bin").write_bytes(pack(self._before[target.name]))
        trace = traceback.format_exc()
        (self._folder / f"{name}.txt").write_text(f"{text}\n\n{trace}", encoding="utf-8")

    def as_json(self) -> dict[str, object]:
        """Return the results so far for a file."""
        return {
            "seed": self._seed,
            "grown_mib": round(self.grown / 2**20, 1),
            "failed": self.failures,
            "targets": {name: one.as_json() for name, one in self.accounts.items()},
        }


def _where(error: Exception) -> str:
    """Describe an exception and its place in the project, without varying details."""
    steps = traceback.extract_tb(error.__traceback__)
    ours = [
        step for step in steps if "/ares_" in step.filename and "/hostile/" not in step.filename
    ]
    step = ours[-1] if ours else steps[-1]
    words = str(error) if type(error).__name__ == "Broken" else ""
    place = f"{Path(step.filename).name}:{step.name}"
    return f"{type(error).__name__} in {place} {words[:80]}".strip()

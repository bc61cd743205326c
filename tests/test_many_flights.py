# SPDX-License-Identifier: Apache-2.0
"""Consecutive flights hold no more resources than the first ones."""

import gc
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from ares_bringup.fly import fly
from ares_bringup.held import used_by_family
from ares_bringup.options import FlyOptions
from ares_trials.testing.flights import short_burn
from ares_trials.testing.held import Held, held, orphans

#: MiB that allocators may still take after the first flights.
SLACK = 8.0
#: Seconds after a flight in which no shared memory of it may be left mapped.
RELEASE = 20.0


def settled() -> Held:
    """Return the resources held once the middleware has released ended processes (1 s)."""
    until = time.monotonic() + RELEASE
    while (now := held()).mapped > 0 and time.monotonic() < until:
        time.sleep(0.05)
    return now


def fly_many(folder: Path, count: int, in_process: bool) -> None:
    """Fly in a separate process, so that resources of other tests do not count."""
    mission = folder / "burn.yaml"
    mission.write_text(yaml.safe_dump(short_burn(60.0)))
    used: set[str] = set()
    rows = []
    for number in range(count):
        bag = folder / f"{number}"
        options = FlyOptions(mission=str(mission), in_process=in_process, bag=bag)
        summary = fly(options, show=lambda _monitor: used.update(used_by_family()))
        assert summary.exit_code == 0, summary.verdict
        gc.collect()
        rows.append(settled())
    first, last = rows[count // 3], rows[-1]
    assert last.memory_mib < first.memory_mib + SLACK, (first, last)
    assert last.descriptors <= first.descriptors, (first, last)
    assert last.threads <= first.threads, (first, last)
    assert last.mapped == 0, last
    assert last.children == 0
    assert used
    assert orphans(used) == set()


@pytest.mark.trial
@pytest.mark.parametrize(("count", "in_process"), [(9, True), (2, False)])
def test_what_is_held_stays_as_it_is(tmp_path: Path, count: int, in_process: bool) -> None:
    words = [str(tmp_path), str(count), "yes" if in_process else ""]
    done = subprocess.run(
        [sys.executable, __file__, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


if __name__ == "__main__":
    fly_many(Path(sys.argv[1]), int(sys.argv[2]), bool(sys.argv[3]))

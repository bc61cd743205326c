# SPDX-License-Identifier: Apache-2.0
"""Files that once crashed, hung or printed a traceback: judged, or refused in one line at once."""

import time

import pytest

from ares_trials.sweep.attempts import MISSION, WARNING
from ares_trials.sweep.inputs import to_yaml
from ares_trials.sweep.plan import bases
from ares_trials.testing.samples import one_in

#: s, of a command that computes; the machine may be busy.
AT_ONCE = 30.0

#: Key path, value; whether it is refused.
CASES = {
    "exhaust of light years": ("environment.g0_m_s2", 1e9, True),
    "exhaust beyond numbers": ("environment.g0_m_s2", 1e308, True),
    "start of 30 years": ("stages.2.start", [[0.0, 0.0], [1e9, 1.0]], True),
    "jettison at no time": ("jettisons.2.time_s", 1e308, True),
    "coast beyond ten days": ("stages.1.arcs.2.coast_s", 863_900.0, True),
    "kick stage of 1 N": ("stages.2.thrust_n", 1.0, False),
    "coast of a day": ("stages.1.arcs.2.coast_s", 1e5, False),
    "coast of nine days": ("stages.1.arcs.2.coast_s", 8e5, False),
}
SOLVE = ("optimize", "--method", "indirect", "--time-limit", "1", "--json", "--mission")


@pytest.mark.parametrize("case", one_in(2, CASES))
@pytest.mark.parametrize("words", [("missions",), SOLVE], ids=["missions", "optimize"])
def test_what_is_absurd_is_answered(tmp_path, ares, case, words):
    data = bases(MISSION)["elements"]
    path, value, refused = CASES[case]
    *way, last = (int(key) if key.isdigit() else key for key in path.split("."))
    at = data
    for key in way:
        at = at[key]
    at[last] = value
    file = tmp_path / "absurd.yaml"
    file.write_text(to_yaml(data))
    begun = time.monotonic()
    done = ares(*words, str(file))
    assert time.monotonic() - begun < AT_ONCE
    lines = done.stderr.splitlines()
    assert all(len(line) < 400 and "Traceback" not in line for line in lines)
    if refused:
        assert done.returncode == 2
        assert len(lines) == 1
        return
    # no such flight finds its way within the time; it is not called one
    assert done.returncode in ((0,) if words == ("missions",) else (1, 4))
    assert all(line.startswith(WARNING) for line in lines)
    # but that the thrust is hardly meant is said
    assert bool(lines) == (case == "kick stage of 1 N")

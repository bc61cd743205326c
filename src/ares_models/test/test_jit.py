# SPDX-License-Identifier: Apache-2.0
"""Bounds checks for `make boundscheck`: a kernel that leaves its arrays raises, wherever it is."""

import os
import subprocess
import sys

import pytest

KERNELS = """
import threading

import numpy as np

from ares_models.arrays import ARC
from ares_models.jit import kernel


@kernel
def read(values, i):
    return values[i]


@kernel
def read_within(values, i):
    return 2.0 * read(values, i)


@kernel
def write(values, i):
    values[i] = 1.0


@kernel
def write_field(arcs, k, i):
    arc = arcs[k]
    arc.start_time[i] = 1.0


def said(call):
    try:
        call()
    except IndexError as error:
        return str(error)


def said_in_thread(call):
    found = []
    thread = threading.Thread(target=lambda: found.append(said(call)))
    thread.start()
    thread.join()
    return found[0]


values, arcs = np.zeros(4), np.zeros(2, ARC)
calls = (
    lambda: read(values, 4),
    lambda: read_within(values, 4),
    lambda: write(values, 4),
    lambda: write_field(arcs, 2, 0),
    lambda: write_field(arcs, 1, arcs["start_time"].shape[1]),
)
for call in calls:
    print(said(call), said_in_thread(call), sep="\\n")
"""


def run_kernels(text, folder, **environment):
    """Run a module of kernels with a cache of its own, in a process of its own."""
    script = folder / "kernels_of_a_test.py"
    script.write_text(text)
    return subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_an_index_beyond_its_array_raises(tmp_path):
    done = run_kernels(KERNELS, tmp_path, NUMBA_BOUNDSCHECK="1")
    assert done.stdout == 10 * "index is out of bounds\n", done.stderr


COPIES = """
import ares_template_of_a_test
from ares_models.jit import kernel, specialised


@kernel
def {0}(x):
    return x + {1}


def of(name):
    return specialised("ares_template_of_a_test", name, part={0}).whole


print(ares_template_of_a_test.whole(1.0), of("{0}")(1.0), of("{0}") is of("{0}"))
# a caller of a copy
print(specialised("ares_template_of_a_test", "{0}_again", part=of("{0}")).whole(1.0))
"""


@pytest.mark.trial
def test_a_specialised_module_is_compiled_and_kept_apart(tmp_path):
    template = """
from ares_models.jit import kernel


@kernel
def part(x):
    return x


@kernel
def whole(x):
    return 10.0 * part(x)
"""
    (tmp_path / "ares_template_of_a_test.py").write_text(template)
    path = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    cache = str(tmp_path / "cache")
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": cache}
    # Python's own cache misses an edit within the same second
    environment["PYTHONDONTWRITEBYTECODE"] = "1"
    # twice each, the second time from the cache; an edit is recompiled
    for name, number, said in (
        ("one", 1.0, "10.0 20.0 True\n200.0\n"),
        ("one", 1.0, "10.0 20.0 True\n200.0\n"),
        ("two", 2.0, "10.0 30.0 True\n300.0\n"),
        ("two", 4.0, "10.0 50.0 True\n500.0\n"),
        ("one", 1.0, "10.0 20.0 True\n200.0\n"),
    ):
        script = tmp_path / "kernels_of_others.py"
        script.write_text(COPIES.format(name, number))
        command = [sys.executable, "-c", "import kernels_of_others"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (done.stdout, done.stderr) == (said, "")


LINKED = """
from ares_models.jit import kernel


@kernel
def part(x, i):
    return x + i


@kernel
def whole(x):
    return part(x, 1) + part(x, 2)


print(whole(1.0), len(part.linked.signatures), part.machine_code.signatures)
print(part(1.0, 3))
"""


def test_a_kernel_is_linked_once_for_all_literals_and_compiled_when_python_calls(tmp_path):
    # the second time from the cache, where nothing is linked any more
    for linked in (1, 0):
        done = run_kernels(LINKED, tmp_path)
        assert (done.stdout, done.stderr) == (f"5.0 {linked} []\n4.0\n", "")


ALLOCATES = """
import numpy as np
from ares_models.jit import allocating, kernel


@allocating
def summed(n):
    return np.ones(n).sum()


@kernel
def twice(n):
    return 2.0 * summed(n)


print(twice(3))
"""


@pytest.mark.trial
def test_a_kernel_loaded_from_the_cache_may_call_one_that_makes_arrays(tmp_path):
    for _ in range(2):
        done = run_kernels(ALLOCATES, tmp_path)
        assert (done.stdout, done.stderr) == ("6.0\n", "")


BY_PLAIN_NUMBA = """
import sys

from ares_models.jit import PLAIN
from ares_models.kernels.coast import coast
from ares_models.kernels.environment import heating_rate
from ares_models.mission import load_mission

arrays = load_mission("ares_v").arrays()
environment = arrays.environment[0]
r, v = (6.6e6, 1.0e5, 2.0e6), (-500.0, 7.4e3, 800.0)
print(coast(r, v, 2.5e3, environment), heating_rate(r, v, environment, arrays.atmosphere))
print(PLAIN, "ares_models.linked" in sys.modules, file=sys.stderr)
"""


def test_numba_without_its_private_parts_gives_the_same_numbers(tmp_path):
    there = os.environ["NUMBA_CACHE_DIR"]
    linked = run_kernels(BY_PLAIN_NUMBA, tmp_path, NUMBA_CACHE_DIR=there)
    plain = run_kernels(BY_PLAIN_NUMBA, tmp_path, ARES_PLAIN_NUMBA="1")
    assert (linked.stderr, plain.stderr) == ("False True\n", "True False\n")
    assert plain.stdout == linked.stdout != ""


FLIGHT = """
from ares_models.mission import load_mission
from ares_studies.closed_loop import fly_compiled

plant = fly_compiled(load_mission("ares_v")).plant
print(plant["mass"], plant["position"], plant["velocity"])
"""


@pytest.mark.trial
@pytest.mark.timeout(1800)
def test_a_flight_without_numbas_private_parts_is_the_same(tmp_path):
    linked = run_kernels(FLIGHT, tmp_path, NUMBA_CACHE_DIR=os.environ["NUMBA_CACHE_DIR"])
    plain = run_kernels(FLIGHT, tmp_path, ARES_PLAIN_NUMBA="1")
    assert plain.stdout == linked.stdout != "", plain.stderr

# SPDX-License-Identifier: Apache-2.0
"""A mission to a transfer orbit given by elements, through the commands."""

import json
from importlib import resources

import pytest

TARGET = """\
target:
  perigee_altitude_m: 185000.0
  apogee_altitude_m: 35786000.0
  inclination_deg: 28.5
  argument_of_perigee_deg: 125.0
"""
NAMED = {"perigee_radius_m", "apogee_radius_m", "inclination_deg", "argument_of_perigee_deg"}
#: By `ares optimize --method indirect`, kg.
OPTIMUM = 99_952.36


@pytest.fixture(scope="module")
def transfer(tmp_path_factory):
    text = resources.files("ares_models").joinpath("missions", "ares_v.yaml").read_text()
    path = tmp_path_factory.mktemp("missions") / "transfer.yaml"
    path.write_text(text[: text.index("target:")] + TARGET)
    return str(path)


@pytest.mark.parametrize("law", ["optimal", pytest.param("peg", marks=pytest.mark.trial)])
def test_it_is_flown_and_judged_by_what_it_names(ares, transfer, law):
    options = ("--in-process", "--no-record", "--json", "--nav-period", "1")
    done = ares("fly", "--mission", transfer, "--guidance", law, *options)
    assert done.returncode == 0, done.stderr
    flight = json.loads(done.stdout)
    assert flight["outcome"] == "target"
    known = {key for key, value in flight["insertion_error"].items() if value is not None}
    assert known == NAMED
    assert abs(flight["insertion_error"]["perigee_radius_m"]) < 10.0
    assert abs(flight["insertion_error"]["apogee_radius_m"]) < 100.0
    assert 0.9995 * OPTIMUM < flight["m_f_kg"] < OPTIMUM + 0.1


@pytest.mark.parametrize("method", ["indirect", "direct11"])
def test_it_is_optimized_and_proven(ares, transfer, method):
    done = ares("optimize", "--mission", transfer, "--method", method, "--json")
    assert done.returncode == 0, done.stderr
    solution = json.loads(done.stdout)
    assert solution["converged"]
    assert solution["m_f_kg"] == pytest.approx(OPTIMUM, abs=0.2)


def test_the_summary_shows_the_errors_of_what_is_named(ares, transfer):
    words = ("fly", "--mission", transfer, "--in-process", "--no-record")
    done = ares(*words, "--nav-period", "1")
    assert done.returncode == 0, done.stderr
    for words in ("error of perigee radius:", "error of apogee radius:", "error of argument of"):
        assert words in done.stdout
    assert "nan" not in done.stdout
    target = next(line for line in done.stdout.splitlines() if line.startswith("target"))
    assert target.split() == ["target", "-", "-", "-", "28.500000"]

# SPDX-License-Identifier: Apache-2.0
"""Atmospheres against their sources; value and slope continuous."""

import csv
import math
import sys
from datetime import UTC, datetime
from importlib import resources
from itertools import pairwise

import numpy as np
import pytest

from ares_models import atmosphere
from ares_models.kernels.environment import log_density

MIDSUMMER = datetime(2010, 6, 21, 12, tzinfo=UTC)

MODELS = {
    "pra63": atmosphere.pra63,
    "pra63_data": atmosphere.pra63_data,
    "pra63_exponential": atmosphere.pra63_exponential,
    "us76": atmosphere.us76,
    "nrlmsis": lambda: atmosphere.nrlmsis(MIDSUMMER, 28.5, -80.6, 150.0, 150.0, 4.0),
}

# independent evaluations at 28.5 N, kg/m3: (km, US62, US76)
CROSS_CHECK = [
    (90, 3.170e-6, 3.416e-6),
    (100, 4.973e-7, 5.604e-7),
    (110, 9.829e-8, 9.708e-8),
    (120, 2.436e-8, 2.222e-8),
    (130, 7.589e-9, 8.152e-9),
    (140, 3.394e-9, 3.831e-9),
    (150, 1.835e-9, 2.076e-9),
]

# NRLMSIS 2.1 over a year at 28.5 N, F10.7 = 150, Ap = 4: (km, least, most), kg/m3
MSIS_RANGE = [
    (90, 2.59e-6, 3.17e-6),
    (100, 3.95e-7, 5.86e-7),
    (110, 5.97e-8, 10.0e-8),
    (120, 1.29e-8, 2.09e-8),
    (130, 5.01e-9, 6.88e-9),
    (140, 2.47e-9, 3.40e-9),
    (150, 1.38e-9, 1.94e-9),
]

# US Standard Atmosphere 1976, NOAA-S/T 76-1562, table I: (km, kg/m3)
US76_PUBLISHED = [
    (0, 1.2250),
    (5, 7.3643e-1),
    (11, 3.6480e-1),
    (20, 8.8910e-2),
    (32, 1.3555e-2),
    (50, 1.0269e-3),
    (70, 8.2829e-5),
    (80, 1.8458e-5),
    (86, 6.958e-6),
    (90, 3.416e-6),
    (100, 5.604e-7),
    (120, 2.222e-8),
    (150, 2.076e-9),
    (200, 2.541e-10),
    (300, 1.916e-11),
    (400, 2.803e-12),
    (500, 5.215e-13),
    (600, 1.137e-13),
    (700, 3.070e-14),
    (800, 1.136e-14),
    (900, 5.759e-15),
    (1000, 3.561e-15),
]


def read(name):
    text = resources.files("ares_models").joinpath("data", "atmosphere", name).read_text()
    return [[float(x) for x in row.values()] for row in csv.DictReader(text.splitlines())]


@pytest.mark.parametrize("model", MODELS)
def test_value_and_slope_are_continuous(model):
    table = MODELS[model]().table
    width = np.diff(table[:, 0])
    assert np.all(width > 0.0)
    # density, then pressure
    for first in (1, 5):
        c0, c1, c2, c3 = table[:-1, first : first + 4].T
        value = c0 + width * (c1 + width * (c2 + width * c3))
        slope = c1 + width * (2.0 * c2 + width * 3.0 * c3)
        assert np.allclose(value, table[1:, first], rtol=0.0, atol=1e-13)
        assert np.allclose(slope, table[1:, first + 1], rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("model", MODELS)
def test_density_falls_everywhere_also_beyond_the_table(model):
    air = MODELS[model]()
    altitudes = np.arange(-20e3, 1500e3, 137.0)
    slopes = [air.log_density(h)[1] for h in altitudes]
    assert max(slopes) < 0.0
    assert min(slopes) > -1.0 / 3e3


@pytest.mark.parametrize("model", MODELS)
def test_slope_is_the_derivative_of_the_value(model):
    air = MODELS[model]()
    for h in np.arange(-5e3, 800e3, 3331.0):
        ahead, behind = air.log_density(h + 0.5)[0], air.log_density(h - 0.5)[0]
        assert air.log_density(h)[1] == pytest.approx(ahead - behind, rel=1e-5)


@pytest.mark.parametrize("model", MODELS)
def test_beyond_the_ends_the_logarithm_is_straight(model):
    table = MODELS[model]().table
    for end, step in ((0, -5e3), (-1, 5e3)):
        value, slope = log_density(table[end, 0] + step, table)
        assert slope == table[end, 2]
        assert value == pytest.approx(table[end, 1] + step * slope, abs=1e-12)


def test_pra63_data_follows_its_data():
    air = atmosphere.pra63_data()
    for h, _, rho in read("pra63_0_66km.csv"):
        assert air.density(h) == pytest.approx(rho, rel=1e-3)
    for km, rho in read("us62_80_700km.csv"):
        if km >= 90.0:
            assert air.density(1e3 * km) == pytest.approx(rho, rel=1e-3)
    for km, us62, _ in CROSS_CHECK:
        assert air.density(1e3 * km) == pytest.approx(us62, rel=1.5e-3)


def test_pra63_goes_through_the_reference_densities_with_two_smooth_derivatives():
    air, data = atmosphere.pra63(), atmosphere.pra63_data()
    for km, rho, _ in THESIS_FORM[1:-1]:
        reach = 2e-3 if km == 90 else 1e-4
        assert air.density(1e3 * km) == pytest.approx(rho, rel=reach)
    inner = air.table[(air.table[:, 0] > 91e3) & (air.table[:, 0] < 159e3)]
    for before, after in pairwise(inner):
        width = after[0] - before[0]
        assert 2.0 * before[3] + 6.0 * before[4] * width == pytest.approx(2.0 * after[3], abs=1e-13)
    for h in (30e3, 62.5e3, 80e3, 200e3, 500e3):
        assert air.density(h) == pytest.approx(data.density(h), rel=1e-12)
    worst = max(abs(air.density(h) / data.density(h) - 1.0) for h in np.arange(90e3, 160e3, 50))
    assert worst < 0.016


def test_pra63_data_bridges_66_to_90_km_log_linearly():
    air = atmosphere.pra63_data()
    scale_height = -1.0 / air.log_density(80e3)[1]
    assert scale_height == pytest.approx(6185.3, abs=0.1)
    assert air.log_density(67e3)[1] == pytest.approx(-1.0 / scale_height, rel=1e-12)
    assert air.log_density(89e3)[1] == pytest.approx(-1.0 / scale_height, rel=1e-12)


# (km, reference density kg/m3, scale height km) of Eq. 2.12 over PRA-63 and US62
THESIS_FORM = [
    (66, 1.5353e-4, 6.1853),
    (90, 3.1698e-6, 5.1961),
    (95, 1.2110e-6, 5.6188),
    (100, 4.9735e-7, 5.8527),
    (105, 2.1166e-7, 6.5184),
    (110, 9.8290e-8, 6.6282),
    (115, 4.6227e-8, 7.8031),
    (120, 2.4357e-8, 7.7265),
    (125, 1.2752e-8, 9.6343),
    (130, 7.5890e-9, 12.4257),
    (140, 3.3937e-9, 16.2702),
    (150, 1.8354e-9, 21.7387),
    (160, 1.1587e-9, 29.3223),
]


def test_exponential_form_is_the_table_away_from_its_kinks():
    air = atmosphere.pra63_exponential()
    for km, rho, scale_height in THESIS_FORM:
        for above in (0.3, 1.0, 3.0):
            expected = rho * math.exp(-above / scale_height)
            assert air.density(1e3 * (km + above)) == pytest.approx(expected, rel=2e-4)
        assert air.density(1e3 * km) == pytest.approx(rho, rel=2.5e-3)


def test_exponential_form_stays_near_the_data():
    fine, coarse = atmosphere.pra63_data(), atmosphere.pra63_exponential()
    worst = max(abs(coarse.density(h) / fine.density(h) - 1.0) for h in np.arange(90e3, 200e3, 50))
    assert 0.03 < worst < 0.032


def test_us76_is_the_published_table():
    air = atmosphere.us76()
    for km, rho in US76_PUBLISHED:
        # a layer boundary is rounded, by less than 1e-3
        assert air.density(1e3 * km) == pytest.approx(rho, rel=1.2e-3), km
    for km, _, us76 in CROSS_CHECK:
        assert air.density(1e3 * km) == pytest.approx(us76, rel=5e-4), km


def test_us76_is_exact_in_the_troposphere():
    air = atmosphere.us76()
    for z in (1e3, 4e3, 9e3):
        h = 6356766.0 * z / (6356766.0 + z)
        t = 288.15 - 6.5e-3 * h
        rho = 1.2250 * (t / 288.15) ** (9.80665 * 28.9644 / (8314.32 * 6.5e-3) - 1.0)
        assert air.density(z) == pytest.approx(rho, rel=2e-5)


def test_nrlmsis_lies_in_the_year_s_range():
    for month in (1, 4, 7, 10):
        moment = datetime(2010, month, 15, 12, tzinfo=UTC)
        air = atmosphere.nrlmsis(moment, 28.5, -80.6, 150.0, 150.0, 4.0)
        for km, least, most in MSIS_RANGE:
            assert 0.9 * least < air.density(1e3 * km) < 1.1 * most


def test_nrlmsis_without_its_package_says_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymsis", None)
    with pytest.raises(atmosphere.AtmosphereError) as caught:
        atmosphere.nrlmsis(MIDSUMMER, 1.0, 2.0, 150.0, 150.0, 4.0)
    assert str(caught.value) == (
        "atmosphere model nrlmsis needs the Python package pymsis, which is not installed"
    )

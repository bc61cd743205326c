# SPDX-License-Identifier: Apache-2.0
"""Atmosphere models with one interface: a table of cubics in log density and log pressure.

Every model ends as the same table, shape (n, 9): altitude in m and the coefficients
c0..c3 of log(density in kg/m3) in the height above it, then those of log(pressure in Pa). Value and
slope are continuous, as the optimizer needs to differentiate them. The last row has values and
slopes only; the table continues linearly in both logarithms beyond both ends. The pressure is the
weight of the air above (:func:`with_pressure`).

Where a source has a kink (a layer boundary), it is rounded over ``BLEND`` metres to each
side by the cubic that meets both sides in value and slope.
"""

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from importlib import resources
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ares_models.kernels import environment as kernels
from ares_models.splines import hermite_table, monotone_slopes, spline_slopes

Array = NDArray[np.float64]

#: Half-width over which a kink between layers is rounded, m. The sharpest (66 km in
#: PRA-63, 120 km in US62) move the density there by 0.1 % and 0.07 %.
BLEND = 100.0

#: The same for the thesis-form exponentials, whose kinks are its own; at most a quarter of
#: the shorter layer. Moves the density by at most 0.25 %, at 66 km.
EXPONENTIAL_BLEND = 250.0


#: Logarithm of a density and a pressure that underflow to 0.
_NO_AIR = -1e3
#: Surface gravity, m/s2, and radius, m, of the Earth, for the weight of the air.
_EARTH = (9.80665, 6356.766e3)


class AtmosphereError(ValueError):
    """Report an atmosphere that cannot be built; the text is one line."""


@dataclass(frozen=True)
class Atmosphere:
    """Hold an atmosphere as a table.

    Attributes:
        model: name of the model.
        table: shape (n, 9), see the module text.
    """

    model: str
    table: Array

    def log_density(self, altitude: float) -> tuple[float, float]:
        """Return the logarithm of density in kg/m3 and its derivative, 1/m, at an altitude, m."""
        return kernels.log_density(float(altitude), self.table)

    def density(self, altitude: float) -> float:
        """Return the density, kg/m3, at an altitude, m."""
        return math.exp(self.log_density(altitude)[0])


@dataclass(frozen=True)
class _Piece:
    """Hold the nodes of a smooth layer: altitude m, log density, slope 1/m; profiles in rows."""

    altitude: Array
    value: Array
    slope: Array


def _pchip(altitude: ArrayLike, density: ArrayLike) -> _Piece:
    """Interpolate a layer through at least three data by the monotone cubic."""
    h = np.asarray(altitude, dtype=np.float64)
    value = np.log(np.asarray(density, dtype=np.float64))
    return _Piece(h, value, monotone_slopes(h, value))


def _straight(altitude: ArrayLike, log_density: ArrayLike) -> _Piece:
    """Interpolate a layer between two points linearly in log density."""
    h = np.asarray(altitude, dtype=np.float64)
    value = np.asarray(log_density, dtype=np.float64)
    slope = (value[1] - value[0]) / (h[1] - h[0])
    return _Piece(h, value, np.array([slope, slope]))


def with_pressure(table: Array) -> Array:
    """Add the columns of the pressure to a table of the density: the weight of the air above.

    Args:
        table: shape (..., n, 5), of :func:`hermite_table`.

    Returns:
        Shape (..., n, 9).
    """
    surface, radius = _EARTH
    h = table[..., 0]
    nodes, weights = np.polynomial.legendre.leggauss(6)
    width = np.diff(h, axis=-1)[..., None]
    x = 0.5 * width * (1.0 + nodes)
    c = [table[..., :-1, k, None] for k in range(1, 5)]
    density = np.exp(c[0] + x * (c[1] + x * (c[2] + x * c[3])))
    fall = surface * (radius / (radius + h[..., :-1, None] + x)) ** 2
    between = (0.5 * width * weights * density * fall).sum(axis=-1)
    here = np.exp(table[..., 1]) * surface * (radius / (radius + h)) ** 2
    # an isothermal layer above the table
    top = here[..., -1:] / -table[..., -1:, 2]
    pressure = np.concatenate((np.cumsum(between[..., ::-1], axis=-1)[..., ::-1], 0.0 * top), -1)
    pressure = pressure + top
    columns = hermite_table(h.reshape(-1, h.shape[-1])[0], np.log(pressure), -here / pressure)
    return np.concatenate((table, columns[..., 1:]), axis=-1)


def _trimmed(piece: _Piece, low: float, high: float) -> _Piece:
    """Shorten a piece to a range, with new end nodes on the old cubics."""
    table = hermite_table(piece.altitude, piece.value, piece.slope)
    inside = (piece.altitude > low) & (piece.altitude < high)
    ends = [kernels.log_density(end, table) for end in (low, high)]
    return _Piece(
        np.concatenate(([low], piece.altitude[inside], [high])),
        np.concatenate(([ends[0][0]], piece.value[inside], [ends[1][0]])),
        np.concatenate(([ends[0][1]], piece.slope[inside], [ends[1][1]])),
    )


def _join(pieces: Sequence[_Piece], blend: float) -> Array:
    """Join continuous layers to one C1 table by rounding the kinks between them."""
    trimmed = []
    for k, piece in enumerate(pieces):
        low, high = float(piece.altitude[0]), float(piece.altitude[-1])
        if k > 0:
            low += min(blend, 0.25 * (high - low), 0.25 * np.ptp(pieces[k - 1].altitude))
        if k < len(pieces) - 1:
            start = float(piece.altitude[0])
            high -= min(blend, 0.25 * (high - start), 0.25 * np.ptp(pieces[k + 1].altitude))
        trimmed.append(_trimmed(piece, low, high))
    return with_pressure(
        hermite_table(
            np.concatenate([piece.altitude for piece in trimmed]),
            np.concatenate([piece.value for piece in trimmed]),
            np.concatenate([piece.slope for piece in trimmed]),
        )
    )


def _read(name: str, *columns: str) -> list[Array]:
    """Read columns of a data file of this package."""
    text = resources.files("ares_models").joinpath("data", "atmosphere", name).read_text("utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    return [np.array([float(row[column]) for row in rows]) for column in columns]


_US62_LAYERS_KM = (90, 100, 110, 120, 150, 160, 170, 190, 230, 300, 400, 500, 600, 700)


def _pra63_to(base: float) -> list[_Piece]:
    """Build PRA-63 to 66 km, and the log-linear bridge to density ``base``, kg/m3, at 90 km."""
    altitude, density = _read("pra63_0_66km.csv", "h_m", "rho_kg_m3")
    ends = [math.log(density[-1]), math.log(base)]
    return [_pchip(altitude, density), _straight([altitude[-1], 1e3 * _US62_LAYERS_KM[0]], ends)]


def _us62_from(bottom_km: int) -> list[_Piece]:
    """Build US62 from one of its layer boundaries up, one smooth piece per layer."""
    km, density = _read("us62_80_700km.csv", "h_km", "rho_kg_m3")
    pieces = []
    for bottom, top in pairwise(_US62_LAYERS_KM):
        layer = (km >= bottom) & (km <= top)
        if bottom >= bottom_km:
            pieces.append(_pchip(1e3 * km[layer], density[layer]))
    return pieces


# bases of the thesis-form layers where the jettison happens, km
_REFERENCE_KM = (*range(90, 130, 5), *range(130, 161, 10))


@cache
def pra63() -> Atmosphere:
    """Build the thesis' atmosphere, smoothed: Patrick 1963 with a US Standard 1962 tail.

    Eq. 2.12 has reference densities at layer bases and an exponential between them, with a
    kink at each base. Here a cubic spline in the log density goes through the reference
    densities at 90, 95 ... 130, 140, 150, 160 km, so that an optimizer finds two continuous
    derivatives. Below and above it is :func:`pra63_data`, from which it differs by at most
    1.6 % in between.
    """
    km, density = _read("us62_80_700km.csv", "h_km", "rho_kg_m3")
    bases = np.isin(km, _REFERENCE_KM)
    h, value = 1e3 * km[bases], np.log(density[bases])
    spline = _Piece(h, value, spline_slopes(h, value))
    pieces = [*_pra63_to(float(density[bases][0])), spline, *_us62_from(_REFERENCE_KM[-1])]
    return Atmosphere("pra63", _join(pieces, BLEND))


@cache
def pra63_data() -> Atmosphere:
    """Build the Patrick 1963 atmosphere to 66 km, US Standard Atmosphere 1962 from 90 km.

    Density of PRA-63 from NASA JSC-08964, Appendix A; US62 by hydrostatic integration of
    its published layers. Between 66 and 90 km there are no data: the log density is taken
    linear there. The continuation of PRA-63 by US62 is an assumption (the thesis prints no
    coefficients). The fit follows the data within 0.1 %.
    """
    tail = _us62_from(_US62_LAYERS_KM[0])
    pieces = [*_pra63_to(math.exp(tail[0].value[0])), *tail]
    return Atmosphere("pra63_data", _join(pieces, BLEND))


# reference altitudes of the thesis-form layers over US62, km
_EXPONENTIAL_KM = (
    *range(90, 130, 5),
    *range(130, 160, 10),
    *range(160, 240, 20),
    *range(250, 701, 50),
)


@cache
def pra63_exponential() -> Atmosphere:
    """Build PRA-63 with a US62 tail in the form of Eq. 2.12: exponential layers.

    rho = rho_ref exp(-(h - h_ref) / h_scale); printed without the minus. Layers start at
    60, 66, 90, 95 ... 130, 140, 150, 160, 180, 200 km and so on, below 60 km at the points
    of the PRA-63 table. A layer's scale height follows from the data at both its ends, so
    that the density is continuous. Against :func:`pra63_data` at most 3.2 % off between 90 and
    200 km. Kinks are rounded over ``EXPONENTIAL_BLEND``: at most 0.25 % in density.
    """
    low_altitude, low_density = _read("pra63_0_66km.csv", "h_m", "rho_kg_m3")
    km, tail_density = _read("us62_80_700km.csv", "h_km", "rho_kg_m3")
    low = (low_altitude <= 60e3) | (low_altitude == 66e3)
    high = np.isin(km, _EXPONENTIAL_KM)
    h = np.concatenate((low_altitude[low], 1e3 * km[high]))
    value = np.log(np.concatenate((low_density[low], tail_density[high])))
    pieces = [_straight(h[k : k + 2], value[k : k + 2]) for k in range(h.size - 1)]
    return Atmosphere("pra63_exponential", _join(pieces, EXPONENTIAL_BLEND))


# US Standard Atmosphere 1976, NOAA-S/T 76-1562: constants of tables 2 to 8
_R = 8314.32  # J/(kmol K)
_G0 = 9.80665
_R0 = 6356.766e3  # m
_M0 = 28.9644  # kg/kmol
_AVOGADRO = 6.022169e26  # 1/kmol
# base geopotential altitude m, gradient of molecular-scale temperature K/m
_US76_LAYERS = (
    (0.0, -6.5e-3),
    (11e3, 0.0),
    (20e3, 1.0e-3),
    (32e3, 2.8e-3),
    (47e3, 0.0),
    (51e3, -2.8e-3),
    (71e3, -2.0e-3),
)
_US76_TURBOPAUSE = 86e3


def _us76_low() -> list[_Piece]:
    """Build the homosphere, 0 to 86 km: the hydrostatic equation in closed form per layer."""
    pieces = []
    temperature, pressure = 288.15, 101325.0
    top = _R0 * _US76_TURBOPAUSE / (_R0 + _US76_TURBOPAUSE)
    bounds = [layer[0] for layer in _US76_LAYERS] + [top]
    for k, (base, gradient) in enumerate(_US76_LAYERS):
        ends = [_R0 * h / (_R0 - h) for h in (base, bounds[k + 1])]
        z = np.linspace(ends[0], ends[1], max(2, math.ceil((ends[1] - ends[0]) / 500.0)))
        h = np.clip(_R0 * z / (_R0 + z), base, bounds[k + 1])
        t = temperature + gradient * (h - base)
        if gradient == 0.0:
            log_p = math.log(pressure) - _G0 * _M0 / _R * (h - base) / temperature
        else:
            log_p = math.log(pressure) - _G0 * _M0 / _R / gradient * np.log(t / temperature)
        value = log_p + np.log(_M0 / (_R * t))
        slope = -(_G0 * _M0 / _R + gradient) / t * (_R0 / (_R0 + z)) ** 2
        pieces.append(_Piece(z, value, slope))
        temperature, pressure = float(t[-1]), float(np.exp(log_p[-1]))
    return pieces


def _us76_temperature(z: Array) -> tuple[Array, Array]:
    """Compute kinetic temperature K and gradient K/m above 86 km; section 1.2.5 of the source."""
    reduced = (z - 91e3) / -19.9429e3
    root = np.sqrt(np.clip(1.0 - reduced**2, 1e-12, None))
    xi = (z - 120e3) * (_R0 + 120e3) / (_R0 + z)
    decay = 640.0 * np.exp(-0.01875e-3 * xi)
    conditions = [z < 91e3, z < 110e3, z < 120e3]
    t = np.select(
        conditions,
        [np.full_like(z, 186.8673), 263.1905 - 76.3232 * root, 240.0 + 12e-3 * (z - 110e3)],
        1000.0 - decay,
    )
    slope = np.select(
        conditions,
        [np.zeros_like(z), -76.3232 * reduced / (19.9429e3 * root), np.full_like(z, 12e-3)],
        0.01875e-3 * ((_R0 + 120e3) / (_R0 + z)) ** 2 * decay,
    )
    return t, slope


def _us76_eddy(z: Array) -> Array:
    """Compute the eddy diffusion coefficient, m2/s."""
    gap = 400.0 - (np.clip(z, 95e3, 115e3 - 1e-3) / 1e3 - 95.0) ** 2
    return np.where(z < 115e3, 120.0 * np.exp(1.0 - 400.0 / gap), 0.0)


@dataclass(frozen=True)
class _Gas:
    """Hold a minor gas of US76: molar mass, density at 86 km, tables 6 and 7 (km units)."""

    mass: float
    base: float
    thermal: float
    a: float
    b: float
    flux: tuple[float, float, float]  # Q 1/km3, U km, W 1/km3
    extra: tuple[float, float, float] = (0.0, 0.0, 0.0)  # q, u, w: below u only


_OXYGEN_ATOM = _Gas(
    15.9994,
    8.6e16,
    0.0,
    6.986e20,
    0.75,
    (-5.809644e-4, 56.90311, 2.706240e-5),
    (-3.416248e-3, 97.0, 5.008765e-4),
)
_OXYGEN = _Gas(31.9988, 3.030898e19, 0.0, 4.863e20, 0.75, (1.366212e-4, 86.0, 8.333333e-5))
_ARGON = _Gas(39.948, 1.3514e18, 0.0, 4.487e20, 0.87, (9.434079e-5, 86.0, 8.333333e-5))
_HELIUM = _Gas(4.0026, 7.5817e14, -0.4, 1.7e21, 0.691, (-2.457369e-4, 86.0, 6.666667e-4))
_NITROGEN_MASS = 28.0134
_NITROGEN_BASE = 1.129794e20
_HYDROGEN_MASS = 1.00797


def _us76_high() -> list[_Piece]:
    """Build the heterosphere, 86 to 1000 km: diffusion of each gas integrated up from 86 km."""
    edges = (86e3, 100e3, 120e3, 1000e3)
    z = np.concatenate((np.arange(86e3, 150e3, 50.0), np.arange(150e3, 1000.1e3, 250.0)))
    dz = np.diff(z)
    t, t_slope = _us76_temperature(z)
    gravity = _G0 * (_R0 / (_R0 + z)) ** 2
    weight = gravity / (_R * t)
    eddy = _us76_eddy(z)
    # mixed air below 100 km, nitrogen as the background gas above; per interval
    mixed = np.where(0.5 * (z[1:] + z[:-1]) < edges[1], _M0, _NITROGEN_MASS)

    def upwards(separate: Array, background: Array) -> Array:
        """Integrate separate + background times the background's mass from 86 km up."""
        step = (
            0.5 * dz * (separate[1:] + separate[:-1] + mixed * (background[1:] + background[:-1]))
        )
        return np.concatenate(([0.0], np.cumsum(step)))

    scale = t[0] / t
    nitrogen = _NITROGEN_BASE * scale * np.exp(-upwards(np.zeros_like(z), weight))
    # per gas: molar mass, number density, and -d(log n)/dz without the background's part
    gases = [(_NITROGEN_MASS, nitrogen, t_slope / t, weight)]

    def add(gas: _Gas, crowd: Array) -> Array:
        diffusion = gas.a / crowd * (t / 273.15) ** gas.b
        share = diffusion / (diffusion + eddy)
        q, u, w = gas.flux
        lag = z / 1e3 - u
        flow = q * lag**2 * np.exp(-w * lag**3)
        q, u, w = gas.extra
        lead = np.clip(u - z / 1e3, 0.0, None)
        flow = flow + q * lead**2 * np.exp(-w * lead**3)
        separate = share * (weight * gas.mass + gas.thermal * t_slope / t) + flow / 1e3
        background = (1.0 - share) * weight
        density: Array = gas.base * scale * np.exp(-upwards(separate, background))
        gases.append((gas.mass, density, t_slope / t + separate, background))
        return density

    crowd = nitrogen + add(_OXYGEN_ATOM, nitrogen) + add(_OXYGEN, nitrogen)
    crowd = crowd + add(_ARGON, crowd) + add(_HELIUM, crowd)

    gases.append(_hydrogen(z, (t, t_slope), weight, crowd))
    pieces = []
    for bottom, top in pairwise(edges):
        spacing = 500.0 if top <= edges[2] else 2000.0
        wanted = np.arange(bottom, top + 1.0, spacing)
        index = np.searchsorted(z, wanted - 1e-6)
        mass = _M0 if top <= edges[1] else _NITROGEN_MASS
        density = sum((m * n[index] for m, n, _, _ in gases), np.zeros(index.size))
        loss = sum(
            (m * n[index] * (own[index] + mass * common[index]) for m, n, own, common in gases),
            np.zeros(index.size),
        )
        pieces.append(_Piece(wanted, np.log(density / _AVOGADRO), -loss / density))
    return pieces


def _hydrogen(
    z: Array, temperature: tuple[Array, Array], weight: Array, crowd: Array
) -> tuple[float, Array, Array, Array]:
    """Return molar mass, number density and -d(log n)/dz, own and background's, of hydrogen.

    It is given at 500 km, escapes upwards, and counts from 150 km as in the source.

    Args:
        z: altitude, m, shape (n,).
        temperature: K, and its slope, K/m.
        weight: gravity over R T, mol/(kg m).
        crowd: number density of the other gases, 1/m3.
    """
    t, t_slope = temperature
    dz = np.diff(z)
    zero = np.zeros_like(z)
    diffusion = 3.305e21 / crowd * np.sqrt(t / 273.15)
    at = int(np.searchsorted(z, 500e3))
    depth = np.concatenate(
        ([0.0], np.cumsum(0.5 * dz * _HYDROGEN_MASS * (weight[1:] + weight[:-1])))
    )
    depth -= depth[at]
    warm = (t / t[at]) ** 0.75
    escape = 7.2e11 / diffusion * warm * np.exp(np.clip(depth, -50.0, None))
    lost = np.concatenate(([0.0], np.cumsum(0.5 * dz * (escape[1:] + escape[:-1]))))
    hydrogen = (8.0e10 - (lost - lost[at])) / warm * np.exp(-depth)
    hydrogen = np.where(z >= 150e3, hydrogen, 0.0)
    sink = np.divide(7.2e11, diffusion * hydrogen, out=zero.copy(), where=hydrogen > 0.0)
    slope = 0.75 * t_slope / t + _HYDROGEN_MASS * weight + sink
    return _HYDROGEN_MASS, hydrogen, slope, zero


@cache
def us76() -> Atmosphere:
    """Build the US Standard Atmosphere 1976, 0 to 1000 km.

    Closed form up to 86 km; above, the diffusion equations of the source are integrated
    (N2, O, O2, Ar, He, H). Kinks at the layer boundaries are rounded over ``BLEND``.
    """
    low = _us76_low()
    high = _us76_high()
    # the halves differ by 1e-4 at 86 km, as in the source; shift the upper one
    shift = low[-1].value[-1] - high[0].value[0]
    high = [_Piece(piece.altitude, piece.value + shift, piece.slope) for piece in high]
    return Atmosphere("us76", _join([*low, *high], BLEND))


_NRLMSIS_KM = np.concatenate(
    (np.arange(0.0, 200.0, 1.0), np.arange(200.0, 500.0, 5.0), np.arange(500.0, 1000.1, 10.0))
)


@cache
def nrlmsis(
    epoch: datetime, latitude_deg: float, longitude_deg: float, f107: float, f107a: float, ap: float
) -> Atmosphere:
    """Build NRLMSIS 2.1 over one place at one time with fixed indices, 0 to 1000 km, offline.

    Args:
        epoch: UTC.
        latitude_deg: geodetic.
        longitude_deg: east positive.
        f107: solar flux of the previous day, 1e-22 W/m2/Hz.
        f107a: its 81-day mean.
        ap: daily geomagnetic index.

    Raises:
        AtmosphereError: the package ``pymsis`` is not installed.
    """
    moment = np.array([epoch.replace(tzinfo=None)], dtype="datetime64[s]")
    table = nrlmsis_tables(
        moment,
        latitude_deg,
        longitude_deg,
        np.array([f107]),
        np.array([f107a]),
        np.array([ap]),
        _NRLMSIS_KM,
    )[0]
    return Atmosphere("nrlmsis", table)


def nrlmsis_tables(
    epochs: NDArray[np.datetime64],
    latitude_deg: float,
    longitude_deg: float,
    f107: Array,
    f107a: Array,
    ap: Array,
    altitude_km: Array,
) -> Array:
    """Build NRLMSIS 2.1 over one place at many times, each with its own indices, offline.

    Args: as in :func:`nrlmsis`; epochs (UTC) and indices have shape (n,), altitudes (m,).

    Returns:
        shape (n, m, 9).

    Raises:
        AtmosphereError: the package ``pymsis`` is not installed, or has no density for these
            indices.
    """
    try:
        import pymsis
    except ImportError as error:
        raise AtmosphereError(
            "atmosphere model nrlmsis needs the Python package pymsis, which is not installed"
        ) from error
    output = pymsis.calculate(
        epochs,
        [longitude_deg],
        [latitude_deg],
        altitude_km,
        f107,
        f107a,
        np.repeat(ap[:, None], 7, axis=1),
    )
    density = np.asarray(output, dtype=np.float64)[:, 0, 0, :, 0]
    bad = np.flatnonzero(~np.all(density > 0.0, axis=1))
    if bad.size:
        k = bad[0]
        raise AtmosphereError(
            f"atmosphere model nrlmsis has no density for f107 {f107[k]:g}, f107a {f107a[k]:g} "
            f"and ap {ap[k]:g}; expected a flux of the day nearer to its mean"
        )
    piece = _pchip(1e3 * altitude_km, density)
    return with_pressure(hermite_table(piece.altitude, piece.value, piece.slope))


def no_air() -> Atmosphere:
    """Build a vacuum: a log density so low that density and heating are 0."""
    row = [_NO_AIR, 0.0, 0.0, 0.0]
    return Atmosphere("none", np.array([[0.0, *row, *row]]))


def exponential(density: float, scale_height: float, gravity: float) -> Atmosphere:
    """Build an isothermal atmosphere: rho = density exp(-h / scale_height).

    Args:
        density: at altitude 0, kg/m3.
        scale_height: m.
        gravity: at the surface, m/s2; the pressure is rho g scale_height.
    """
    fall = [-1.0 / scale_height, 0.0, 0.0]
    pressure = math.log(density * gravity * scale_height)
    return Atmosphere("exponential", np.array([[0.0, math.log(density), *fall, pressure, *fall]]))


#: Models without parameters.
FIXED_MODELS: dict[str, Callable[[], Atmosphere]] = {
    "pra63": pra63,
    "pra63_exponential": pra63_exponential,
    "pra63_data": pra63_data,
    "us76": us76,
    "none": no_air,
}

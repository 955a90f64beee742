"""The atmosphere behind Blender's Sky Texture as numbers: radiance of the sky without its sun, and that of the sun.

T. Nishita et al., "Display of the Earth Taking into Account Atmospheric Scattering", SIGGRAPH 1993, for one scattering;
F. García Liñán, "Real-Time Spectral Sky", 2024, with a fit for all of them; A. Preetham et al., "A Practical Analytic
Model for Daylight", SIGGRAPH 1999; L. Hosek, A. Wilkie, "An Analytic Model for Full Spectral
Sky-Dome Radiance", SIGGRAPH 2012. Knows no Blender. Angles are radians, heights kilometres, colours CIE XYZ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from . import sky_daylight as daylight

Array = np.ndarray

WIDTH, HEIGHT = 256, 128  # texels of a sky's picture
STEPS_ONE, STEPS_MANY = 32, 64  # along a ray of sky
SUN_STEPS = 64  # along a ray to the sun


@dataclass(frozen=True)
class Air:
    """What an atmosphere is made of. Densities are factors of the Earth's own; ``all_orders``: light scatters again."""

    all_orders: bool
    elevation: float  # of the sun
    altitude: float  # of the viewer above the sea
    air: float
    aerosol: float
    ozone: float

    @property
    def radius(self) -> float:
        """The Earth's."""
        return 6371.0 if self.all_orders else 6360.0

    @property
    def height(self) -> float:
        """To which it reaches above the sea."""
        return 100.0 if self.all_orders else 60.0

    @property
    def eye(self) -> float:
        """The viewer's distance from the Earth's centre."""
        return self.radius + min(max(self.altitude, 1e-3), self.height - 1e-3)


@dataclass(frozen=True)
class Spectrum:
    """Constants by wavelength, (n,); coefficients 1/km at sea level."""

    irradiance: Array  # of the sun above the atmosphere
    molecules: Array  # scattering
    aerosols: Array  # scattering
    absorption: Array  # of the aerosols
    ozone: Array  # absorption, where it is densest
    xyz: Array  # (n, 3)

    @property
    def extinction(self) -> Array:
        """(3, n) of molecules, aerosols, ozone."""
        return np.stack((self.molecules, self.aerosols + self.absorption, self.ozone))


def rows_to_elevation(rows: Array) -> Array:
    """Elevations of heights 0..1 in a sky's picture, in which the horizon has most texels."""
    up = 2.0 * rows - 1.0
    return np.copysign(up * up, up) * (np.pi / 2)


@lru_cache(maxsize=8)
def sky_picture(air: Air) -> Array:
    """(HEIGHT, WIDTH, 3) float32 XYZ; columns go once around from opposite the sun, row 0 looks down."""
    elevation = rows_to_elevation((np.arange(HEIGHT) + 0.5) / HEIGHT)
    if air.all_orders:
        return _both_halves(_scattered(air, *_grid(elevation))).astype(np.float32)
    # The ground fades to black from the horizon down.
    above = _scattered_once(air, *_grid(np.concatenate(([1e-4], elevation[HEIGHT // 2 :]))))
    fade = np.maximum(1 + 2.5 * np.sin(elevation[: HEIGHT // 2]), 0.0)[:, None, None] ** 3
    return _both_halves(np.concatenate((fade * above[:1], above[1:]))).astype(np.float32)


def _grid(elevation: Array) -> tuple[Array, Array]:
    """Elevation and azimuth of half the directions of rows at these elevations: the other half is alike."""
    azimuth = np.pi * (np.arange(WIDTH // 2) + 0.5) / (WIDTH // 2) - np.pi
    up, around = np.meshgrid(elevation, azimuth, indexing="ij")
    return up, around


def _both_halves(half: Array) -> Array:
    return np.concatenate((half, half[:, ::-1]), 1)


def sun_radiance(air: Air, diameter: float) -> tuple[Array, Array]:
    """XYZ radiance of the sun's lowest and highest point, without the darkening of its limb."""
    spectrum = _many_spectrum() if air.all_orders else _one_spectrum()
    omega = 2 * np.pi * (1 - np.cos(diameter / 2))
    found = []
    for elevation in (air.elevation - diameter / 2, air.elevation + diameter / 2):
        seen = max(elevation, 0.0) if not air.all_orders else elevation
        through = air if air.all_orders else replace(air, ozone=0.0)  # as Blender has it
        passed = _passed(spectrum, _depth_to_sun(through, np.array([np.sin(seen)]), np.array([air.eye])))
        light = spectrum.irradiance * passed[0] / omega
        found.append(light @ spectrum.xyz * (air.all_orders or air.elevation + diameter / 2 > 0.0))
    return found[0], found[1]


def horizon(air: Air) -> float:
    """Elevation at which the Earth ends."""
    return -float(np.arccos(air.radius / air.eye))


def daylight_picture(elevation: float, turbidity: float, albedo: float) -> Array:
    """As ``sky_picture``, of Hosek and Wilkie's sky: blends of what was fitted to the nearest turbidities and suns."""
    up = rows_to_elevation((np.arange(HEIGHT) + 0.5) / HEIGHT)[:, None]
    around = (2 * np.pi * (np.arange(WIDTH) + 0.5) / WIDTH - np.pi)[None]
    sun = np.radians(min(max(np.degrees(elevation), daylight.ELEVATIONS[0]), daylight.ELEVATIONS[-1]))
    cosine = np.cos(up) * np.cos(around) * np.cos(sun) + np.sin(up) * np.sin(sun)
    gamma = np.arccos(np.clip(cosine, -1, 1))[..., None]
    rise = np.maximum(np.sin(up), 1e-3)[..., None]
    found = np.zeros((HEIGHT, WIDTH, 3))
    nodes = (_nearest(daylight.ALBEDOS, albedo), _nearest(daylight.TURBIDITIES, turbidity))
    for (h, whole), (i, share), (j, part) in product(*nodes, _nearest(daylight.ELEVATIONS, float(np.degrees(sun)))):
        a, b, c, d, e, f, level = daylight.FIT[h, i, j].T
        shape = 1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2 + f * np.sqrt(rise)
        shape = shape * (1 + a * np.exp(b / (rise + 0.01)))
        found += whole * share * part * level * np.maximum(shape, 0.0)
    return (found @ _XYZ_FROM_RGB.T).astype(np.float32)


def _nearest(places: tuple[float, ...], at: float) -> list[tuple[int, float]]:
    """The two places around a number, and the share of each."""
    index = int(np.clip(np.searchsorted(places, at) - 1, 0, len(places) - 2))
    part = float(np.clip((at - places[index]) / (places[index + 1] - places[index]), 0, 1))
    return [(index, 1 - part), (index + 1, part)]


def preetham_picture(elevation: float, turbidity: float) -> Array:
    """As ``sky_picture``, by the analytic model."""
    t, sun = turbidity, np.pi / 2 - elevation
    up = rows_to_elevation((np.arange(HEIGHT) + 0.5) / HEIGHT)[:, None]
    around = (2 * np.pi * (np.arange(WIDTH) + 0.5) / WIDTH - np.pi)[None]
    theta = np.broadcast_to(np.pi / 2 - np.maximum(up, 1e-3), (HEIGHT, WIDTH))
    cosine = np.cos(up) * np.cos(around) * np.cos(elevation) + np.sin(up) * np.sin(elevation)
    gamma = np.arccos(np.clip(cosine, -1, 1))
    chi = (4 / 9 - t / 120) * (np.pi - 2 * sun)
    powers = np.outer([t * t, t, 1], [sun**3, sun**2, sun, 1])
    zenith = {
        "Y": 0.06 * ((4.0453 * t - 4.9710) * np.tan(chi) - 0.2155 * t + 2.4192),
        **{name: (np.array(_PREETHAM_ZENITH[name]) * powers).sum() for name in "xy"},
    }
    found = {}
    for name, (slopes, starts) in _PREETHAM.items():
        a, b, c, d, e = t * np.array(slopes) + starts

        def perez(theta, gamma, a=a, b=b, c=c, d=d, e=e):
            near = 1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2
            return (1 + a * np.exp(b / np.cos(theta))) * near

        found[name] = zenith[name] * perez(theta, gamma) / perez(0.0, sun)
    x, y, level = found["x"], found["y"], found["Y"]
    return np.stack((x / y * level, level, (1 - x - y) / y * level), -1).astype(np.float32)


def _geometry(air: Air, up: Array, around: Array) -> tuple[Array, Array]:
    """Height of unit directions over the horizon, and their cosine to the sun, which stands above +X."""
    toward = np.cos(up) * np.cos(around) * np.cos(air.elevation) + np.sin(up) * np.sin(air.elevation)
    return np.sin(up), toward


def _along(air: Air, rise: Array, toward: Array, t: Array) -> tuple[Array, Array]:
    """After t km along rays: the distance to the Earth's centre, and the cosine of the sun to the zenith there."""
    distance = np.sqrt(air.eye**2 + 2 * t * air.eye * rise + t * t)
    return distance, (air.eye * np.sin(air.elevation) + t * toward) / distance


def _scattered_once(air: Air, up: Array, around: Array) -> Array:
    """XYZ radiance of light that scattered once."""
    spectrum = _one_spectrum()
    rise, toward = _geometry(air, up, around)
    phases = np.stack(_phases(air, toward), -1)
    step = _distance(air.eye, rise, air.radius + air.height) / STEPS_ONE
    light = np.zeros((*rise.shape, len(spectrum.irradiance)), np.float32)
    depth = np.zeros((*rise.shape, 3))
    for k in range(STEPS_ONE):
        distance, to_sun = _along(air, rise, toward, (k + 0.5) * step)
        density = _densities(air, distance - air.radius)
        depth += density * step[..., None]
        hidden = (to_sun < 0) & (distance * np.sqrt(np.maximum(1 - to_sun**2, 0)) < air.radius)
        passed = _passed(spectrum, depth + _depth_to_sun(air, to_sun, distance))
        sent = (density[..., :2] * phases * (step * ~hidden)[..., None]) @ _scattering(spectrum)
        light += sent.astype(np.float32) * passed
    return (light * spectrum.irradiance) @ spectrum.xyz


def _scattered(air: Air, up: Array, around: Array) -> Array:
    """XYZ radiance of light that scattered any number of times."""
    spectrum = _many_spectrum()
    rise, toward = _geometry(air, up, around)
    phases = np.stack(_phases(air, toward), -1)
    ground = _distance(air.eye, rise, air.radius, first=True)
    reach = np.where(np.isnan(ground), _distance(air.eye, rise, air.radius + air.height), ground)
    step = (reach / STEPS_MANY)[..., None]
    light = np.zeros((*rise.shape, len(spectrum.irradiance)))
    left = np.ones_like(light)
    for k in range(STEPS_MANY):
        distance, to_sun = _along(air, rise, toward, (k + 0.5) * step[..., 0])
        density = _densities(air, np.maximum(distance - air.radius, 0.0))
        extinction = density @ spectrum.extinction
        passed = _look_up(air, to_sun, distance - air.radius)
        sent = (density[..., :2] * phases) @ _scattering(spectrum) * passed
        sent += density[..., :2] @ _scattering(spectrum) * _scattered_again(air, to_sun, distance)
        kept = np.exp(-extinction * step)
        light += left * sent * (1.0 - kept) / np.maximum(extinction, 1e-7)
        left *= kept
    return (light * spectrum.irradiance) @ spectrum.xyz


def _scattering(spectrum: Spectrum) -> Array:
    """(2, n) of molecules and aerosols."""
    return np.stack((spectrum.molecules, spectrum.aerosols))


def _distance(eye: float, up: Array, radius: float, first: bool = False) -> Array:
    """To a sphere around the Earth's centre, the far side of it or the ``first``; NaN where it is not met."""
    b = eye * up
    root = b * b - eye * eye + radius * radius
    with np.errstate(invalid="ignore"):
        found = -b + np.where(first, -1.0, 1.0) * np.sqrt(root)
    return np.where(found > 0, found, np.nan)


def _phases(air: Air, cosine: Array) -> tuple[Array, Array]:
    """Phase functions of molecules (Rayleigh) and aerosols (Henyey-Greenstein; Cornette-Shanks), 1/sr."""
    molecules = 3 / (16 * np.pi) * (1 + cosine**2)
    if air.all_orders:
        g = 0.8
        return molecules, (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
    g = 0.76
    aerosols = 3 * (1 - g * g) * (1 + cosine**2) / (8 * np.pi * (2 + g * g) * (1 + g * g - 2 * g * cosine) ** 1.5)
    return molecules, aerosols


def _densities(air: Air, height: Array) -> Array:
    """(..., 3) molecules, aerosols and ozone at a height, as factors of the spectrum's coefficients."""
    if not air.all_orders:
        ozone = np.maximum(0.0, 1 - abs(height - 25.0) / 15.0)
        return np.stack((air.air * np.exp(-height / 8.0), air.aerosol * np.exp(-height / 1.2), air.ozone * ozone), -1)
    log = np.log(np.maximum(height, 1e-4))
    ozone = np.exp(-((log - 3.22261) ** 2) * 5.55555555 - log)
    aerosols = np.exp(-height / 0.73) + 2e6 / 1.3681e20
    molecules = np.exp(-0.07771971 * height**1.16364243)
    return np.stack((air.air * molecules, air.aerosol * aerosols, air.ozone * ozone), -1)


def _depth_to_sun(air: Air, cosine: Array, distance: Array) -> Array:
    """(..., 3) molecules, aerosols and ozone between the sun and places so far from the Earth's centre."""
    b = distance * cosine
    reach = -b + np.sqrt(np.maximum(b * b - distance**2 + (air.radius + air.height) ** 2, 0.0))
    depth = np.zeros((*distance.shape, 3))
    for node, weight in zip(*_quadrature(air.all_orders), strict=True):
        t = node * reach
        height = np.sqrt(np.maximum(distance**2 + 2 * t * b + t * t, 0.0)) - air.radius
        # Through the ground of the fit light grows dark by itself; one scattering knows the Earth's shadow.
        depth += _densities(air, np.maximum(height, 0.0) if air.all_orders else height) * (weight * reach)[..., None]
    return depth


def _passed(spectrum: Spectrum, depth: Array) -> Array:
    """(..., n) part of the light that passes so much of molecules, aerosols and ozone."""
    return np.exp((-depth @ spectrum.extinction).astype(np.float32))


@lru_cache(maxsize=2)
def _quadrature(even: bool) -> tuple[Array, Array]:
    """Places along a ray, 0..1, and their weights: even, or for air that thins out exponentially (Gauss-Laguerre)."""
    if even:
        return (np.arange(SUN_STEPS) + 0.5) / SUN_STEPS, np.full(SUN_STEPS, 1 / SUN_STEPS)
    nodes, weights = np.polynomial.laguerre.laggauss(8)
    end = 25.0  # beyond the last node
    return nodes / end, weights * np.exp(nodes) / end


@lru_cache(maxsize=4)
def _sun_table(air: Air) -> Array:
    """``_to_sun`` by height (64 rows) and cosine to the zenith (256 columns)."""
    cosine, height = np.meshgrid(np.linspace(-1, 1, 256), np.linspace(0, air.height, 64))
    with np.errstate(over="ignore"):
        return _passed(_many_spectrum(), _depth_to_sun(air, cosine, air.radius + height))


def _look_up(air: Air, cosine: Array, height: Array) -> Array:
    table = _sun_table(replace(air, elevation=0.0, altitude=0.0))
    x = np.clip(0.5 + 0.5 * cosine, 0, 1) * 255
    y = np.clip(height / air.height, 0, 1) * 63
    x0, y0 = np.minimum(x.astype(int), 254), np.minimum(y.astype(int), 62)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    low = table[y0, x0] * (1 - fx) + table[y0, x0 + 1] * fx
    return low * (1 - fy) + (table[y0 + 1, x0] * (1 - fx) + table[y0 + 1, x0 + 1] * fx) * fy


def _scattered_again(air: Air, cosine: Array, distance: Array) -> Array:
    """Light that has scattered before, or that the ground reflected: García Liñán's fit to a path tracer."""
    height = distance - air.radius
    omega = 2 * np.pi * (1 - np.sqrt(np.maximum(1 - (air.radius / distance) ** 2, 0.0)))
    one, ground = np.ones_like(cosine), np.zeros_like(cosine)
    between = _look_up(air, one, ground) / _look_up(air, one, height)
    reflected = 0.3 / np.pi * _look_up(air, cosine, ground) * between * (cosine * omega / (4 * np.pi))[..., None]
    fit = 0.02 * np.array([0.217, 0.347, 0.594, 1.0]) / (1 + 5 * np.exp(-17.92 * cosine))[..., None]
    return fit + reflected


@lru_cache(maxsize=1)
def _one_spectrum() -> Spectrum:
    """21 wavelengths from 380 to 780 nm: a black body of 5778 K as large as the sun, Rayleigh's law, and tables."""
    nanometres = np.arange(380, 781, 20, dtype=float)
    wave = nanometres * 1e-9
    planck = 2 * 6.62607e-34 * 2.99792e8**2 / wave**5 / np.expm1(6.62607e-34 * 2.99792e8 / (wave * 1.380649e-23 * 5778))
    irradiance = planck * np.pi * (6.957e8 / 1.496e11) ** 2 * 1e-9  # W/m² a nanometre
    molecules = 0.054248 * (380 / nanometres) ** 4
    aerosols = np.full_like(wave, 0.02)
    return Spectrum(irradiance, molecules, aerosols, 0.11 * aerosols, _OZONE * 1e3, _CIE_1931 * 20.0)


@lru_cache(maxsize=1)
def _many_spectrum() -> Spectrum:
    """Four wavelengths, 630, 560, 490 and 430 nm, of an urban atmosphere."""
    aerosol = 1.3681e20
    return Spectrum(
        np.array([1.679, 1.828, 1.986, 1.307]),
        np.array([6.605e-3, 1.067e-2, 1.842e-2, 3.156e-2]),
        np.array([1.5908e-22, 1.7711e-22, 2.0942e-22, 2.4033e-22]) * aerosol,
        np.array([2.8722e-24, 4.6168e-24, 7.9706e-24, 1.3578e-23]) * aerosol,
        np.array([3.472e-25, 3.914e-25, 1.349e-25, 11.03e-27]) * 334.5 * 3.78547397e20,
        np.array(
            [
                [53.386917738564668, 22.981337506691024, 0.0],
                [43.904844466369358, 71.347795700053393, 0.102506867965741],
                [1.613727825160896, 18.422960591455485, 31.742921188390805],
                [20.762668673810577, 2.361421352331436, 110.480096432521403],
            ]
        ),
    )


_XYZ_FROM_RGB = np.array(
    [[0.4123908, 0.3575843, 0.1804808], [0.212639, 0.7151687, 0.0721923], [0.0193308, 0.1191948, 0.9505322]]
)
# Absorption of ozone where it is densest, 1/m, from 380 to 780 nm.
_OZONE = np.array(
    [
        *(3.25127e-09, 5.85395e-09, 1.97719e-08, 7.30957e-08, 2.008456e-07, 4.038396e-07, 6.355134e-07),
        *(9.670704e-07, 1.547974e-06, 2.0903865e-06, 2.4612806e-06, 2.735513e-06, 2.1512586e-06, 1.5905184e-06),
        *(1.123562e-06, 7.352755e-07, 4.645013e-07, 3.309608e-07, 2.251261e-07, 1.487913e-07, 1.682863e-07),
    ]
)
# The standard observer of 1931, from 380 to 780 nm.
_CIE_1931 = np.array(
    [
        (0.001368, 0.000039, 0.00645), (0.01431, 0.000396, 0.06785), (0.13438, 0.004, 0.6456),
        (0.34828, 0.023, 1.74706),
        (0.2908, 0.06, 1.6692), (0.09564, 0.13902, 0.81295), (0.0049, 0.323, 0.272), (0.06327, 0.71, 0.07825),
        (0.2904, 0.954, 0.0203), (0.5945, 0.995, 0.0039), (0.9163, 0.87, 0.00165), (1.0622, 0.631, 0.0008),
        (0.85445, 0.381, 0.00019), (0.4479, 0.175, 0.00002), (0.1649, 0.061, 0.0), (0.04677, 0.017, 0.0),
        (0.011359, 0.004102, 0.0), (0.002899, 0.001047, 0.0), (0.00069, 0.000249, 0.0), (0.000166, 0.00006, 0.0),
        (0.0000415, 0.000015, 0.0),
    ]
)  # fmt: skip
# Perez's five coefficients: slopes by turbidity and their starts; the zenith's by turbidity and the sun's angle to it.
_PREETHAM = {
    "Y": ((0.1787, -0.3554, -0.0227, 0.1206, -0.0670), (-1.4630, 0.4275, 5.3251, -2.5771, 0.3703)),
    "x": ((-0.0193, -0.0665, -0.0004, -0.0641, -0.0033), (-0.2592, 0.0008, 0.2125, -0.8989, 0.0452)),
    "y": ((-0.0167, -0.0950, -0.0079, -0.0441, -0.0109), (-0.2608, 0.0092, 0.2102, -1.6537, 0.0529)),
}
_PREETHAM_ZENITH = {
    "x": (
        (0.00166, -0.00375, 0.00209, 0.0),
        (-0.02903, 0.06377, -0.03202, 0.00394),
        (0.11693, -0.21196, 0.06052, 0.25886),
    ),
    "y": (
        (0.00275, -0.00610, 0.00317, 0.0),
        (-0.04214, 0.08970, -0.04153, 0.00516),
        (0.15346, -0.26756, 0.06670, 0.26688),
    ),
}

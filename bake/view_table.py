"""How glossy surfaces of any isotropic BRDF are seen, a table over roughness and view (Kautz, Sloan, Snyder 2002).

Of one view, a BRDF times the cosine is a function of the light's direction that the plane of normal and view mirrors
onto itself. In band l such functions have l + 1 dimensions, and zonal harmonics around as many directions of that plane
span them. So what is seen is a sum over a few directions, evenly spread in the plane, and over bands: a weight of the
table times that band of the light in that direction. The light need not be turned into the surface's axes.

Along these axes the normal is +Z and the mirrored view leans to +X. A BRDF is told by its reflections: directions
(n, 3) and the share of the light (n,) that each stands for, which add up to 1; those on one side of the plane are
enough. How much is reflected is the material's matter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from . import lobes, sh
from .sphere import Array

Reflections = Callable[[float, float], tuple[Array, Array]]  # of a roughness 0..1 and the cosine of the view
_POINTS = 16  # of quadratures, along the polar angle and around: half a turn, the other is its mirror image


def plane_directions(bands: int) -> Array:
    """(bands, 3) in the plane of normal and view: half a turn of them: bands are even or odd."""
    angles = (np.arange(bands) + 0.5) * (np.pi / bands)
    return np.stack([np.sin(angles), np.zeros(bands), np.cos(angles)], axis=-1)


def weights(reflections: Reflections, bands: int, roughnesses: Sequence[float], cosine: float) -> Array:
    """(roughnesses, directions, bands): seen radiance is the sum of [k, l] times band l of the light in direction k."""
    pairs = [reflections(roughness, cosine) for roughness in roughnesses]
    towards, shares = (np.stack(part) for part in zip(*pairs, strict=True))
    lobes = (shares[:, None] @ sh.evaluate(towards, bands))[:, 0]
    basis = sh.evaluate(plane_directions(bands), bands)
    found = np.empty((len(lobes), bands, bands))
    for order in range(bands):
        band = slice(order * order, (order + 1) ** 2)
        # What grows with y is 0 in the plane, and in a lobe that is its own mirror image.
        found[:, :, order] = lobes[:, band] @ np.linalg.pinv(basis[:, band])
    return found


@cache
def least_roughness(reflections: Reflections, bands: int) -> float:
    """The roughness whose lobe, seen along the normal, has the mean cosine of the narrowest that ``bands`` hold.

    Cut off after so many bands, the lobe of a smoother one is far below 0 beside its highlight, and bright light there
    shows as black or, channel by channel, as wrong colours. 1 where even that is narrower.
    """

    def mean_cosine(roughness: float) -> float:
        towards, shares = reflections(roughness, 1.0)
        return float(shares @ towards[:, 2])

    low, high = 0.0, 1.0
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if mean_cosine(middle) > lobes.narrowest(bands) else (low, middle)
    return high


def ggx(roughness: float, cosine: float) -> tuple[Array, Array]:
    """A GGX mirror, alpha the square of ``roughness``."""
    out, shares, _ = _visible(roughness, cosine)
    return _above(out, shares)


def ggx_albedo(roughness: float, cosine: float) -> tuple[float, float]:
    """What it reflects of even light by one bounce, and the part of that which Schlick's (1 - cosine)^5 gets."""
    out, shares, facing = _visible(roughness, cosine)
    shares = np.where(out[:, 2] > 0.0, shares, 0.0)
    return float(shares.sum()), float(shares @ (1.0 - facing) ** 5)


def _visible(roughness: float, cosine: float) -> tuple[Array, Array, Array]:
    """Mirrored directions (n, 3), shares (n,) of 1 and the cosine of each facet to the view.

    Integrated over visible normals (Dupuy, Benyoub 2023), with the height-correlated shadowing of the frame's own lobe.
    """
    alpha = max(roughness * roughness, 1e-3)
    cosine = float(np.clip(cosine, 1e-3, 1.0))
    view = np.array([-np.sqrt(1.0 - cosine * cosine), 0.0, cosine])
    stretched = view * [alpha, alpha, 1.0]
    stretched /= np.linalg.norm(stretched)
    cap, steps = _cap(-stretched[2])
    normals = (cap + stretched) * [alpha, alpha, 1.0]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    facing = normals @ view
    out = 2.0 * facing[:, None] * normals - view
    lost = _smith(cosine, alpha)
    shares = steps * (1.0 + lost) / (1.0 + lost + _smith(np.maximum(out[:, 2], 1e-6), alpha))
    return out, shares / steps.sum(), facing.clip(0.0, 1.0)


def phong_exponent(roughness: float) -> float:
    """Half vectors of GGX are as wide as a power of 2 / alpha² - 2; mirrored directions lie twice as far apart."""
    return max(0.5 / max(roughness, 0.03) ** 4 - 0.5, 0.0)


def phong(roughness: float, cosine: float) -> tuple[Array, Array]:
    """A power of the cosine to the mirrored view, (1 / alpha² - 1) / 2: about as wide as GGX, alpha as there.

    As the paper has it, the lobe is the same from all sides, and part of it may lie below the surface.
    """
    exponent = phong_exponent(roughness)
    nodes, steps = np.polynomial.legendre.leggauss(2 * _POINTS)
    along = (0.5 * (nodes + 1.0)) ** (1.0 / (exponent + 1.0))  # by its cumulative distribution
    around = (np.arange(_POINTS) + 0.5) * (np.pi / _POINTS)
    radius = np.sqrt(1.0 - along * along)[:, None]
    x, y = radius * np.cos(around), radius * np.sin(around)
    sine = np.sqrt(max(1.0 - cosine * cosine, 0.0))
    z = np.broadcast_to(along[:, None], x.shape)
    out = np.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=-1).reshape(-1, 3)
    shares = np.repeat(steps, _POINTS)
    return out, shares / shares.sum()


def measured(brdf: Callable[[Array, Array, float], Array]) -> Reflections:
    """Reflections of a BRDF that can only be asked for values: (n,) for light directions (n, 3), a view, a roughness.

    Sampled evenly over the hemisphere: lobes narrower than 3 degrees are not found well.
    """

    def reflections(roughness: float, cosine: float) -> tuple[Array, Array]:
        light, steps = _cap(0.0, 4 * _POINTS)
        view = np.array([-np.sqrt(max(1.0 - cosine * cosine, 0.0)), 0.0, cosine])
        return _above(light, steps * brdf(light, view, roughness) * light[:, 2])

    return reflections


LOBES: dict[str, Reflections] = {"GGX": ggx, "PHONG": phong}


def _cap(lowest: float, points: int = _POINTS) -> tuple[Array, Array]:
    """Directions (n, 3) over the part of the half sphere y > 0 with z above ``lowest``, and the area (n,) of each."""
    nodes, steps = np.polynomial.legendre.leggauss(points)
    z = 0.5 * (nodes + 1.0) * (1.0 - lowest) + lowest
    around = (np.arange(points) + 0.5) * (np.pi / points)
    radius = np.sqrt(np.clip(1.0 - z * z, 0.0, 1.0))[:, None]
    x, y = radius * np.cos(around), radius * np.sin(around)
    directions = np.stack(np.broadcast_arrays(x, y, z[:, None]), axis=-1).reshape(-1, 3)
    return directions, np.repeat(steps, points)


def _above(out: Array, shares: Array) -> tuple[Array, Array]:
    shares = np.where(out[:, 2] > 0.0, shares, 0.0)
    return out, shares / shares.sum()


def _smith(cosine, alpha: float):
    """Smith's Lambda."""
    return 0.5 * (np.sqrt(1.0 + alpha * alpha * (1.0 / np.square(cosine) - 1.0)) - 1.0)

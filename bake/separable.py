"""Glossy lobes as short sums of products, one factor of the light's direction and one of the view's.

In-out factoring (Kautz, McCool 1999), as all-frequency relighting of glossy objects uses it (Liu, Sloan, Shum, Snyder
2004; Wang, Tran, Luebke 2004): lobe(light, view) = sum over k of g_k(light) h_k(view). A surface's visibility goes with
g_k into a row of wavelets; h_k is looked up when it is seen.

A lobe here is the share of what is reflected that comes from a light's direction: over these it integrates to 1 for
each view, how much is reflected is the material's matter. It is isotropic, so it splits exactly into a part for each
order m of the difference in azimuth, each of which is a matrix over the two polar angles: the singular vectors of
those are all singular vectors of the whole. A term of m > 0 comes twice, with the cosines and the sines of m times both
azimuths. Around the normal (+Z) azimuths are measured from a tangent (+X); which one makes no difference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..gpu_shaders.prt.shaders import VIEWS
from .sphere import Array
from .view_table import phong_exponent

# Value of a lobe, by any scale: of light directions (n, 3), views (n, 3) above the surface, and a roughness.
Lobe = Callable[[Array, Array, float], Array]
# Steps of the polar angles, and of the difference in azimuth: a degree, lobes of roughness 0.2 are ten wide.
_ANGLES = 96
_TURNS = 256


@dataclass(frozen=True, eq=False)
class Separable:
    """K terms of one lobe at one roughness, by rising order; those of a cosine are followed by their sine."""

    light: Array  # (K, _ANGLES) float64: g_k over the polar angle of the light, the middles of even steps
    view: Array  # (K, VIEWS) float64: h_k at even steps of the root of 1 - cosine of the view, 0..1
    orders: Array  # (K,) int64: m
    odd: Array  # (K,) bool: of the sines
    error: float  # root of the part of the lobe's squared sum, over all lights and views, that is left out

    def of_light(self, directions: Array) -> Array:
        """(n, K) g_k towards ``directions`` (n, 3) of the surface's own axes; 0 below it."""
        polar = np.arccos(np.clip(directions[:, 2], -1.0, 1.0)) / (0.5 * np.pi / _ANGLES) - 0.5
        found = _between(self.light.T, polar) * _around(directions, self.orders, self.odd)
        found[directions[:, 2] <= 0] = 0.0
        return found

    def of_view(self, directions: Array) -> Array:
        """(n, K) h_k, as the shader computes it."""
        place = np.sqrt(1.0 - np.clip(directions[:, 2], 0.0, 1.0)) * (VIEWS - 1)
        return _between(self.view.T, place) * _around(directions, self.orders, self.odd)

    def table(self) -> Array:
        """(VIEWS, K, 4) float32 for the shader: h_k, m, whether it is of the sines, 0."""
        found = np.zeros((VIEWS, len(self.orders), 4), np.float32)
        found[..., 0] = (self.view / _lengths(self.orders)[:, None]).T
        found[..., 1], found[..., 2] = self.orders, self.odd
        return found


def factor(lobe: Lobe, roughness: float, terms: int) -> Separable:
    """The ``terms`` strongest products of a lobe; one less where a pair of cosine and sine finds no room.

    Views weigh by their solid angle times their cosine, which is how often a picture has them.
    """
    step = 0.5 * np.pi / _ANGLES
    angles = (np.arange(_ANGLES) + 0.5) * step
    parts = _azimuthal(lobe, roughness, angles)
    light_weights = np.sqrt(np.sin(angles) * step)
    view_weights = light_weights * np.sqrt(np.cos(angles))
    parts = light_weights[:, None] * parts * view_weights
    twice = np.where(np.arange(len(parts)) > 0, 2, 1)
    power = twice * (parts * parts).sum(axis=(1, 2))
    # Of the highest orders there is next to nothing: no pair of them is among the strongest.
    u, s, v = np.linalg.svd(parts[: 1 + int((power > 1e-4 * power.sum()).nonzero()[0].max())])
    chosen: list[tuple[int, int]] = []
    left = terms
    for m, i in np.stack(np.unravel_index(np.argsort(-s, axis=None, kind="stable"), s.shape), axis=-1):
        if left < 1:
            break
        if twice[m] <= left:
            chosen.append((m, i))
            left -= twice[m]
    light, view, orders, odd = [], [], [], []
    for m, i in sorted(chosen):
        for is_sine in range(twice[m]):
            light.append(s[m, i] * u[m, :, i] / light_weights)
            view.append(v[m, i] / view_weights)
            orders.append(m)
            odd.append(bool(is_sine))
    kept = sum(twice[m] * s[m, i] ** 2 for m, i in chosen)
    table = np.arccos(1.0 - np.linspace(0.0, 1.0, VIEWS) ** 2)
    found = Separable(
        np.array(light),
        np.stack([np.interp(table, angles, row) for row in view]),
        np.array(orders),
        np.array(odd),
        float(np.sqrt(max(1.0 - kept / power.sum(), 0.0))),
    )
    return _white(found, np.sin(angles) * step)


def _azimuthal(lobe: Lobe, roughness: float, angles: Array) -> Array:
    """(orders, lights, views): what is left of the lobe between the functions cos(m φ) / √π, of m = 0: 1 / √2π."""
    turns = np.arange(_TURNS) * (2.0 * np.pi / _TURNS)
    across, up = np.sin(angles)[:, None], np.cos(angles)[:, None]
    light = np.stack(np.broadcast_arrays(across * np.cos(turns), across * np.sin(turns), up), axis=-1).reshape(-1, 3)
    parts = np.empty((_TURNS // 2 + 1, len(angles), len(angles)))
    rings = 2.0 * np.pi * np.sin(angles) * (angles[1] - angles[0])
    for column, angle in enumerate(angles):
        view = np.broadcast_to([np.sin(angle), 0.0, np.cos(angle)], light.shape)
        values = lobe(light, view, roughness).reshape(len(angles), _TURNS)
        values = values / (values.mean(axis=1) @ rings)
        parts[:, :, column] = 2.0 * np.pi * np.fft.rfft(values, axis=1).real.T / _TURNS
    return parts


def _white(found: Separable, steps: Array) -> Separable:
    """What is left out takes or gives light; the same surroundings in all directions come back as they are."""
    straight = found.orders == 0
    whole = (found.light[straight] @ steps) @ found.view[straight]
    return Separable(found.light, found.view / np.clip(whole, 0.5, 2.0), found.orders, found.odd, found.error)


def _between(table: Array, places: Array) -> Array:
    """(n, K) of a table (rows, K) at ``places`` (n,) counted in rows, linear."""
    lower = places.astype(np.int64).clip(0, len(table) - 2)
    part = (places - lower).clip(0.0, 1.0)[:, None]
    return table[lower] * (1.0 - part) + table[lower + 1] * part


def _lengths(orders: Array) -> Array:
    """Of cos(m φ), over all φ."""
    return np.sqrt(np.where(orders > 0, np.pi, 2.0 * np.pi))


def _around(directions: Array, orders: Array, odd: Array) -> Array:
    """(n, K): cos(m φ) / √π or sin(m φ) / √π, of m = 0: 1 / √2π."""
    turn = directions[:, 0] + 1j * directions[:, 1]
    length = np.abs(turn)
    turn = np.where(length > 1e-9, turn / np.maximum(length, 1e-9), 1.0)
    found, power, order = np.empty((len(turn), len(orders))), np.ones_like(turn), 0
    for k in np.argsort(orders, kind="stable"):
        while order < orders[k]:
            power, order = power * turn, order + 1
        found[:, k] = np.imag(power) if odd[k] else np.real(power)
    return found / _lengths(orders)


def ggx(light: Array, view: Array, roughness: float) -> Array:
    """GGX with height-correlated shadowing, times the cosine; alpha is the square of ``roughness``."""
    alpha = max(roughness * roughness, 1e-3)
    half = light + view
    half /= np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-12)
    normals = 1.0 / np.square(np.square(half[..., 2]) * (alpha * alpha - 1.0) + 1.0)
    slopes = (
        np.sqrt(1.0 + alpha * alpha * (1.0 / np.square(np.maximum(d[..., 2], 1e-6)) - 1.0)) for d in (light, view)
    )
    return np.where(light[..., 2] > 0, normals / (sum(slopes) * np.maximum(view[..., 2], 1e-6)), 0.0)


def phong(light: Array, view: Array, roughness: float) -> Array:
    """The power of the cosine to the mirrored view that is about as wide as GGX."""
    mirrored = (light * view * [-1.0, -1.0, 1.0]).sum(axis=-1)
    return np.maximum(mirrored, 0.0) ** phong_exponent(roughness)


LOBES: dict[str, Lobe] = {"GGX": ggx, "PHONG": phong}


def tangents(normals: Array) -> Array:
    """(n, 3) one direction at right angles to each of ``normals`` (n, 3)."""
    helper = np.where(np.abs(normals[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    found = helper - (helper * normals).sum(axis=1, keepdims=True) * normals
    return found / np.linalg.norm(found, axis=1, keepdims=True)

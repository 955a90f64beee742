"""The GGX lobe in numpy, float64, integrated where the shaders have fits. The normal is +Z."""

from __future__ import annotations

import functools

import numpy as np

Array = np.ndarray


def half_sphere(count: int) -> tuple[Array, Array]:
    """Cosines and weights that sum to 1: the mean over all directions of even light."""
    x, w = np.polynomial.legendre.leggauss(count)
    cosines = 0.5 * (x + 1)
    return cosines, w * cosines


def smith(cosine, alpha) -> Array:
    """Lambda."""
    return 0.5 * (np.sqrt(1 + alpha**2 * (1 / np.square(cosine) - 1)) - 1)


def dielectric(cosine, ior: float) -> Array:
    """Fresnel's unpolarised reflectance."""
    g = np.sqrt(ior**2 - 1 + np.square(cosine))
    return (
        0.5
        * ((g - cosine) / (g + cosine)) ** 2
        * (1 + ((cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)) ** 2)
    )


def specular(v: Array, l: Array, f0: Array, roughness: Array) -> Array:  # noqa: E741
    """(n, 3) BRDF of one bounce for (n, 3) directions, F0 (n, 3), roughness (n,)."""
    alpha = roughness**2
    h = v + l
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    normals = alpha**2 / (np.pi * (h[:, 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    shadowing = 1 / (1 + smith(v[:, 2], alpha) + smith(l[:, 2], alpha))
    fresnel = f0 + (1 - f0) * (1 - (v * h).sum(1)[:, None]) ** 5
    return (normals * shadowing / (4 * v[:, 2] * l[:, 2]))[:, None] * fresnel


def sample_ggx(v: Array, roughness: Array, xi: Array) -> Array:
    """(n, 3) directions: mirrored at visible normals, from a spherical cap in the stretched frame."""
    alpha = roughness[:, None] ** 2
    w = np.concatenate((alpha * v[:, :2], v[:, 2:]), 1)
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    angle, z = 2 * np.pi * xi[:, 0], 1 - xi[:, 1] * (1 + w[:, 2])
    sine = np.sqrt(np.clip(1 - z * z, 0, 1))
    h = np.stack((sine * np.cos(angle), sine * np.sin(angle), z), 1) + w
    h = np.concatenate((alpha * h[:, :2], h[:, 2:]), 1)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    return 2 * (v * h).sum(1, keepdims=True) * h - v


@functools.cache
def single_scattering(cosine: float, roughness: float, count: int = 128) -> tuple[float, float]:
    """Albedo of one bounce with F = 1, and the part of it that Schlick's (1 - cosine)^5 gets."""
    xi = np.stack(np.meshgrid(*((np.arange(count) + 0.5) / count,) * 2), -1).reshape(-1, 2)
    v = np.repeat([[np.sqrt(1 - cosine * cosine), 0, cosine]], len(xi), 0)
    l = sample_ggx(v, np.full(len(xi), roughness), xi)  # noqa: E741
    h = v + l
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    alpha, up = roughness**2, l[:, 2] > 0
    seen = 1 + smith(cosine, alpha)
    weight = np.where(up, seen / (seen + smith(np.where(up, l[:, 2], 1.0), alpha)), 0.0)
    return float(weight.mean()), float((weight * (1 - (v * h).sum(1)) ** 5).mean())


@functools.cache
def mean_albedo(roughness: float) -> float:
    """Albedo of one bounce over all directions of even light."""
    cosines, weights = half_sphere(24)
    return float(sum(w * single_scattering(float(c), roughness)[0] for c, w in zip(cosines, weights, strict=True)))


def compensation(cosines: Array, f0: Array, roughness: Array) -> Array:
    """(n, 3) factor of the light of several bounces."""
    rows = zip(np.atleast_1d(cosines), np.atleast_1d(roughness), strict=True)
    single = np.array([single_scattering(float(c), float(r), 64)[0] for c, r in rows])[:, None]
    mean = np.array([_rough_mean(float(r)) for r in np.atleast_1d(roughness)])[:, None]
    fresnel = f0 + (1 - f0) / 21
    return 1 + fresnel * mean / (1 - fresnel * (1 - mean)) * (1 - single) / single


@functools.cache
def _mean_table() -> tuple[Array, Array]:
    places = np.linspace(0.03, 1, 24)
    return places, np.array([mean_albedo(float(r)) for r in places])


def _rough_mean(roughness: float) -> float:
    return float(np.interp(roughness, *_mean_table()))


def albedo(cosine: float, f0: Array, roughness: float) -> Array:
    """(3,) of the whole lobe."""
    single, grazing = single_scattering(cosine, roughness)
    return (f0 * (single - grazing) + grazing) * compensation(np.array([cosine]), f0[None], np.array([roughness]))[0]

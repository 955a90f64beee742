"""Glossy lobes as their papers write them, for sums over all directions. The normal is +Z, the view leans to -X."""

from __future__ import annotations

import numpy as np


def mirrored(cosine):
    """(3,) direction in which a view of this cosine is mirrored."""
    return np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])


def ggx_values(towards, roughness, cosine):
    """(n,) of directions (n, 3): the BRDF without Fresnel times the cosine, height-correlated shadowing, by scale."""
    alpha, view = roughness**2, mirrored(cosine) * [-1, 1, 1]
    half = towards + view
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-12)
    normals = alpha**2 / (np.pi * (half[:, 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    z = np.maximum(towards[:, 2], 1e-6)
    smith = [0.5 * (np.sqrt(1 + alpha**2 * (1 / c**2 - 1)) - 1) for c in (cosine, z)]
    return np.where(towards[:, 2] > 0, normals / (4 * cosine * (1 + sum(smith))), 0.0)


def phong_values(towards, roughness, cosine):
    """(n,): the power of the cosine to the mirrored view that is about as wide as GGX."""
    return np.maximum(towards @ mirrored(cosine), 0.0) ** ((1.0 / roughness**4 - 1.0) / 2.0)

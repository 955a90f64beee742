"""Small scenes whose transfer has a closed form."""

from __future__ import annotations

import numpy as np

from rebound.bake.occlusion import make_caster
from rebound.bake.surfaces import gather
from rebound.scene.data import Instance, Material, Scene, Visibility
from rebound.tests.support.render_scenes import triangles

EVERYTHING = Visibility.CAMERA | Visibility.SHADOW | Visibility.BOUNCE
WHITE_SKY = np.sqrt(4.0 * np.pi)  # the only coefficient of a sky of radiance 1


def placed(*meshes, albedo=0.8, matrices=None, visibility=EVERYTHING):
    """A scene with each mesh once, keyed by its name; ``albedo`` is one number or one colour for all."""
    colour = tuple(np.broadcast_to(np.asarray(albedo, float), 3))
    matrices = matrices or [np.eye(4)] * len(meshes)
    instances = [
        Instance(m.key[0], m.key, (0,), matrix, visibility) for m, matrix in zip(meshes, matrices, strict=True)
    ]
    return Scene({m.key: m for m in meshes}, tuple(instances), (Material("Grey", colour),))


def surfaces_of(scene, kind=""):
    """The scene's surfaces, and what casts rays at them."""
    surfaces = gather(scene, frozenset(i.key for i in scene.instances))
    return surfaces, make_caster(surfaces.corners[surfaces.blocks], kind)


def grid(name, size=10.0, cells=20):
    """A plane at z = 0, facing up, of cells x cells squares."""
    edge = np.linspace(-size / 2, size / 2, cells + 1)
    x, y = np.meshgrid(edge, edge, indexing="ij")
    p = np.stack([x, y, 0 * x], axis=-1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    return triangles(name, np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3))


def bowl(name, rings=24):
    """The lower half of a unit sphere, open to the top, facing inwards."""
    theta = np.linspace(np.pi / 2, np.pi, rings + 1)
    phi = np.linspace(0, 2 * np.pi, 4 * rings + 1)
    t, f = np.meshgrid(theta, phi, indexing="ij")
    p = np.stack([np.sin(t) * np.cos(f), np.sin(t) * np.sin(f), np.cos(t)], axis=-1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    corners = np.stack([a, c, b, a, d, c], axis=2).reshape(-1, 3, 3)
    sides = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    corners = corners[sides > 1e-9].reshape(-1, 3)
    return triangles(name, corners, -corners)

"""Scenes from numpy, and the few lines that render one on a device: for the tests of the renderer."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from rebound.gpu_scene import GpuScene
from rebound.renderer import Renderer
from rebound.scene.changes import Changes
from rebound.scene.data import AreaShape, Instance, Light, LightKind, Material, Mesh, Scene, View, Visibility
from rebound.settings import Settings

Array = np.ndarray
EVERYTHING = Visibility.CAMERA | Visibility.SHADOW | Visibility.BOUNCE
# Small maps and few samples: a test that needs more says so.
QUICK = {
    "shadow_resolution": 256,
    "rsm_resolution": 64,
    "rsm_gathers": 32,
    "vpl_bounces": "ONE",
    # Estimators are judged by what they find, not by what is left of it after a filter.
    "vpl_reuse": False,
    "vpl_denoise": False,
}


# --- meshes ----------------------------------------------------------------------------------------------------------


def triangles(name, positions, normals=None) -> Mesh:
    """A mesh from (3T, 3) corners; flat normals unless given. Its key is (name, what it holds)."""
    positions = np.asarray(positions, np.float32).reshape(-1, 3)
    if normals is None:
        a, b, c = positions.reshape(-1, 3, 3).astype(np.float64).transpose(1, 0, 2)
        flat = np.cross(b - a, c - a)
        normals = np.repeat(flat / np.linalg.norm(flat, axis=1, keepdims=True), 3, axis=0)
    bounds = np.stack((positions.min(0), positions.max(0)))
    slots = ((0, 0, len(positions) // 3),)
    normals = np.asarray(normals, np.float32)
    key = (name, hash(positions.tobytes() + normals.tobytes()))
    return Mesh(key, positions, normals, {}, "", slots, bounds)


def quad_corners(center, u, v) -> Array:
    """(6, 3): the parallelogram center +- u +- v, facing cross(u, v)."""
    c, u, v = (np.asarray(x, np.float64) for x in (center, u, v))
    a, b, d, e = c - u - v, c + u - v, c + u + v, c - u + v
    return np.array([a, b, d, a, d, e])


def quad(name, center=(0, 0, 0), u=(1, 0, 0), v=(0, 1, 0)) -> Mesh:
    """One parallelogram; by default 2 x 2 m, facing up."""
    return triangles(name, quad_corners(center, u, v))


def box(name, low, high, inward=False) -> Mesh:
    """An axis-aligned box; ``inward`` turns its normals to the inside (a room)."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    center, half = 0.5 * (low + high), 0.5 * (high - low)
    sides = []
    for axis in range(3):
        for sign in (-1, 1):
            n, u, v = (np.eye(3)[(axis + k) % 3] for k in range(3))
            flip = -1 if (sign < 0) != inward else 1
            sides.append(quad_corners(center + sign * n * half, flip * u * half, v * half))
    return triangles(name, np.concatenate(sides))


def sphere(name, center=(0, 0, 0), radius=1.0, rings=16, smooth=True) -> Mesh:
    """A UV sphere of 2 * rings segments."""
    theta = np.linspace(0, math.pi, rings + 1)
    phi = np.linspace(0, 2 * math.pi, 2 * rings + 1)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    grid = np.stack((np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)), -1)
    corners = []
    for i in range(rings):
        for j in range(2 * rings):
            a, b, c, d = grid[i, j], grid[i + 1, j], grid[i + 1, j + 1], grid[i, j + 1]
            corners += [a, b, c] if i < rings - 1 else []
            corners += [a, c, d] if i > 0 else []
            corners += [a, b, d] if i == rings - 1 else []
    unit = np.array(corners)
    return triangles(name, np.asarray(center) + radius * unit, unit if smooth else None)


# --- scenes ----------------------------------------------------------------------------------------------------------


def place(translation=(0, 0, 0), rotation=None, scale=(1, 1, 1)) -> Array:
    """A world matrix: translate @ rotate @ scale."""
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if rotation is None else np.asarray(rotation)) @ np.diag(np.asarray(scale, np.float64))
    matrix[:3, 3] = translation
    return matrix


def aimed(position, target, up=(0, 1, 0)) -> Array:
    """(3, 3) rotation whose -Z looks from ``position`` to ``target``."""
    z = np.asarray(position, np.float64) - target
    z = z / np.linalg.norm(z) if z.any() else np.array([0.0, 0.0, 1.0])
    up = np.asarray(up, np.float64)
    if abs(z @ up) > 0.99 * np.linalg.norm(up):
        up = np.roll(up, 1)
    x = np.cross(up, z)
    x /= np.linalg.norm(x)
    return np.stack((x, np.cross(z, x), z), 1)


def light(kind, position=(0, 0, 2), target=(0, 0, 0), power=100.0, key="light", scale=(1, 1, 1), **fields) -> Light:
    """A light at ``position`` that looks at ``target``; ``power`` a number or RGB."""
    rgb = tuple(float(x) for x in np.broadcast_to(power, 3))
    fields = {"spot_angle": math.radians(60)} | fields if kind == "SPOT" else fields
    if "area_shape" in fields:
        fields["area_shape"] = AreaShape[fields["area_shape"]]
    matrix = place(position, aimed(position, target), scale)
    return Light(key, key, LightKind[kind], rgb, matrix, **fields)


def scene(meshes, lights=(), albedo=0.8, matrices: Mapping[str, Array] | None = None, **fields) -> Scene:
    """One instance for each mesh, all of one grey (or RGB) material, or with ``materials`` one for each mesh.

    ``matrices`` and ``visibility`` go by the meshes' names, which are the instances' keys.
    """
    materials = fields.pop("materials", None)
    visibility = fields.pop("visibility", {})
    table = materials or (Material("Grey", tuple(float(x) for x in np.broadcast_to(albedo, 3))),)
    instances = tuple(
        Instance(
            mesh.key[0],
            mesh.key,
            (i if materials else 0,),
            (matrices or {}).get(mesh.key[0], np.eye(4)),
            visibility.get(mesh.key[0], EVERYTHING),
        )
        for i, mesh in enumerate(meshes)
    )
    return Scene({m.key: m for m in meshes}, instances, tuple(table), {}, tuple(lights), **fields)


def scaled(mesh_or_light, factor: float):
    """The same thing ``factor`` times as large; a light's power grows with the square, so that irradiance stays."""
    thing = mesh_or_light
    if isinstance(thing, Mesh):
        return triangles(thing.key[0], thing.positions.astype(np.float64) * factor, thing.normals)
    matrix = thing.world_from_light.copy()
    matrix[:3, 3] *= factor
    gain = 1.0 if thing.kind is LightKind.SUN else factor**2
    values = {name: getattr(thing, name) for name in thing.__dataclass_fields__}
    values |= {
        "world_from_light": matrix,
        "power": tuple(p * gain for p in thing.power),
        "radius": thing.radius * factor,
        "area_size": tuple(s * factor for s in thing.area_size),
    }
    return Light(**values)


# --- views -----------------------------------------------------------------------------------------------------------


def ortho(width=32, height=32, extent=2.0, position=(0, 0, 10), target=(0, 0, 0), depth=100.0, up=(0, 1, 0)) -> View:
    """An orthographic view, ``extent`` metres high, pixels square."""
    clip = np.diag([2.0 * height / (extent * width), 2.0 / extent, -2.0 / depth, 1.0])
    clip[2, 3] = -1.0
    return View(_view_from_world(position, target, up), clip, width, height)


def perspective(width=32, height=32, fov=60.0, position=(0, -4, 2), target=(0, 0, 0), near=0.01, far=1000.0) -> View:
    """A perspective view; ``fov`` is the vertical angle in degrees."""
    f = 1.0 / math.tan(math.radians(fov) / 2)
    clip = np.zeros((4, 4))
    clip[0, 0], clip[1, 1] = f * height / width, f
    clip[2, 2], clip[2, 3], clip[3, 2] = -(far + near) / (far - near), -2 * far * near / (far - near), -1
    return View(_view_from_world(position, target, (0, 0, 1)), clip, width, height)


def _view_from_world(position, target, up) -> Array:
    return np.linalg.inv(place(position, aimed(position, target, up)))


def pixel_centers(view: View, z=0.0) -> Array:
    """(h, w, 3) where an orthographic view that looks straight down meets the plane at height z."""
    x = (2 * np.arange(view.width) + 1) / view.width - 1
    y = (2 * np.arange(view.height) + 1) / view.height - 1
    gx, gy = np.meshgrid(x / view.clip_from_view[0, 0], y / view.clip_from_view[1, 1])
    points = np.stack((gx, gy, np.zeros_like(gx), np.ones_like(gx)), -1) @ np.linalg.inv(view.view_from_world).T
    points[..., 2] = z
    return points[..., :3]


# --- rendering -------------------------------------------------------------------------------------------------------


class Studio:
    """A GPU scene and a renderer on one device; ``render`` follows changes as a session does."""

    def __init__(self, device) -> None:
        self.device = device
        self.gpu_scene = GpuScene(device)
        self.renderer = Renderer(device)
        self._holds: Scene | None = None

    def show(self, scene: Scene) -> None:
        """Upload what differs from the last scene."""
        self.gpu_scene.update(scene, Changes.between(self._holds, scene))
        self._holds = scene

    def render(self, scene: Scene, view: View, samples=1, passes=("combined",), **changed) -> dict[str, Array]:
        """The named passes as float64, (h, w, channels), row 0 at the bottom."""
        settings = Settings.defaults(**{**QUICK, **changed})
        self.show(scene)
        frame = self.renderer.begin(view)
        try:
            for _ in range(samples):
                for _ in self.renderer.sample(frame, self.gpu_scene, view, settings):
                    pass
            return {name: self.renderer.read(frame, name).astype(np.float64) for name in passes}
        finally:
            self.renderer.free_frame(frame)

    def free(self) -> None:
        """Give back everything; OpenGL must have had nothing to complain of."""
        self.renderer.free()
        self.gpu_scene.free()
        assert self.device.error == "GL_NO_ERROR"

"""The faces a light looks at the scene through, and their tiles in an atlas. Plain numpy, no GPU.

A spot has one perspective face, a point light the six faces of a cube, an area light (and a spot too wide for one
face) the half cube before it. A sun has one orthographic face fitted to the scene; where a few huge objects (a ground
plane) would take nearly all of its texels, it has one fitted to the rest and a second for everything.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...scene.data import Light, LightKind

# A single perspective face beyond this full angle would spend most of its texels on the cone's edge.
WIDEST_SINGLE_FACE = math.radians(130.0)
# Room around a cone's edge: the receivers right on it, and those that a moved sample of the emitter sees.
CONE_MARGIN = 1.02
# Nearest distance that a perspective map holds, as a part of its farthest.
NEAR_OF_FAR = 1e-4
# float32 rounding of positions, of matrices and of a rasteriser's 1 / w over triangles that reach behind the light, in
# parts of the largest coordinate involved. Measured on Mesa: 5e-6 where a lamp stands just above a floor.
ROUNDING = 1e-5

# A sun gets a second face when leaving out at most so many objects makes its picture so many times smaller.
MOST_HUGE_OBJECTS = 4
WORTHWHILE_SHRINK = 16.0
# The narrow face reaches this part of its width further: the ground around an object is what bounces most onto it.
NEAR_MARGIN = 0.5

_CUBE = {  # forward, up: in the light's frame, in the order of map_face_of() in map_lib.glsl
    "-Z": ((0, 0, -1), (0, 1, 0)),
    "+X": ((1, 0, 0), (0, 1, 0)),
    "-X": ((-1, 0, 0), (0, 1, 0)),
    "+Y": ((0, 1, 0), (0, 0, 1)),
    "-Y": ((0, -1, 0), (0, 0, 1)),
    "+Z": ((0, 0, 1), (0, 1, 0)),
}


@dataclass(frozen=True, eq=False)
class Face:
    """One picture of the scene from a light. ``name`` tells a light's faces apart, "" where there is only one."""

    name: str
    face_from_world: np.ndarray  # (4, 4) float64: x right, y up, z forward
    scale: tuple[float, float]
    near: float
    far: float
    epsilon: float
    perspective: bool

    @property
    def clip_from_world(self) -> np.ndarray:
        """(4, 4) float64 OpenGL clip matrix."""
        clip = np.zeros((4, 4))
        clip[0, 0], clip[1, 1] = self.scale
        if self.perspective:
            near, far = self.near, self.far
            clip[2, 2], clip[2, 3] = (far + near) / (far - near), -2 * far * near / (far - near)
            clip[3, 2] = 1
        else:
            clip[2, 2], clip[2, 3], clip[3, 3] = 2 / self.far, -1, 1
        return clip @ self.face_from_world

    @property
    def texel_measure(self) -> float:
        """What one texel of a 1 x 1 tile covers: area at z = 1 (perspective), m² across the light (orthographic)."""
        return 4.0 / (self.scale[0] * self.scale[1])

    def sees(self, bounds: np.ndarray) -> np.ndarray:
        """Which of the (n, 2, 3) world boxes may lie in this face's view: (n,) bool, never falsely False."""
        if not len(bounds):
            return np.zeros(0, bool)
        pick = np.array([[(i >> k) & 1 for k in range(3)] for i in range(8)])
        corners = np.stack([bounds[:, pick[:, k], k] for k in range(3)] + [np.ones((len(bounds), 8))], -1)
        clip = corners @ self.clip_from_world.T
        w = clip[..., 3:]
        outside = np.concatenate([clip[..., :3] > w, clip[..., :3] < -w], -1).all(1)
        return ~outside.any(-1)


def light_axes(light: Light) -> np.ndarray:
    """(3, 3) unit columns at right angles: the light's own Z in the world, its X and Y as near as a shear lets them.

    A mirrored light keeps its mirrored frame.
    """
    x, y, z = np.asarray(light.world_from_light, np.float64)[:3, :3].T
    z = _unit(z, np.array((0.0, 0.0, 1.0)))
    x = _unit(x - z * (x @ z), _any_perpendicular(z))
    y = _unit(y - z * (y @ z) - x * (y @ x), np.cross(z, x))
    return np.stack([x, y, z], axis=1)


def _unit(v: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(v)
    return v / length if length > 1e-12 else otherwise


def spot_stretch(light: Light) -> tuple[float, float]:
    """The object's scale along Z over that along X and Y: a spot's cone is round in object space only."""
    x, y, z = np.linalg.norm(np.asarray(light.world_from_light, np.float64)[:3, :3], axis=0)
    return (float(z / x), float(z / y)) if min(x, y, z) > 0 else (1.0, 1.0)


def light_faces(light: Light, boxes: np.ndarray, source: np.ndarray | None = None) -> tuple[Face, ...]:
    """The faces of one light for a scene of instances within ``boxes`` (n, 2, 3), n > 0.

    ``source`` moves the light to a sample of its emitter: a point, for a sun the unit direction to it.
    """
    axes = light_axes(light)
    if light.kind is LightKind.SUN:
        return _sun_faces(axes, boxes, axes[:, 2] if source is None else source)
    bounds = np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)])
    origin = np.asarray(light.world_from_light[:3, 3] if source is None else source, np.float64)
    farthest = np.linalg.norm(np.maximum(abs(bounds[0] - origin), abs(bounds[1] - origin)))
    far = _rounded_up(max(float(farthest), 1e-6))
    reach = float(np.abs(bounds).max(initial=0.0)) + float(np.abs(origin).max())
    epsilon = ROUNDING * max(1.0, reach / far)
    if light.kind is LightKind.SPOT and light.spot_angle <= WIDEST_SINGLE_FACE:
        tangents = math.tan(0.5 * light.spot_angle) / np.array(spot_stretch(light))
        if tangents.max() <= math.tan(0.5 * WIDEST_SINGLE_FACE):
            scale = 1.0 / np.maximum(tangents * CONE_MARGIN, 1e-4)
            return (_cube_face("-Z", "", axes, origin, scale, far, epsilon),)
    names = list(_CUBE) if light.kind is LightKind.POINT else list(_CUBE)[:5]
    return tuple(_cube_face(name, name, axes, origin, (1.0, 1.0), far, epsilon) for name in names)


def _rounded_up(length: float) -> float:
    """To the next quarter of an octave: a map is not drawn again because something moved at the scene's far end."""
    return 2.0 ** (math.ceil(4.0 * math.log2(length * 1.001)) / 4.0)


def _cube_face(side, name, axes, origin, scale, far, epsilon) -> Face:
    forward, up = (axes @ np.asarray(v, np.float64) for v in _CUBE[side])
    scale = (float(scale[0]), float(scale[1]))
    return Face(name, _looking(origin, forward, up), scale, NEAR_OF_FAR * far, far, epsilon, True)


def _looking(origin, forward, up) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = np.cross(forward, up), up, forward
    matrix[:3, 3] = -matrix[:3, :3] @ origin
    return matrix


def _sun_faces(axes, boxes, to_sun) -> tuple[Face, ...]:
    """Orthographic, as small as the scene seen along the light allows; the view has no part in it."""
    rows = _sun_rows(axes, np.asarray(to_sun, np.float64))
    lower, upper = _seen_along(rows, boxes)
    everything = lower.min(0), upper.max(0)
    reach = float(np.abs(boxes).max())
    # Asked of the sun's own direction, so that all samples of its disc have the same number of faces.
    kept = _without_huge(*_seen_along(_sun_rows(axes, axes[:, 2]), boxes))
    if kept is None:
        return (_sun_face(rows, *everything, reach, ""),)
    # The narrow picture keeps the whole depth: what blocks the light may be huge.
    low, high = lower[kept].min(0), upper[kept].max(0)
    margin = NEAR_MARGIN * (high - low)
    low, high = np.maximum(low - margin, everything[0]), np.minimum(high + margin, everything[1])
    low[2], high[2] = everything[0][2], everything[1][2]
    return _sun_face(rows, low, high, reach, "Near"), _sun_face(rows, *everything, reach, "Far")


def _sun_rows(axes, to_sun) -> np.ndarray:
    """(3, 3) rotation into the frame of a sun's face: right, up, away from the sun."""
    forward = -to_sun
    up = axes[:, 1] - forward * (axes[:, 1] @ forward)
    up = _unit(up, _any_perpendicular(forward))
    return np.stack([np.cross(forward, up), up, forward])


def _seen_along(rows, boxes) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners, (n, 3) each, of the boxes in the frame of ``rows``."""
    centers = boxes.mean(1) @ rows.T
    halves = 0.5 * (boxes[:, 1] - boxes[:, 0]) @ np.abs(rows).T
    return centers - halves, centers + halves


def _without_huge(lower: np.ndarray, upper: np.ndarray) -> np.ndarray | None:
    """Indices of the boxes that remain when the fewest huge ones are left out, None where that gains too little."""
    extent = (upper - lower)[:, :2]
    order = np.argsort(extent.max(1))
    whole = _area(lower, upper)
    for left_out in range(1, min(MOST_HUGE_OBJECTS, len(order) - 1) + 1):
        kept = order[:-left_out]
        if whole > WORTHWHILE_SHRINK * _area(lower[kept], upper[kept]):
            return kept
    return None


def _area(lower: np.ndarray, upper: np.ndarray) -> float:
    return float(np.prod((upper.max(0) - lower.min(0))[:2]))


def _sun_face(rows, lower, upper, reach: float, name: str) -> Face:
    half = np.maximum(0.5 * (upper - lower), 1e-6) * 1.001
    center = 0.5 * (lower + upper)
    depth = 2.0 * half[2]
    matrix = np.eye(4)
    matrix[:3, :3] = rows
    matrix[:3, 3] = -center[0], -center[1], half[2] - center[2]
    epsilon = ROUNDING * max(1.0, reach / depth)
    return Face(name, matrix, (1.0 / half[0], 1.0 / half[1]), 0.0, depth, epsilon, False)


def _any_perpendicular(v: np.ndarray) -> np.ndarray:
    other = np.eye(3)[np.argmin(np.abs(v))]
    other = other - v * (other @ v)
    return other / np.linalg.norm(other)


@dataclass(frozen=True)
class Atlas:
    """Square tiles of one size in a square texture."""

    tiles: int
    tile: int  # texels along a tile's side
    columns: int

    @classmethod
    def fitting(cls, tiles: int, wanted: int, texel_budget: int, largest: int) -> Atlas:
        """As many tiles of the wanted size; halved until all fit the budget of texels and the largest texture."""
        columns = max(1, math.ceil(math.sqrt(tiles)))
        tile = wanted
        while tile > 16 and ((columns * tile) ** 2 > max(texel_budget, wanted**2) or columns * tile > largest):
            tile //= 2
        return cls(tiles, tile, columns)

    @property
    def size(self) -> tuple[int, int]:
        rows = max(1, math.ceil(self.tiles / self.columns))
        return self.columns * self.tile, rows * self.tile

    def origin(self, index: int) -> tuple[int, int]:
        return (index % self.columns) * self.tile, (index // self.columns) * self.tile

    def viewport(self, index: int) -> tuple[int, int, int, int]:
        return (*self.origin(index), self.tile, self.tile)


def face_row(face: Face, atlas: Atlas, index: int) -> dict:
    """The MAP_FACE table row of tile ``index``."""
    return {
        "face_from_world": face.face_from_world,
        "scale": face.scale,
        "origin": atlas.origin(index),
        "far": face.far,
        "near": face.near,
        "epsilon": face.epsilon,
        "tile": atlas.tile,
        "perspective": int(face.perspective),
    }

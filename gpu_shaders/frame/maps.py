"""The faces a light looks at the scene through, and their tiles in an atlas. Plain numpy, no GPU.

A spot has one perspective face, a point light the six faces of a cube, an area light (and a spot too wide for one
face) the half cube before it. A sun has one orthographic face fitted to the scene; where a few huge objects (a ground
plane) would take nearly all of its texels, it has one fitted to the rest and ever wider ones up to everything.
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
# Nearest distance that a perspective map holds, as a part of its farthest: a lamp's own shade, in a scene with a far
# horizon. Depth is kept by its float bits, so near and far are held equally well (map_depth() in map_lib.glsl).
NEAR_OF_FAR = 1e-6
# The float bits of that part and of 1: the range of a perspective map's depth.
NEAR_BITS, FAR_BITS = (int(np.float32(part).view(np.int32)) for part in (NEAR_OF_FAR, 1.0))
# How much wider a cube's faces are where shadows are filtered: room for a filter as wide as SHADOW_WIDEST_SEARCH of
# shadow_lib.glsl on each side.
FILTER_OVERLAP = 1.43
# A sun gets several faces when leaving out at most so many objects makes its picture so many times smaller.
MOST_HUGE_OBJECTS = 4
WORTHWHILE_SHRINK = 36.0
# The narrowest face reaches this part of its width further: the ground around an object bounces most onto it.
NEAR_MARGIN = 0.5
# The narrowest face is no narrower than this part of its length.
NARROWEST = 0.05
# Each face is so many times as wide as the one inside it: a texel stays a few percent of its distance from what the
# inner face holds, so the bounce that comes from there is not blurred.
CASCADE_STEP = 6.0

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
    def eye(self) -> tuple[float, float, float, float]:
        """The light's position and 1, or of an orthographic map the unit direction to the light and 0."""
        rotation, offset = self.face_from_world[:3, :3], self.face_from_world[:3, 3]
        return (*(-rotation.T @ offset).tolist(), 1.0) if self.perspective else (*(-rotation[2]).tolist(), 0.0)

    def metres(self, depth: np.ndarray) -> np.ndarray:
        """Distance along the face's axis from what its map holds as depth, float32: map_depth() inverted."""
        if not self.perspective:
            return depth * np.float32(self.far)
        bits = NEAR_BITS + np.rint(depth.astype(np.float64) * (FAR_BITS - NEAR_BITS)).astype(np.int32)
        return bits.view(np.float32) * np.float32(self.far)

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
    """(3, 3) unit columns: the light's own X, Y, Z in the world, at whatever angles a shear leaves them."""
    axes = np.asarray(light.world_from_light, np.float64)[:3, :3]
    return np.stack([_unit(axes[:, k], np.eye(3)[k]) for k in range(3)], axis=1)


def light_frame(light: Light) -> np.ndarray:
    """(3, 3) rotation from the frame of the light's maps into the world: its Z, its Y as near as a shear lets it."""
    axes = light_axes(light)
    z = axes[:, 2]
    y = _unit(axes[:, 1] - z * (axes[:, 1] @ z), _any_perpendicular(z))
    return np.stack([np.cross(y, z), y, z], axis=1)


def _unit(v: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(v)
    return v / length if length > 1e-12 else otherwise


def light_faces(
    light: Light, boxes: np.ndarray, source: np.ndarray | None = None, *, overlap: float = 1.0
) -> tuple[Face, ...]:
    """The faces of one light for a scene of instances within ``boxes`` (n, 2, 3), n > 0.

    ``source`` moves the light to a sample of its emitter: a point, for a sun the unit direction to it. ``overlap``
    above 1 makes the faces of a cube so many times as wide, so that a filter near their edge finds what is beyond it.
    """
    frame = light_frame(light)
    if light.kind is LightKind.SUN:
        return _sun_faces(frame, boxes, frame[:, 2] if source is None else source)
    bounds = np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)])
    origin = np.asarray(light.world_from_light[:3, 3] if source is None else source, np.float64)
    farthest = np.linalg.norm(np.maximum(abs(bounds[0] - origin), abs(bounds[1] - origin)))
    far = _rounded_up(max(float(farthest), 1e-6))
    if light.kind is LightKind.SPOT:
        tangents = _cone_tangents(light, frame)
        if tangents is not None and tangents.max() <= math.tan(0.5 * WIDEST_SINGLE_FACE):
            return (_cube_face("-Z", "", frame, origin, 1.0 / np.maximum(tangents * CONE_MARGIN, 1e-4), far),)
    names = list(_CUBE) if light.kind is LightKind.POINT else list(_CUBE)[:5]
    return tuple(_cube_face(name, name, frame, origin, (1.0 / overlap, 1.0 / overlap), far) for name in names)


def _cone_tangents(light: Light, frame: np.ndarray) -> np.ndarray | None:
    """(2,) how far a spot's cone, round in object space only, reaches along X and Y of its frame at distance 1.

    None for a cone that reaches to the side or behind.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    half = 0.5 * light.spot_angle
    edge = np.stack([math.sin(half) * np.cos(angles), math.sin(half) * np.sin(angles), np.full(64, -math.cos(half))])
    d = frame.T @ np.asarray(light.world_from_light, np.float64)[:3, :3] @ edge
    if (d[2] >= -1e-6 * np.abs(d).max()).any():
        return None
    return np.abs(d[:2] / d[2]).max(axis=1)


def _rounded_up(length: float) -> float:
    """To the next quarter of an octave: a map is not drawn again because something moved at the scene's far end."""
    return 2.0 ** (math.ceil(4.0 * math.log2(length * 1.001)) / 4.0)


def _cube_face(side, name, frame, origin, scale, far) -> Face:
    forward, up = (frame @ np.asarray(v, np.float64) for v in _CUBE[side])
    scale = (float(scale[0]), float(scale[1]))
    return Face(name, _looking(origin, forward, up), scale, NEAR_OF_FAR * far, far, True)


def _looking(origin, forward, up) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = np.cross(forward, up), up, forward
    matrix[:3, 3] = -matrix[:3, :3] @ origin
    return matrix


def _sun_faces(frame, boxes, to_sun) -> tuple[Face, ...]:
    """Orthographic, as small as the scene seen along the light allows; the view has no part in it."""
    rows = _sun_rows(frame, np.asarray(to_sun, np.float64))
    lower, upper = _seen_along(rows, boxes)
    everything = lower.min(0), upper.max(0)
    # Asked of the sun's own direction, so that all samples of its disc have the same number of faces.
    own_lower, own_upper = _seen_along(_sun_rows(frame, frame[:, 2]), boxes)
    kept = _without_huge(own_lower, own_upper)
    if kept is None:
        return (_sun_face(rows, *everything, ""),)
    wide = (own_upper.max(0) - own_lower.min(0))[:2] / _width(own_lower[kept], own_upper[kept])
    steps = max(math.ceil(math.log(wide.max() / (1.0 + 2.0 * NEAR_MARGIN), CASCADE_STEP)), 1)
    low, high = lower[kept].min(0), upper[kept].max(0)
    center, half = 0.5 * (low + high), 0.5 * (high - low)
    half[:2] = 0.5 * _width(lower[kept], upper[kept])
    low, high = center - half, center + half
    extents = [_widened(low, high, CASCADE_STEP**k, everything) for k in range(steps)] + [everything]
    return tuple(_sun_face(rows, *extent, f"Cascade {number}") for number, extent in enumerate(extents, 1))


def _widened(low, high, times: float, everything) -> tuple[np.ndarray, np.ndarray]:
    """The rectangle with its margin, ``times`` as wide, within everything; as deep as everything: whatever blocks the
    light may be huge.
    """
    center, half = 0.5 * (low + high), (0.5 + NEAR_MARGIN) * times * (high - low)
    low, high = np.maximum(center - half, everything[0]), np.minimum(center + half, everything[1])
    low[2], high[2] = everything[0][2], everything[1][2]
    return low, high


def _sun_rows(frame, to_sun) -> np.ndarray:
    """(3, 3) rotation into the frame of a sun's face: right, up, away from the sun."""
    forward = -to_sun
    up = frame[:, 1] - forward * (frame[:, 1] @ forward)
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
    whole = float(np.prod(_width(lower, upper)))
    for left_out in range(1, min(MOST_HUGE_OBJECTS, len(order) - 1) + 1):
        kept = order[:-left_out]
        area = float(np.prod(_width(lower[kept], upper[kept])))
        if whole > WORTHWHILE_SHRINK * area > 0.0:
            return kept
    return None


def _width(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """(2,) how wide boxes are together across the light; a plane seen edge-on counts as a little wide."""
    width = (upper.max(0) - lower.min(0))[:2]
    return np.maximum(width, NARROWEST * width.max())


def _sun_face(rows, lower, upper, name: str) -> Face:
    half = np.maximum(0.5 * (upper - lower), 1e-6) * 1.001
    center = 0.5 * (lower + upper)
    depth = 2.0 * half[2]
    matrix = np.eye(4)
    matrix[:3, :3] = rows
    matrix[:3, 3] = -center[0], -center[1], half[2] - center[2]
    return Face(name, matrix, (1.0 / half[0], 1.0 / half[1]), 0.0, depth, False)


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
        """As many tiles of the wanted size; halved until all fit the budget of texels and the largest texture.

        Halves are rounded down to a multiple of 16, so that blocks of so many texels straddle no two tiles.
        """
        columns = max(1, math.ceil(math.sqrt(tiles)))
        tile = wanted
        while tile > 16 and ((columns * tile) ** 2 > max(texel_budget, wanted**2) or columns * tile > largest):
            tile = max(tile // 32 * 16, 16)
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
        "tile": atlas.tile,
        "perspective": int(face.perspective),
    }

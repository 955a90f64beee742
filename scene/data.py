"""The scene as frozen numpy data: what every part of Rebound behind the depsgraph converter works on.

Nothing here imports Blender. Units are Blender's: metres, watts, radians; colours and radiance are scene-linear
in Blender's working space. Matrices are (4, 4) float64 row-major arrays that act on column vectors from the left:
``world = world_from_object @ local``. A light and a camera look down their own -Z, as in Blender.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from enum import Enum, IntFlag
from typing import Any

import numpy as np

from .node_graph import FilledGraph, NodeGraph

Array = np.ndarray
# Rec. 709 luminance of scene-linear RGB.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def decode_srgb(values: Array) -> Array:
    """IEC 61966-2-1: linear values of encoded ones, 0..1."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def encode_srgb(values: Array) -> Array:
    """The way back."""
    return np.where(values <= 0.0031308, values * 12.92, 1.055 * np.maximum(values, 0.0) ** (1 / 2.4) - 0.055)


# What bytes stand for.
BYTES = (np.arange(256) / 255.0).astype(np.float32)
SRGB_BYTES = decode_srgb(np.arange(256) / 255.0).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one evaluated geometry, expanded to corners and sorted by material slot.

    ``key`` names this very state of the geometry: two meshes with one key hold the same arrays, and an edit
    makes a new key. Corner arrays have 3 T rows for T triangles.
    """

    key: Hashable
    positions: Array  # (3T, 3) float32, object space
    normals: Array  # (3T, 3) float32, object space, unit; the shading normal of each corner
    uvs: Mapping[str, Array]  # UV map name -> (3T, 2) float32
    active_uv: str  # the map that an image texture uses by default; "" where there is none
    slots: tuple[tuple[int, int, int], ...]  # (material slot, first triangle, triangle count), slots ascending
    bounds: Array  # (2, 3) float32: lower and upper corner, object space
    warnings: tuple[str, ...] = ()  # what could not be read, for Scene.warnings of every scene that uses it
    attributes: Mapping[str, Array] = field(default_factory=dict)  # those its materials ask for -> (3T, 4) float32
    texture_space: Array | None = None  # (2, 3) float32: corners of the box of Generated coordinates; None: ``bounds``

    @property
    def triangle_count(self) -> int:
        return len(self.positions) // 3

    def corner_attribute(self, field: str, name: str) -> Array:
        """(3T, 2) of a UV map or (3T, 4) of a "color", float32; "" names the active one, zeros what is not there.

        A UV map may be asked for as a colour.
        """
        uvs = self.uvs.get(name or self.active_uv)
        if field == "uv":
            return np.zeros((len(self.positions), 2), np.float32) if uvs is None else uvs
        found = self.attributes.get(name)
        if found is None:
            found = np.zeros((len(self.positions), 4), np.float32)
            found[:, 3] = 1.0
            if uvs is not None and name:
                found[:, :2] = uvs
        return found


class Visibility(IntFlag):
    """What an instance takes part in."""

    CAMERA = 1  # seen by the camera
    SHADOW = 2  # blocks light
    BOUNCE = 4  # reflects light onto others (drawn into reflective shadow maps)
    HOLDOUT = 8  # seen by the camera as a hole: alpha 0, no radiance
    NO_INDIRECT = 16  # takes no light of other surfaces and of the sky: only lamps' direct light


@dataclass(frozen=True, eq=False)
class Instance:
    """One placed mesh."""

    key: Hashable  # identity: stable while the object is moved or edited
    mesh: Hashable  # Mesh.key
    materials: tuple[int, ...]  # index into Scene.materials for each material slot; at least one entry
    world_from_object: Array  # (4, 4) float64
    visibility: Visibility
    transfer: Hashable | None = None  # key in Scene.transfers of the bake that lights it
    color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)  # what Object Info tells of it, as the next two
    index: int = 0
    random: float = 0.0  # 0..1


@dataclass(frozen=True, eq=False)
class Transfer:
    """How one object passes the light of its surroundings on, as it was baked: what a file holds (docs/prt.md).

    ``key`` names this state of the file.
    """

    key: Hashable
    about: Mapping[str, Any]  # plain values: kind, fingerprints, settings, errors
    arrays: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class BakeState:
    """What has become of the bake that an object names; ``unused`` says why it lights nothing, "" where it does."""

    transfer: Hashable
    unused: str = ""
    about: Mapping[str, Any] = field(default_factory=dict)  # Transfer.about
    nbytes: int = 0  # of the transfer's arrays


@dataclass(frozen=True, eq=False)
class Image:
    """Pixels of one image, straight alpha, row 0 at the bottom: scene-linear numbers, or bytes as a file has them.

    ``key`` changes when the pixels do. A missing file has no Image: the material shows magenta instead, as in Blender,
    and Scene.warnings says so. The UDIM tiles of an image lie side by side in one.
    """

    key: Hashable
    name: str
    pixels: Array  # (H, W, 4) float32, or uint8: 0..1 in 255 steps
    warnings: tuple[str, ...] = ()  # what was approximated, for Scene.warnings of every scene that uses it
    is_srgb: bool = False  # bytes: their colours are to be decoded, after they are filtered
    tiles: tuple[tuple[int, int, int, int, int], ...] = ()  # UDIM number; x, y, width, height in pixels

    def linear(self, texels: Array | None = None) -> Array:
        """Scene-linear float32 of some of its texels (..., 4), by default of all."""
        stored = self.pixels if texels is None else texels
        if stored.dtype != np.uint8:
            return stored
        found = BYTES[stored]
        if self.is_srgb:
            found[..., :3] = SRGB_BYTES[stored[..., :3]]
        return found

    def nearest(self, uv: Array, *, repeat: bool) -> Array:
        """Scene-linear RGBA at UV coordinates (..., 2): of the nearest texel, magenta where a tile is not there."""
        tile = np.trunc(uv).astype(np.int64)  # as in Cycles, just below 0 is tile 0's
        size, at = np.broadcast_to(np.array(self.pixels.shape[1::-1]), uv.shape), np.zeros(uv.shape, np.int64)
        there = np.ones(uv.shape[:-1], bool)
        if self.tiles:
            places = {number: (x, y, w, h) for number, x, y, w, h in self.tiles}
            numbers = np.where((tile >= 0).all(-1) & (tile[..., 0] < 10), 1001 + tile[..., 0] + 10 * tile[..., 1], 0)
            rows = np.array([places.get(n, (0, 0, 0, 0)) for n in numbers.ravel().tolist()], np.int64)
            rows = rows.reshape(*uv.shape[:-1], 4)
            at, size = rows[..., :2], np.maximum(rows[..., 2:], 1)
            there, uv = rows[..., 2] > 0, uv - tile
        texel = np.floor(uv * size).astype(np.int64)
        texel = at + (texel % size if repeat else texel.clip(0, size - 1))
        found = self.linear(self.pixels[texel[..., 1], texel[..., 0]])
        return np.where(there[..., None], found, np.array((1.0, 0.0, 1.0, 1.0), np.float32))


@dataclass(frozen=True)
class Texture:
    """An image lookup by one UV map. ``uv_map`` "" means the mesh's active one."""

    image: Hashable  # Image.key
    uv_map: str = ""
    repeat: bool = True  # False: the edge pixels are extended
    closest: bool = False  # nearest texel instead of bilinear


@dataclass(frozen=True)
class Material:
    """A surface: a Lambertian reflector under a GGX lobe, that may emit and let light pass.

    Diffuse is ``base_color * (1 - metallic)``, less what the layer over it reflects. The lobe's reflectance at normal
    incidence (F0) goes from ``specular`` to ``base_color`` with ``metallic``; black there means no lobe.
    With a ``graph`` these are its look on the whole, for what is not drawn with it.
    """

    name: str
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)  # reflectance, 0..1
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)  # radiance, W/(m² sr); strength included
    metallic: float = 0.0  # 0..1
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)  # F0 of the dielectric part, 0..1
    roughness: float = 0.5  # 0..1, the square root of GGX's alpha
    layered: float = 1.0  # 0..1: how much of ``specular`` lies over the diffuse part and takes its light from it
    passing: float = 0.0  # 0..1: of light that goes on through it; above 0 only with a graph
    passes_lamps: bool = True  # whether lamps and suns light what is behind it, as far as it lets light pass
    culled: bool = False  # whether cameras see nothing of the backs of its faces
    culled_by_lamps: bool = False  # whether light of lamps goes on through the backs of its faces
    base_color_texture: Texture | None = None  # the image that the graph lays on as its base colour
    graph: FilledGraph | None = None  # what it is drawn by; None: it is the same all over
    index: int = 0  # its pass index, which Object Info tells

    @property
    def is_glossy(self) -> bool:
        return self.metallic > 0.0 or any(self.specular)


class LightKind(Enum):
    POINT = "POINT"
    SPOT = "SPOT"
    SUN = "SUN"
    AREA = "AREA"


class AreaShape(Enum):
    SQUARE = "SQUARE"
    RECTANGLE = "RECTANGLE"
    DISK = "DISK"
    ELLIPSE = "ELLIPSE"


@dataclass(frozen=True, eq=False)
class Light:
    """One light in Cycles' units.

    ``power`` is the RGB radiant power in watts (point, spot, area) or the RGB irradiance in W/m² of a surface that
    faces the light (sun); colour, temperature and exposure are already in it. A point or spot light of power P has
    the radiant intensity P / (4 pi) W/sr (the cone of a spot takes nothing away from it); an area light of area A
    and power P emits the radiance P / (pi A).
    """

    key: Hashable
    name: str
    kind: LightKind
    power: tuple[float, float, float]
    world_from_light: Array  # (4, 4) float64, with the object's scale
    radius: float = 0.0  # point, spot: metres
    soft_falloff: bool = True  # point, spot: the emitter is a disc that turns to the receiver; else a sphere
    angle: float = 0.0  # sun: angular diameter, radians
    spot_angle: float = 0.0  # spot: full cone angle, radians
    spot_blend: float = 0.0  # spot: 0..1
    area_shape: AreaShape = AreaShape.SQUARE
    area_size: tuple[float, float] = (1.0, 1.0)  # area: full extent along the light's X and Y, metres
    area_spread: float = np.pi  # area: radians
    casts_shadow: bool = True
    diffuse_factor: float = 1.0
    specular_factor: float = 1.0
    bounce: float = 1.0  # factor of its light once that was reflected; 0: it has no map and sends no bounce
    map_scale: float = 1.0  # its reflective shadow map against the others: a power of 2


@dataclass(frozen=True)
class World:
    """The background. ``color`` is radiance, strength included, of one that is the same on all sides.

    Any other has a ``graph``, whose emission in a direction is the radiance from there; ``color`` is black then.
    """

    color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    graph: NodeGraph | None = None
    values: tuple[float, ...] = ()  # the graph's numbers, four a texel
    images: tuple[Hashable, ...] = ()  # keys of Scene.images, by Node.image
    seen: bool = True  # by the camera; else the background is black
    diffuse: bool = True  # whether it lights diffusely, and in mirrors
    glossy: bool = True
    sun_threshold: float = 10.0  # radiance above which a compact spot is taken for a sun, 0: never
    sun_angle: float = 0.0  # least angular diameter of such a sun, radians

    @property
    def shines(self) -> bool:
        """Whether any light may come from it."""
        return self.graph is not None or any(self.color)


@dataclass(frozen=True, eq=False)
class View:
    """Where the picture is taken from. Width and height are the pixels really drawn (a border's own size).

    ``clip_from_view`` is an OpenGL projection (z in -1..1) of just those pixels, so a border, a shift or the viewport's
    zoom is already in it; pixel (0, 0) is the lower left one.
    """

    view_from_world: Array  # (4, 4) float64, rigid
    clip_from_view: Array  # (4, 4) float64
    width: int
    height: int

    @property
    def is_perspective(self) -> bool:
        return bool(abs(self.clip_from_view[3, 3]) < 0.5)


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that a frame needs except the view and the settings."""

    meshes: Mapping[Hashable, Mesh] = field(default_factory=dict)
    instances: tuple[Instance, ...] = ()
    materials: tuple[Material, ...] = (Material("Default"),)
    images: Mapping[Hashable, Image] = field(default_factory=dict)
    lights: tuple[Light, ...] = ()
    world: World = World()
    transfers: Mapping[Hashable, Transfer] = field(default_factory=dict)  # what was read, of use or not
    bakes: Mapping[Hashable, BakeState] = field(default_factory=dict)  # by Instance.key
    film_transparent: bool = False
    filter_width: float = 1.5  # Blender's pixel filter width, pixels
    warnings: tuple[str, ...] = ()  # one line each: what could not be read, and what is shown in its place

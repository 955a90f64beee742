"""Blender's Sky Texture node -> a picture of the sky, and its sun."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping

import numpy as np
from mathutils import Color

from . import sky
from .data import Array, Image
from .images import ImageReader

NOTHING = (0.0, 0.0, 0.0)


class SkyReader:
    """Reads the skies of one world."""

    def __init__(self, images: ImageReader):
        self._images = images

    def read(self, node) -> tuple[Hashable, Mapping[str, tuple[float, ...]]]:
        """The key of a node's picture, and the numbers of its sun. See ``gpu_shaders/materials/sky_lib.glsl``."""
        if node.sky_type in {"PREETHAM", "HOSEK_WILKIE"}:
            return self._daylight(node)
        return self._atmosphere(node)

    def _daylight(self, node) -> tuple[Hashable, Mapping[str, tuple[float, ...]]]:
        x, y, z = (float(c) for c in node.sun_direction)
        elevation = math.asin(min(max(z / (math.sqrt(x * x + y * y + z * z) or 1.0), 0.0), 1.0))
        numbers = (elevation, float(node.turbidity))
        if node.sky_type == "HOSEK_WILKIE":
            ground = float(node.ground_albedo)
            key = self._keep(("HOSEK", *numbers, ground), lambda: sky.daylight_picture(*numbers, ground))
        else:
            key = self._keep(("PREETHAM", *numbers), lambda: sky.preetham_picture(*numbers))
        return key, _sun(math.atan2(y, x), elevation)

    def _atmosphere(self, node) -> tuple[Hashable, Mapping[str, tuple[float, ...]]]:
        turn, elevation = 0.5 * math.pi - float(node.sun_rotation), float(node.sun_elevation)
        # Blender 5.0 gave aerosols their name.
        aerosol = node.aerosol_density if hasattr(node, "aerosol_density") else node.dust_density
        air = sky.Air(
            node.sky_type == "MULTIPLE_SCATTERING",
            elevation,
            float(node.altitude) * 1e-3,
            float(node.air_density),
            float(aerosol),
            float(node.ozone_density),
        )
        key = self._keep(("AIR", air), lambda: sky.sky_picture(air))
        if not node.sun_disc or node.sun_size <= 0.0:
            return key, _sun(turn, elevation)
        ends = (node.sun_intensity * _linear(xyz) for xyz in sky.sun_radiance(air, float(node.sun_size)))
        bottom, top = (tuple(end.tolist()) for end in ends)
        # One scattering has black ground from the true horizon down.
        earth = sky.horizon(air) if air.all_orders else 0.0
        return key, _sun(turn, elevation, 0.5 * float(node.sun_size), earth, bottom, top)

    def _keep(self, what: Hashable, make: Callable[[], Array]) -> Hashable:
        def image() -> Image:
            xyz = make()
            pixels = np.ones((*xyz.shape[:2], 4), np.float32)
            pixels[..., :3] = _linear(xyz)
            return Image(key, "Sky Texture", pixels)

        key = ("sky", repr(what))
        return self._images.keep(key, image)


def _linear(xyz: Array) -> Array:
    """XYZ to Blender's working space; what it cannot show is cut off, as in Cycles."""
    matrix = np.array([tuple(Color(axis).from_xyz_d65_to_scene_linear()) for axis in np.eye(3)])
    return np.maximum(xyz @ matrix, 0.0)


def _sun(turn, elevation, radius=0.0, earth=0.0, bottom=NOTHING, top=NOTHING) -> dict[str, tuple[float, ...]]:
    numbers = {"Turn": (turn,), "Elevation": (elevation,), "Radius": (radius,), "Earth": (earth,)}
    return {**numbers, "Bottom": bottom, "Top": top}

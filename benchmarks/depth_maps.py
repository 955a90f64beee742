"""Occlusion from directional depth maps on the standalone device: what bench_bake.py measures Embree against.

A depth map of the scene is drawn along each direction, and every vertex looks itself up in it: nearer surfaces along
that direction block. What a blocked ray hits first is not in such a map, which holds what lies farthest.
"""

from __future__ import annotations

import numpy as np

from rebound.device.headless import HeadlessDevice
from rebound.device.interface import DrawState
from rebound.device.shader import Shader
from rebound.scene.data import Array

SIDE = 1024  # texels of a map
_ROW = 1024  # vertices in a row of the texture that asks
# Of a texel's width: what the surface may rise over a texel that the vertex does not lie in the middle of.
_BIAS = 1.5
_VERTEX = "void main() { gl_Position = pc_map * vec4(in_position, 1.0); }\n"
_LOOK = """
void main()
{
  vec3 p = 0.5 + 0.5 * (pc_map * vec4(texelFetch(points_tx, ivec2(gl_FragCoord.xy), 0).xyz, 1.0)).xyz;
  float nearest = texelFetch(depth_tx, ivec2(p.xy * float(textureSize(depth_tx, 0).x)), 0).r;
  out_blocked = vec4(nearest < p.z - pc_bias);
}
"""
_DRAW = Shader(
    "depth_map", vertex="map_vert.glsl", inputs={"in_position": "VEC3"}, constants={"pc_map": "MAT4"},
    files={"map_vert.glsl": _VERTEX},
)  # fmt: skip
_ASK = Shader(
    "depth_map_ask", fragment="ask_frag.glsl", outputs={"out_blocked": "VEC4"}, files={"ask_frag.glsl": _LOOK},
    samplers={"points_tx": "FLOAT_2D", "depth_tx": "FLOAT_2D"}, constants={"pc_map": "MAT4", "pc_bias": "FLOAT"},
)  # fmt: skip


class DepthMaps:
    """Answers for a fixed set of triangles (t, 3, 3) and points (n, 3), one direction at a time."""

    def __init__(self, corners: Array, points: Array) -> None:
        self.device = HeadlessDevice()
        flat = corners.reshape(-1, 3)
        self._middle = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
        self._radius = 1.01 * float(np.linalg.norm(flat - self._middle, axis=1).max())
        self._triangles = self.device.vertices({"in_position": flat})
        rows = -(-len(points) // _ROW)
        data = np.zeros((rows * _ROW, 4), np.float32)
        data[: len(points), :3] = points
        self._points = self.device.texture((_ROW, rows), "RGBA32F", data.reshape(rows, _ROW, 4))
        self._count = len(points)
        self._depth = self.device.texture((SIDE, SIDE), "DEPTH32F")
        self._map = self.device.target((), self._depth)
        self._answer = self.device.texture((_ROW, rows), "R8")
        self._asked = self.device.target((self._answer,))

    def blocked(self, direction: Array) -> Array:
        """(n,) bool of the rays that leave every point along ``direction`` (3,)."""
        matrix = np.eye(4)
        across = np.linalg.svd(direction[None])[2][1:]
        matrix[:3, :3] = np.stack([*across, -direction]) / self._radius
        matrix[:3, 3] = -matrix[:3, :3] @ self._middle
        self.device.clear(self._map)
        state = DrawState(depth_test="LESS", depth_write=True)
        self.device.draw(_DRAW, self._triangles, self._map, state=state, pc_map=matrix)
        bias = _BIAS / SIDE
        resources = {"points_tx": self._points, "depth_tx": self._depth, "pc_map": matrix, "pc_bias": bias}
        self.device.fullscreen(_ASK, self._asked, **resources)
        return self.device.read(self._answer).reshape(-1)[: self._count] > 0

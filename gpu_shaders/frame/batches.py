"""Draws put together: all that one program draws of one page of meshes is one draw call.

A call draws chunks, each CHUNK_TRIANGLES of a mesh for an instance; the vertex shader finds its own by gl_VertexID
(mesh_lib.glsl). What is more than MOST_ROWS chunks for all its instances has a call to itself, instanced.
"""

from __future__ import annotations

from collections import OrderedDict, defaultdict
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...device.interface import Device, Texture
from ...device.shader import Shader
from .material_pass import material_program
from .structs import CHUNK_TRIANGLES
from .tables import replace_texels

if TYPE_CHECKING:
    from ...gpu_scene import Draw, GpuScene

MOST_ROWS = 1 << 16  # 1 MiB, and a million triangles or so
# Fewer chunks of pairs are not worth a call of their own.
LEAST_PAIRED = 64
# Chunks of all lists that are kept, 64 MiB: of every light map that is drawn anew again and again.
MOST_KEPT = 1 << 22

Passes = Callable[[int], bool]


@dataclass(frozen=True, eq=False)
class Batch:
    """One draw call."""

    program: Shader
    given: Mapping[str, Any]  # textures: chunks, the page's corners and attributes, the materials' images
    first_chunk: int
    chunk_count: int
    instances: int
    paired: bool = False  # all are pairs of triangles that share two corners, of which the vertex shader is asked once

    @property
    def triangles(self) -> int:
        """At most: the last chunk of a mesh is not full."""
        return CHUNK_TRIANGLES * self.chunk_count * self.instances


class Batches:
    """Those of one scene, by what is drawn and how; kept until the draws or their programs change."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._rows = np.zeros((0, 4), np.float32)  # chunks of all draws, one draw after the other
        self._paired = np.zeros(0, bool)  # of each, whether its triangles are pairs
        self._starts = np.zeros(1, np.int64)
        self._instances: Sequence[int] = ()  # instances of each draw's call
        self._kept: OrderedDict[Hashable, tuple[tuple[Batch, ...], Texture | None]] = OrderedDict()
        self._last: dict[Hashable, tuple[Sequence[Draw], tuple[Batch, ...]]] = {}

    def place(self, draws: Sequence[Draw]) -> None:
        """From now on these draws are the ones to choose from, known by their ``number``."""
        self.forget()
        triangles = np.array([draw.triangle_count for draw in draws], np.int64)
        chunks = -(-triangles // CHUNK_TRIANGLES)
        copies = np.array([draw.instance_count for draw in draws], np.int64)
        alone = (copies > 1) & (chunks * copies > MOST_ROWS)
        self._instances = np.where(alone, copies, 1).tolist()
        copies[alone] = 1
        self._starts = np.cumsum([0, *(chunks * copies)])
        of = np.repeat(np.arange(len(draws)), chunks * copies)
        copy, chunk = np.divmod(np.arange(len(of)) - self._starts[of], chunks[of])
        first = np.array([draw.first_on_page for draw in draws], np.int64)
        instance = np.array([draw.first_instance for draw in draws], np.int64)
        material = np.array([draw.material for draw in draws], np.int64)
        self._rows = np.empty((len(of), 4), np.float32)
        self._rows[:, 0] = first[of] + CHUNK_TRIANGLES * chunk
        self._rows[:, 1] = np.minimum(CHUNK_TRIANGLES, triangles[of] - CHUNK_TRIANGLES * chunk)
        self._rows[:, 2] = instance[of] + copy
        self._rows[:, 3] = material[of]
        self._paired = np.zeros(len(of), bool)
        for page in {draw.page for draw in draws}:
            mine = np.flatnonzero(np.array([draw.page is page for draw in draws], bool)[of])
            starts, counts = self._rows[mine, :2].astype(np.int64).T
            self._paired[mine] = page.is_paired(starts, counts)

    def of(self, gpu_scene: GpuScene, shader: Shader, draws: Sequence[Draw], passes: Passes) -> tuple[Batch, ...]:
        """The calls that draw ``draws`` with a pass. ``passes``: what light goes through, by the material's index."""
        last = self._last.get((shader, passes))
        if last is not None and last[0] is draws:  # as in every sample of a picture where nothing changed
            return last[1]
        key = (shader, passes, tuple([draw.number for draw in draws]))
        if key not in self._kept:
            self._kept[key] = self._put_together(gpu_scene, shader, draws, passes)
            self._drop_oldest()
        self._kept.move_to_end(key)
        found = self._kept[key][0]
        self._last[shader, passes] = draws, found
        return found

    def forget(self) -> None:
        """Put nothing together as it was: draws, materials or programs differ."""
        for _, table in self._kept.values():
            self.device.free(table)
        self._kept.clear()
        self._last.clear()

    def _put_together(
        self, gpu_scene: GpuScene, shader: Shader, draws: Sequence[Draw], passes: Passes
    ) -> tuple[tuple[Batch, ...], Texture | None]:
        asks = "material_tx" in shader.samplers
        programs: dict[int, tuple[Shader, tuple[Texture, ...]]] = {}  # and images, by material
        groups: dict[Hashable, list[Draw]] = defaultdict(list)
        for draw in draws:
            material = draw.material
            if material not in programs:
                code = gpu_scene.code_of(material) if asks else None
                images = tuple(gpu_scene.image_inputs(material).values()) if asks else ()
                how = asks and passes(material), asks and gpu_scene.culls(material, shader)
                programs[material] = material_program(shader, code, *how), images
            alone = draw.number if self._instances[draw.number] > 1 else -1
            groups[programs[material], draw.page, alone].append(draw)
        if not groups:
            return (), None
        runs = [(members, *self._run(members)) for members in groups.values()]
        table = replace_texels(self.device, np.concatenate([self._rows[chunks] for _, chunks, _ in runs]), None)
        found, first = [], 0
        for members, chunks, paired_count in runs:
            draw = members[0]
            given: dict[str, Any] = {"chunk_tx": table, "corner_tx": draw.page.corners}
            if asks:
                given |= gpu_scene.image_inputs(draw.material)
                given |= gpu_scene.attribute_inputs(draw.material, draw.page)
            program, instances = programs[draw.material][0], self._instances[draw.number]
            for count, paired in ((paired_count, True), (len(chunks) - paired_count, False)):
                if count:
                    found.append(Batch(program, given, first, count, instances, paired))
                first += count
        order = {program: number for number, (program, _) in enumerate(programs.values())}
        return tuple(sorted(found, key=lambda batch: order[batch.program])), table

    def _run(self, members: Sequence[Draw]) -> tuple[np.ndarray, int]:
        """The chunks of draws that go into one call, those that are pairs first; and how many that are, if it pays."""
        starts = [(int(self._starts[draw.number]), int(self._starts[draw.number + 1])) for draw in members]
        chunks = np.concatenate([np.arange(start, end) for start, end in starts])
        paired = self._paired[chunks]
        count = int(np.count_nonzero(paired))
        if self._instances[members[0].number] > 1 or count < LEAST_PAIRED:
            return chunks, 0
        return chunks[np.argsort(~paired, kind="stable")], count

    def _drop_oldest(self) -> None:
        texels = sum(table.size[0] * table.size[1] for _, table in self._kept.values() if table is not None)
        while texels > MOST_KEPT and len(self._kept) > 1:
            _, (batches, table) = self._kept.popitem(last=False)
            self._last = {key: last for key, last in self._last.items() if last[1] is not batches}
            if table is not None:
                texels -= table.size[0] * table.size[1]
                self.device.free(table)

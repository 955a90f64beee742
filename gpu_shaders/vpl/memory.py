"""Textures that one picture leaves to the next, each picture's of a size of its own, and those of one sample alone."""

from __future__ import annotations

from collections.abc import Sequence

from ...device.interface import Device, Target, Texture
from .filtering import AtrousFilter


class Memory:
    """``new`` are the kept textures of the picture that is drawn, ``old`` those of the picture before, by their names.

    ``scratch`` are the others and ``filter`` the à-trous filter, both of the size of ``new``. All are RGBA32F.
    """

    def __init__(self, device: Device) -> None:
        self.device = device
        self.size = (0, 0)
        self.new: dict[str, Texture] = {}
        self.old: dict[str, Texture] = {}
        self.scratch: dict[str, Texture] = {}
        self._filter: AtrousFilter | None = None
        self._sizes = [(0, 0), (0, 0)]  # of new and old
        self._targets: dict[tuple[Texture, ...], Target] = {}

    @property
    def filter(self) -> AtrousFilter:
        assert self._filter is not None, "begin() comes first"
        return self._filter

    def begin(
        self, size: tuple[int, int], kept: Sequence[str], scratch: Sequence[str], *, direct_apart: bool, turn: bool
    ) -> bool:
        """Have these textures, those of ``new`` and ``scratch`` of this size; whether ``old`` is a picture's.

        ``turn``: what was new becomes old first; else it is written over, and old stays as it is.
        """
        if turn:
            self.new, self.old = self.old, self.new
            self._sizes.reverse()
        knows_before = self._sizes[1] != (0, 0) and tuple(self.old) == tuple(kept)
        if not knows_before:
            self._remake(self.old, size, kept)
            self._sizes[1] = size
        if self._sizes[0] != size or tuple(self.new) != tuple(kept):
            self._remake(self.new, size, kept)
            self._sizes[0] = size
        if self.size != size or tuple(self.scratch) != tuple(scratch):
            self._remake(self.scratch, size, scratch)
            self._free_filter()
        if self._filter is None or bool(self._filter.direct) != direct_apart:
            self._free_filter()
            self._filter = AtrousFilter(self.device, size, direct_apart=direct_apart)
        self.size = size
        return knows_before

    def target(self, *textures: Texture) -> Target:
        """One that draws into these, kept as long as they are."""
        if textures not in self._targets:
            self._targets[textures] = self.device.target(textures)
        return self._targets[textures]

    def free(self) -> None:
        for textures in (self.new, self.old, self.scratch):
            self._remake(textures, (0, 0), ())
        self._free_filter()
        self.size, self._sizes = (0, 0), [(0, 0), (0, 0)]

    def _remake(self, textures: dict[str, Texture], size: tuple[int, int], names: Sequence[str]) -> None:
        for texture in textures.values():
            self._free(texture)
        textures.clear()
        textures.update({name: self.device.texture(size, "RGBA32F") for name in names})

    def _free(self, texture: Texture) -> None:
        self._free_targets(texture)
        self.device.free(texture)

    def _free_targets(self, texture: Texture) -> None:
        for drawn in [drawn for drawn in self._targets if texture in drawn]:
            self.device.free(self._targets.pop(drawn))

    def _free_filter(self) -> None:
        if self._filter is None:
            return
        for texture in (*self._filter.light, *self._filter.direct):
            self._free_targets(texture)
        for resource in self._filter.resources:
            self.device.free(resource)
        self._filter = None

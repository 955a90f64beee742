"""What a bake shows under a light: the part that is worked out again when the surroundings turn or change.

Products of matrices on the CPU; the GPU only interpolates, and for glossy bakes looks up a direction (gpu_shaders/prt).
"""

from __future__ import annotations

import numpy as np

from ..scene.data import Transfer
from . import haar, sh
from .file import Bake
from .job import glossy_matrices, wavelet_rows
from .light import Surroundings
from .sphere import Array


class Live:
    """One bake, laid out so that a light is answered quickly.

    ``coefficients``: numbers of result a vertex and colour, 1 of irradiance / pi or those of the arriving radiance.
    """

    coefficients = 1

    def __init__(self, transfer: Transfer) -> None:
        settings = transfer.about["settings"]
        self.bounces = bool(settings["bounces"] and settings["shadows"])  # whether light that bounced is in it

    def answer(self, light: Surroundings, frame: Array, bands: int, window: float, terms: int) -> Array:
        """(vertices, coefficients, 3) float32 for an object whose axes are ``frame`` (surfaces.frame_of).

        ``bands`` at most are used of harmonics, ``terms`` of wavelets. See ``Surroundings.harmonics`` for ``window``.
        """
        raise NotImplementedError

    def coefficient(self, term: int, result: int) -> Array:
        """(vertices,) coefficient ``term`` of the transfer, the mean of its colours; of matrices in row ``result``.

        Zero where there is none of that number.
        """
        raise NotImplementedError


class LiveDiffuse(Live):
    """Vectors of spherical harmonics: irradiance / pi."""

    def __init__(self, transfer: Transfer) -> None:
        super().__init__(transfer)
        self._vectors = transfer.arrays["diffuse"].astype(np.float32)

    def answer(self, light: Surroundings, frame: Array, bands: int, window: float, terms: int) -> Array:
        return _by_vectors(self._vectors, light, frame, bands, window)[:, None]

    def coefficient(self, term: int, result: int) -> Array:
        return self._vectors[..., term : term + 1].sum(axis=2).mean(axis=1)


class LiveGlossy(Live):
    """Compressed matrices: coefficients of the radiance that arrives, along the object's axes.

    The light goes through each cluster's mean and axes once; a vertex then mixes a few results.
    """

    def __init__(self, transfer: Transfer) -> None:
        super().__init__(transfer)
        packed = glossy_matrices(Bake(transfer.about, transfer.arrays))
        channels, result, self._light = transfer.about["matrix"]
        self.coefficients = result
        count, axes = packed.axes.shape[:2]
        every = np.concatenate([packed.means[:, None], packed.axes], axis=1).astype(np.float32)
        # (clusters, 1 + axes, channels, result, light)
        self._every = every.reshape(count, 1 + axes, channels, result, self._light)
        # Vertices of one cluster together: their mix is one product.
        self._order = np.argsort(packed.clusters, kind="stable")
        ones = np.ones((len(packed.clusters), 1), np.float32)
        self._weights = np.concatenate([ones, packed.weights.astype(np.float32)], axis=1)[self._order]
        self._ends = np.searchsorted(packed.clusters[self._order], np.arange(count), side="right")

    def answer(self, light: Surroundings, frame: Array, bands: int, window: float, terms: int) -> Array:
        local = _local(light, frame, min(bands, sh.band_count(self._every)), window)
        local = np.pad(local, ((0, 0), (0, self._light - local.shape[1]))).astype(np.float32)
        channels = np.broadcast_to(self._every, (*self._every.shape[:2], 3, *self._every.shape[3:]))
        seen = np.einsum("kacrl,cl->karc", channels, local, optimize=True)
        seen = np.ascontiguousarray(seen).reshape(*seen.shape[:2], -1)
        found = np.empty((len(self._order), seen.shape[2]), np.float32)
        start = 0
        for cluster, end in enumerate(self._ends):
            found[self._order[start:end]] = self._weights[start:end] @ seen[cluster]
            start = end
        return found.reshape(len(found), self.coefficients, 3)

    def coefficient(self, term: int, result: int) -> Array:
        parts = self._every[..., result : result + 1, term : term + 1].sum(axis=(3, 4)).mean(axis=2)
        found = np.empty(len(self._order), np.float32)
        clusters = np.searchsorted(self._ends, np.arange(len(found)), side="right")
        found[self._order] = (self._weights * parts[clusters]).sum(axis=1)
        return found


class LiveWavelet(Live):
    """Sparse rows of wavelets, kept by term: of a light that has few, only those are looked at."""

    def __init__(self, transfer: Transfer) -> None:
        super().__init__(transfer)
        rows = wavelet_rows(Bake(transfer.about, transfer.arrays))
        self._size = int(transfer.about["settings"]["texels"])
        self._vertices = len(rows.scales)
        order = np.argsort(rows.terms, kind="stable")
        owners = rows.rows
        self._owners = owners[order].astype(np.uint32)
        self._values = (rows.steps * rows.scales[owners])[order].astype(np.float32)
        self._ends = np.searchsorted(rows.terms[order], np.arange(rows.width), side="right")
        self._energy = rows.energy()
        bounced = transfer.arrays.get("bounced")
        self._bounced = None if bounced is None else bounced.astype(np.float32)

    def answer(self, light: Surroundings, frame: Array, bands: int, window: float, terms: int) -> Array:
        cube = np.moveaxis(light.cube(self._size, frame), -1, 0)
        coefficients = haar.forward(cube).reshape(3, -1)
        chosen = haar.strongest(coefficients, terms, self._energy)
        found = np.zeros((self._vertices, 3), np.float32)
        places = [slice(self._ends[t - 1] if t else 0, self._ends[t]) for t in chosen]
        owners = np.concatenate([self._owners[place] for place in places])
        values = np.concatenate([self._values[place] for place in places])
        counts = [place.stop - place.start for place in places]
        for channel in range(3):
            weights = values * np.repeat(coefficients[channel, chosen].astype(np.float32), counts)
            found[:, channel] = np.bincount(owners, weights, self._vertices)
        if self._bounced is not None:
            found += _by_vectors(self._bounced, light, frame, bands, window)
        return found[:, None]

    def coefficient(self, term: int, result: int) -> Array:
        if term >= len(self._ends):
            return np.zeros(self._vertices, np.float32)
        place = slice(self._ends[term - 1] if term else 0, self._ends[term])
        return np.bincount(self._owners[place], self._values[place], self._vertices)


_KINDS: dict[str, type[Live]] = {"DIFFUSE": LiveDiffuse, "GLOSSY": LiveGlossy, "WAVELET": LiveWavelet}


def make_live(transfer: Transfer) -> Live:
    """That of the transfer's kind."""
    return _KINDS[transfer.about["kind"]](transfer)


def _local(light: Surroundings, frame: Array, bands: int, window: float) -> Array:
    """(3, bands²) coefficients along an object's axes."""
    return sh.rotate(light.harmonics(bands, window), frame.T)


def _by_vectors(vectors: Array, light: Surroundings, frame: Array, bands: int, window: float) -> Array:
    """(vertices, 3) of vectors (vertices, 1 or 3, terms)."""
    bands = min(bands, sh.band_count(vectors))
    local = _local(light, frame, bands, window).astype(np.float32)
    used = vectors[..., : bands * bands]
    if used.shape[1] == 1:
        return used[:, 0] @ local.T
    return np.stack([used[:, c] @ local[c] for c in range(3)], axis=-1)

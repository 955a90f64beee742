"""What a bake shows under a light: the part that is worked out again when the surroundings turn or change.

Products of matrices on the CPU; the GPU only interpolates, and for glossy bakes looks up a direction (gpu_shaders/prt).
"""

from __future__ import annotations

import numpy as np

from ..gpu_shaders.prt.shaders import Look
from ..scene.data import Transfer
from . import haar, sh
from .file import Bake
from .job import glossy_matrices, wavelet_rows
from .light import Surroundings
from .sphere import Array


class Live:
    """One bake, laid out so that a light is answered quickly.

    ``coefficients``: numbers of result a vertex and colour. ``look``: what they are. Behind the vertices come the
    points inside triangles that ``splits`` lead to (refine.Detail).
    """

    coefficients = 1
    look = Look.MATT
    views: Array | None = None  # of Look.LOBE: Separable.table()

    def __init__(self, transfer: Transfer) -> None:
        settings = transfer.about["settings"]
        self.bounces = bool(settings["bounces"] and settings["shadows"])  # whether light that bounced is in it
        self.splits: Array | None = transfer.arrays.get("splits")

    def answer(self, light: Surroundings, frame: Array, bands: int, window: float, terms: int) -> Array:
        """(vertices and points, coefficients, 3) float32 for an object whose axes are ``frame`` (surfaces.frame_of).

        ``bands`` at most are used of harmonics, ``terms`` of wavelets. See ``Surroundings.harmonics`` for ``window``.
        """
        raise NotImplementedError

    def held(self, bands: int) -> int:
        """Look.HARMONICS: bands of what is reflected, where ``bands`` at most are used of the light."""
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


class _Mixed:
    """Compressed matrices: light goes through each cluster's mean and axes once; a vertex then mixes a few results."""

    def __init__(self, transfer: Transfer) -> None:
        packed = glossy_matrices(Bake(transfer.about, transfer.arrays))
        channels, self.results, self._light = transfer.about["matrix"]
        self.bands = round(self._light**0.5)  # of the light
        count, axes = packed.axes.shape[:2]
        every = np.concatenate([packed.means[:, None], packed.axes], axis=1).astype(np.float32)
        # (clusters, 1 + axes, channels, results, light)
        self._every = every.reshape(count, 1 + axes, channels, self.results, self._light)
        # Vertices of one cluster together: their mix is one product.
        self._order = np.argsort(packed.clusters, kind="stable")
        ones = np.ones((len(packed.clusters), 1), np.float32)
        self._weights = np.concatenate([ones, packed.weights.astype(np.float32)], axis=1)[self._order]
        self._ends = np.searchsorted(packed.clusters[self._order], np.arange(count), side="right")

    def answer(self, light: Surroundings, frame: Array, bands: int, window: float) -> Array:
        """(vertices, results, 3)"""
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
        return found.reshape(len(found), self.results, 3)

    def coefficient(self, term: int, result: int) -> Array:
        parts = self._every[..., result : result + 1, term : term + 1].sum(axis=(3, 4)).mean(axis=2)
        found = np.empty(len(self._order), np.float32)
        clusters = np.searchsorted(self._ends, np.arange(len(found)), side="right")
        found[self._order] = (self._weights * parts[clusters]).sum(axis=1)
        return found


class LiveGlossy(Live):
    """Compressed matrices: coefficients of the radiance that arrives, along the object's axes."""

    look = Look.HARMONICS

    def __init__(self, transfer: Transfer) -> None:
        super().__init__(transfer)
        self._matrices = _Mixed(transfer)
        self.coefficients = self._matrices.results

    def answer(self, light: Surroundings, frame: Array, bands: int, window: float, terms: int) -> Array:
        return self._matrices.answer(light, frame, bands, window)

    def held(self, bands: int) -> int:
        return min(bands, self._matrices.bands, round(self.coefficients**0.5))

    def coefficient(self, term: int, result: int) -> Array:
        return self._matrices.coefficient(term, result)


class _ByTerm:
    """Sparse rows of wavelets, kept by term: of a light that has few, only those are looked at."""

    def __init__(self, rows: haar.SparseRows) -> None:
        self.count = len(rows.scales)
        order = np.argsort(rows.terms, kind="stable")
        owners = rows.rows
        self._owners = owners[order].astype(np.uint32)
        self._values = (rows.steps * rows.scales[owners])[order].astype(np.float32)
        self._ends = np.searchsorted(rows.terms[order], np.arange(rows.width), side="right")
        self.energy = rows.energy()

    def answer(self, coefficients: Array, chosen: Array) -> Array:
        """(rows, 3) of the light's ``coefficients`` (3, width), of those terms alone."""
        found = np.zeros((self.count, 3), np.float32)
        places = [slice(self._ends[t - 1] if t else 0, self._ends[t]) for t in chosen]
        owners = np.concatenate([self._owners[place] for place in places])
        values = np.concatenate([self._values[place] for place in places])
        counts = [place.stop - place.start for place in places]
        for channel in range(3):
            weights = values * np.repeat(coefficients[channel, chosen].astype(np.float32), counts)
            found[:, channel] = np.bincount(owners, weights, self.count)
        return found

    def column(self, term: int) -> Array:
        """(rows,)"""
        if term >= len(self._ends):
            return np.zeros(self.count, np.float32)
        place = slice(self._ends[term - 1] if term else 0, self._ends[term])
        return np.bincount(self._owners[place], self._values[place], self.count)


class LiveWavelet(Live):
    """Sparse rows of wavelets, and vectors of spherical harmonics of light that bounced."""

    def __init__(self, transfer: Transfer) -> None:
        super().__init__(transfer)
        self._rows = _ByTerm(wavelet_rows(Bake(transfer.about, transfer.arrays)))
        self._size = int(transfer.about["settings"]["texels"])
        bounced = transfer.arrays.get("bounced")
        self._bounced = None if bounced is None else bounced.astype(np.float32)

    def answer(self, light: Surroundings, frame: Array, bands: int, window: float, terms: int) -> Array:
        coefficients = _wavelets(light, frame, self._size)
        found = self._rows.answer(coefficients, haar.strongest(coefficients, terms, self._rows.energy))
        if self._bounced is not None:
            found += _by_vectors(self._bounced, light, frame, bands, window)
        return found[:, None]

    def coefficient(self, term: int, result: int) -> Array:
        return self._rows.column(term)


class LiveWaveletGlossy(Live):
    """Sparse rows of the matt side and of each factor of a lobe; matrices of what bounces add to them.

    Behind irradiance / pi and the K numbers of the lobe, an answer has each vertex' normal and tangent, along the
    object's axes: what is seen of those K depends on the view along them (separable.py).
    """

    look = Look.LOBE

    def __init__(self, transfer: Transfer) -> None:
        super().__init__(transfer)
        bake = Bake(transfer.about, transfer.arrays)
        self._matt, self._lobe = _ByTerm(wavelet_rows(bake)), _ByTerm(wavelet_rows(bake, "lobe_"))
        self._energy = np.hypot(self._matt.energy, self._lobe.energy)
        self._bounced = _Mixed(transfer) if "means" in transfer.arrays else None
        self._turns = transfer.arrays["turns"].astype(np.float32)
        self._size = int(transfer.about["settings"]["texels"])
        self.views = transfer.arrays["lobe"]
        self.coefficients = 3 + self.views.shape[1]

    def answer(self, light: Surroundings, frame: Array, bands: int, window: float, terms: int) -> Array:
        coefficients = _wavelets(light, frame, self._size)
        chosen = haar.strongest(coefficients, terms, self._energy)
        matt = self._matt.answer(coefficients, chosen)[:, None]
        lobe = self._lobe.answer(coefficients, chosen).reshape(len(matt), -1, 3)
        found = np.concatenate([matt, lobe, self._turns], axis=1)
        if self._bounced is not None:
            found[:, :-2] += self._bounced.answer(light, frame, bands, window)
        return found

    def coefficient(self, term: int, result: int) -> Array:
        if result == 0:
            return self._matt.column(term)
        rows = self._lobe.column(term).reshape(self._matt.count, -1)
        return rows[:, result - 1] if result <= rows.shape[1] else np.zeros(len(rows), np.float32)


_KINDS: dict[str, type[Live]] = {
    "DIFFUSE": LiveDiffuse,
    "GLOSSY": LiveGlossy,
    "WAVELET": LiveWavelet,
    "WAVELET_GLOSSY": LiveWaveletGlossy,
}


def make_live(transfer: Transfer) -> Live:
    """That of the transfer's kind."""
    return _KINDS[transfer.about["kind"]](transfer)


def _wavelets(light: Surroundings, frame: Array, size: int) -> Array:
    """(3, 6 size²) coefficients along an object's axes."""
    return haar.forward(np.moveaxis(light.cube(size, frame), -1, 0)).reshape(3, -1)


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

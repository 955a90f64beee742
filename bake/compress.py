"""Many long rows kept as few numbers each: clustered principal components (Sloan, Hall, Hart, Snyder 2003).

Rows that look alike share a mean and a few axes; a row is then the number of its cluster and one weight an axis. All is
kept in half floats, and the error is measured after rounding to them.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from .sphere import Array
from .transfer import Progress

# Rows are sorted into clusters by this many of their principal components; what is beyond them moves few rows.
_SORTING = 48
_ROUNDS = 8
# How many axes a cluster is thought to have while rows are sorted by what it cannot express of them.
_TRIAL_AXES = 6
_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Compressed:
    """n rows of d numbers: row i is means[c] + weights[i] @ axes[c] with c = clusters[i].

    ``rms`` is the root mean square error of a row over the root mean square length of the rows, ``worst`` the largest
    error of a row over the same length: what the compression states of itself.
    """

    clusters: Array  # (n,) uint16
    weights: Array  # (n, k) float16
    means: Array  # (clusters, d) float16
    axes: Array  # (clusters, k, d) float16, orthonormal
    rms: float
    worst: float

    @property
    def nbytes(self) -> int:
        return self.clusters.nbytes + self.weights.nbytes + self.means.nbytes + self.axes.nbytes

    def rows(self, run: slice = slice(None)) -> Array:
        """(n, d) float32 of the rows in ``run``."""
        return _expand(self.clusters[run], self.weights[run], self.means, self.axes)


def _expand(clusters: Array, weights: Array, means: Array, axes: Array) -> Array:
    found = means[clusters].astype(np.float32)
    for cluster in np.unique(clusters):
        own = clusters == cluster
        found[own] += weights[own].astype(np.float32) @ axes[cluster].astype(np.float32)
    return found


def compress(
    rows: Array, error: float, most_axes: int = 24, clusters: int = 64
) -> Generator[Progress, None, Compressed]:
    """Rows (n, d) as clusters with as few axes as keep ``rms`` at ``error``, but no more than ``most_axes``.

    Where those do not reach it, the result says how far it came. Closing the generator ends the work.
    """
    rows = np.asarray(rows, np.float32)
    clusters = max(1, min(clusters, len(rows) // 16))
    member = yield from _sort(rows, clusters)
    member = np.unique(member, return_inverse=True)[1].reshape(-1)  # a cluster may have come out empty
    groups = [np.nonzero(member == c)[0] for c in range(member.max() + 1)]
    means = np.stack([rows[group].mean(axis=0) for group in groups])
    found, tails = [], np.zeros(most_axes + 1)
    for done, (group, mean) in enumerate(zip(groups, means, strict=True)):
        yield Progress(0.5 + 0.5 * done / len(groups), "components")
        axes, left = _components(rows[group] - mean, most_axes)
        found.append(axes)
        tails += left
    # Half floats round by 2^-12 of a number: that much of the error is theirs.
    enough = np.nonzero(np.sqrt(tails / max((rows.astype(np.float64) ** 2).sum(), 1e-300)) <= error)[0]
    count = int(enough[0]) if len(enough) else most_axes
    axes = np.stack([a[:count] for a in found]).astype(np.float16)
    return _measured(rows, member.astype(np.uint16), means.astype(np.float16), axes)


def _measured(rows: Array, member: Array, means: Array, axes: Array) -> Compressed:
    """Weights for the rounded means and axes, and the error that is left."""
    weights = np.empty((len(rows), axes.shape[1]), np.float16)
    squared, length = np.zeros(len(rows)), max(float(np.sqrt((rows.astype(np.float64) ** 2).sum() / len(rows))), 1e-300)
    for cluster in range(len(means)):
        own = np.nonzero(member == cluster)[0]
        rest = rows[own] - means[cluster].astype(np.float32)
        basis = axes[cluster].astype(np.float32)
        weights[own] = rest @ basis.T
        squared[own] = ((rest - weights[own].astype(np.float32) @ basis) ** 2).sum(axis=1, dtype=np.float64)
    rms = float(np.sqrt(squared.mean())) / length
    return Compressed(member, weights, means, axes, rms, float(np.sqrt(squared.max())) / length)


def _components(rest: Array, count: int) -> tuple[Array, Array]:
    """(count, d) principal axes of rows around 0, and (count + 1,) the squared sum left with 0, 1, ... of them.

    By the eigenvectors of whichever is smaller, the rows' or the columns' products. Missing axes are 0.
    """
    tall = len(rest) > rest.shape[1]
    values, vectors = np.linalg.eigh((rest.T @ rest if tall else rest @ rest.T).astype(np.float64))
    values, vectors = values[::-1].clip(0), vectors[:, ::-1]
    use = min(count, int((values > 1e-12 * max(values[0], 1e-300)).sum()))
    axes = np.zeros((count, rest.shape[1]))
    axes[:use] = vectors[:, :use].T if tall else (vectors[:, :use].T @ rest) / np.sqrt(values[:use, None])
    kept = np.concatenate([[0.0], np.cumsum(values[:count]), np.full(max(0, count - len(values)), values.sum())])
    return axes, (values.sum() - kept).clip(0)


def _sort(rows: Array, clusters: int) -> Generator[Progress, None, Array]:
    """(n,) the cluster of each row: nearest mean first, then the cluster whose mean and axes express it best."""
    yield Progress(0.0, "clusters")
    sample = rows[:: max(1, len(rows) // 8192)]
    axes, _ = _components(sample - sample.mean(axis=0), min(_SORTING, rows.shape[1]))
    small = (rows @ axes.T.astype(np.float32)).astype(np.float64)
    # Evenly along the first component: the same rows always give the same clusters.
    start = np.argsort(small[:, 0], kind="stable")[np.linspace(0, len(rows) - 1, clusters).astype(np.int64)]
    means, bases = small[start], np.zeros((clusters, 0, small.shape[1]))
    member = np.zeros(len(rows), np.int64)
    for turn in range(_ROUNDS):
        yield Progress(0.5 * turn / _ROUNDS, "clusters")
        member = np.concatenate([_best(small[i : i + _CHUNK], means, bases) for i in range(0, len(small), _CHUNK)])
        bases = np.zeros((clusters, _TRIAL_AXES if turn >= _ROUNDS // 2 else 0, small.shape[1]))
        for cluster in np.unique(member):
            own = small[member == cluster]
            means[cluster] = own.mean(axis=0)
            if bases.shape[1]:
                bases[cluster] = _components(own - means[cluster], bases.shape[1])[0]
    return member


def _best(rows: Array, means: Array, bases: Array) -> Array:
    """(n,) which mean is nearest, distance along the cluster's own axes not counted."""
    costs = np.empty((len(rows), len(means)))
    for cluster, (mean, basis) in enumerate(zip(means, bases, strict=True)):
        rest = rows - mean
        costs[:, cluster] = (rest**2).sum(axis=1) - ((rest @ basis.T) ** 2).sum(axis=1)
    return costs.argmin(axis=1)

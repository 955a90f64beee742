"""Clustered principal components: the stated error is the real one, and the size fits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rebound.bake.compress import compress
from rebound.bake.glossy import glossy
from rebound.bake.transfer import Progress, Sampling, finish
from rebound.tests.support.bake_scenes import grid, placed, surfaces_of
from rebound.tests.support.render_scenes import sphere


def clustered(count, width, groups=4, axes=3, noise=0.0, seed=0):
    """Rows around a few means, each group in few dimensions."""
    random = np.random.default_rng(seed)
    means, bases = random.normal(size=(groups, width)) * 3, random.normal(size=(groups, axes, width))
    group = random.integers(groups, size=count)
    rows = means[group] + np.einsum("nk,nkd->nd", random.normal(size=(count, axes)), bases[group])
    return (rows + noise * random.normal(size=rows.shape)).astype(np.float32)


def real_errors(rows, packed):
    away = np.linalg.norm(rows - packed.rows(), axis=1)
    length = np.sqrt((rows.astype(np.float64) ** 2).sum(axis=1).mean())
    return np.sqrt((away**2).mean()) / length, away.max() / length


@given(st.integers(1, 300), st.integers(2, 60), st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_stated_error_is_the_real_one(count, width, seed):
    rows = clustered(count, width, noise=0.3, seed=seed)
    packed = finish(compress(rows, 0.1, most_axes=8, clusters=8))
    rms, worst = real_errors(rows, packed)
    assert packed.rms == pytest.approx(rms, rel=1e-3, abs=1e-6)
    assert packed.worst == pytest.approx(worst, rel=1e-3, abs=1e-6)
    assert packed.weights.shape[1] == 8 or packed.rms < 0.1 + 2e-3


def test_rows_in_few_dimensions_take_few_axes():
    rows = clustered(2000, 100)
    packed = finish(compress(rows, 0.01, clusters=16))
    assert packed.weights.shape[1] <= 6
    assert packed.rms < 0.011


def test_smaller_error_costs_axes_and_none_costs_most():
    rows = clustered(1000, 60, noise=0.2)
    packs = [finish(compress(rows, error, most_axes=20, clusters=8)) for error in (0.3, 0.1, 0.0)]
    assert [p.weights.shape[1] for p in packs] == sorted(p.weights.shape[1] for p in packs)
    assert packs[2].weights.shape[1] == 20
    assert packs[2].rms < packs[1].rms < packs[0].rms


@pytest.mark.parametrize("rows", [np.zeros((50, 9)), np.ones((1, 9)), np.ones((40, 9))], ids=["black", "one", "alike"])
def test_rows_without_any_difference_are_exact(rows):
    packed = finish(compress(rows, 0.01))
    assert np.abs(packed.rows() - rows).max() < 1e-3


def test_same_rows_give_the_same_bits():
    rows = clustered(500, 40, noise=0.1)
    one, other = (finish(compress(rows, 0.05)) for _ in range(2))
    assert one.weights.tobytes() + one.axes.tobytes() == other.weights.tobytes() + other.axes.tobytes()


def test_glossy_matrices_of_50_000_vertices_fit_in_32_mb():
    """A real bake of five bands to five, 625 numbers a vertex: 2 % of error, and the size that 50,000 would have."""
    surfaces, caster = surfaces_of(placed(grid("floor", 4.0, 16), sphere("ball", (0, 0, 0.6), 0.5, rings=14)))
    rows = np.arange(len(surfaces.positions))
    matrices = finish(glossy(surfaces, caster, Sampling(directions=256), 5, rows)).reshape(len(rows), -1)
    packed = finish(compress(matrices, 0.02, clusters=64))
    assert packed.rms < 0.021
    assert packed.worst < 0.3
    a_row = packed.weights.itemsize * packed.weights.shape[1] + packed.clusters.itemsize
    shared = 64 * (packed.weights.shape[1] + 1) * matrices.shape[1] * 2
    assert 50_000 * a_row + shared <= 32e6
    assert packed.nbytes < matrices.nbytes / 2


def test_progress_rises():
    steps = list(compress(clustered(300, 20), 0.01))
    assert all(isinstance(step, Progress) for step in steps)
    assert (np.diff([step.part for step in steps]) >= 0).all()

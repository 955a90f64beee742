"""The Haar basis of cube maps: against PyWavelets and Parseval; functions kept as few terms."""

import numpy as np
import pytest
import pywt
from hypothesis import given, settings
from hypothesis import strategies as st

from rebound.bake import haar, sphere


def texels(size, seed=0, faces=6):
    return np.random.default_rng(seed).normal(size=(faces, size, size))


def sky(size):
    """A smooth sky with a sun: radiance in each texel."""
    towards = sphere.cube_directions(size)
    sun = np.array([0.3, 0.5, 0.81])
    return 0.5 + 0.4 * towards[..., 2] + 40.0 * (towards @ sun / np.linalg.norm(sun) > 0.995)


@pytest.mark.parametrize("size", [2, 32, 64])
def test_coefficients_are_pywavelets(size):
    faces = texels(size)
    reference = [pywt.coeffs_to_array(pywt.wavedec2(face, "haar", mode="periodization"))[0] for face in faces]
    assert np.abs(haar.forward(faces) - reference).max() < 1e-12


@given(st.integers(0, 6), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_inverse_brings_texels_back_and_lengths_are_kept(level, seed):
    faces = texels(2**level, seed)
    coefficients = haar.forward(faces)
    assert np.abs(haar.inverse(coefficients) - faces).max() < 1e-12
    assert (coefficients**2).sum() == pytest.approx((faces**2).sum(), rel=1e-12)  # Parseval


@pytest.mark.parametrize("shape", [(6, 3, 3), (6, 8, 4), (6, 0, 0)])
def test_face_that_is_no_power_of_two_is_refused(shape):
    with pytest.raises(ValueError, match="power of two"):
        haar.forward(np.zeros(shape))


def test_strongest_terms_are_weighed_by_what_they_meet():
    light = np.array([[5.0, -9, 1, 0, 7], [0, 0, 1, 0, 1]])
    assert haar.strongest(light, 3).tolist() == [1, 4, 0]
    assert haar.strongest(light, 2, weights=np.array([1.0, 0, 100, 1, 1])).tolist() == [2, 4]
    assert sorted(haar.strongest(light, 99)) == [0, 1, 2, 3, 4]


def test_few_terms_hold_a_sky_with_a_sun():
    """Of 6,144 terms 2 % hold a small sun and the gradient around it to 5 %: what a wavelet is for."""
    light = haar.forward(sky(32)).reshape(-1)
    kept = np.zeros_like(light)
    best = haar.strongest(light, 123)
    kept[best] = light[best]
    assert np.linalg.norm(kept - light) < 0.05 * np.linalg.norm(light)


@given(st.integers(0, 2**32 - 1), st.floats(0.5, 1.0))
@settings(max_examples=25, deadline=None)
def test_sparse_rows_err_by_no_more_than_they_say(seed, keep):
    rows = np.random.default_rng(seed).normal(size=(7, 96)) ** 3
    sparse = haar.sparse_rows(rows, keep)
    left_out = np.linalg.norm(rows - sparse.dense(), axis=1)
    step = np.abs(rows).max(axis=1) / haar.STEPS
    bound = np.sqrt((1 - keep) * (rows**2).sum(axis=1)) + 0.5001 * step * np.sqrt(96)
    assert (left_out <= bound).all()


def test_sparse_rows_multiply_as_their_dense_form():
    rows = np.random.default_rng(2).normal(size=(9, 384)) ** 3
    rows[4] = 0.0  # a vertex that sees nothing
    sparse = haar.join_rows([haar.sparse_rows(rows[:4], 0.99), haar.sparse_rows(rows[4:], 0.99)])
    light = np.random.default_rng(3).normal(size=(384, 3))
    assert np.allclose(sparse.dot(light), sparse.dense() @ light, rtol=1e-5, atol=1e-5)
    assert np.allclose(sparse.energy(), np.linalg.norm(sparse.dense(), axis=0), rtol=1e-6)
    assert sparse.nbytes < rows.astype(np.float32).nbytes / 2
    assert np.diff(sparse.starts)[4] == 0

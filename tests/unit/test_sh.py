"""Spherical harmonics: against an independent library, published constants, and what rotations and products must do."""

import numpy as np
import pytest
import sphericart
from hypothesis import given, settings
from hypothesis import strategies as st

from rebound.bake import lobes, sh, sphere

DIRECTIONS = np.random.default_rng(4).normal(size=(500, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
AXES = np.concatenate([np.eye(3), -np.eye(3)])
few_bands = st.integers(1, 6)
all_bands = st.integers(1, sh.MAX_BANDS)
seeds = st.integers(0, 2**32 - 1)


def turn_from(seed):
    """A random rotation."""
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.linalg.det(q)


def random_function(seed, bands):
    return np.random.default_rng(seed).normal(size=bands * bands)


@pytest.mark.parametrize("directions", [DIRECTIONS, AXES], ids=["anywhere", "along_axes"])
def test_every_function_up_to_order_10_is_sphericarts(directions):
    reference = sphericart.SphericalHarmonics(l_max=10).compute(directions)
    assert np.abs(sh.evaluate(directions, 11) - reference).max() < 1e-12


def test_first_nine_are_the_published_polynomials():
    """Ramamoorthi and Hanrahan 2001, equation 3."""
    x, y, z = DIRECTIONS.T
    published = [0.282095 + 0 * x, 0.488603 * y, 0.488603 * z, 0.488603 * x, 1.092548 * x * y, 1.092548 * y * z]
    published += [0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y)]
    assert np.allclose(sh.evaluate(DIRECTIONS, 3), np.stack(published, axis=-1), atol=1e-6)


def test_functions_are_orthonormal():
    directions, weights = sphere.quadrature(20)
    basis = sh.evaluate(directions, 11)
    assert np.abs((basis * weights[:, None]).T @ basis - np.eye(121)).max() < 1e-13


@pytest.mark.parametrize("bands", [0, 12])
def test_impossible_band_count_is_refused(bands):
    with pytest.raises(ValueError, match="between 1 and 11"):
        sh.evaluate(DIRECTIONS, bands)


def test_coefficients_that_are_no_square_are_refused():
    with pytest.raises(ValueError, match="7 coefficients"):
        sh.band_count(np.zeros(7))


@given(seeds, all_bands)
@settings(max_examples=20, deadline=None)
def test_projection_brings_coefficients_back(seed, bands):
    coefficients = random_function(seed, bands)
    directions, weights = sphere.quadrature(2 * bands)
    found = sh.project(sh.evaluate(directions, bands) @ coefficients, directions, weights, bands)
    assert np.abs(found - coefficients).max() < 1e-12


def test_cube_map_projects_to_its_function():
    """Texels are taken as constant over their area, so the error falls with its square: 64 texels a face, 0.1 %."""
    coefficients = random_function(3, 5)
    directions, weights = sphere.cube_directions(64).reshape(-1, 3), sphere.cube_solid_angles(64).reshape(-1)
    image = sh.evaluate(directions, 5) @ coefficients
    found = sh.project(np.stack([image, 2 * image], axis=-1), directions, weights, 5)
    assert np.abs(found - [coefficients, 2 * coefficients]).max() < 1e-3 * np.linalg.norm(coefficients)


def test_solid_angles_add_up_to_the_sphere():
    assert sphere.cube_solid_angles(7).sum() == pytest.approx(4 * np.pi, rel=1e-13)
    assert sphere.quadrature(9)[1].sum() == pytest.approx(4 * np.pi, rel=1e-13)


def test_middle_of_each_cube_face_looks_along_its_axis():
    middles = sphere.cube_directions(3)[:, 1, 1]
    assert np.allclose(middles, [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], atol=1e-15)


def test_spread_directions_integrate_low_bands():
    basis = sh.evaluate(sphere.spread(1024), 4).mean(axis=0) * np.sqrt(4 * np.pi)
    assert np.abs(basis - np.eye(16)[0]).max() < 2e-3


@given(seeds, seeds, all_bands)
@settings(max_examples=20, deadline=None)
def test_rotated_function_is_the_function_of_turned_directions(seed, turn_seed, bands):
    coefficients, turn = random_function(seed, bands), turn_from(turn_seed)
    turned = sh.rotate(coefficients, turn)
    expected = sh.evaluate(DIRECTIONS @ turn, bands) @ coefficients  # rows: turn⁻¹ s
    assert np.abs(sh.evaluate(DIRECTIONS, bands) @ turned - expected).max() < 1e-10
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(coefficients), rel=1e-12)


@given(seeds, seeds)
@settings(max_examples=10, deadline=None)
def test_rotations_compose(one, other):
    a, b = turn_from(one), turn_from(other)
    for first, second, both in zip(*(sh.rotation_blocks(r, 11) for r in (a, b, a @ b)), strict=True):
        assert np.abs(first @ second - both).max() < 1e-12


@given(seeds, few_bands, few_bands)
@settings(max_examples=20, deadline=None)
def test_product_is_the_product_of_values(seed, bands, other):
    a, b = random_function(seed, bands), random_function(seed + 1, other)
    result = bands + other - 1  # as many bands as a product has, so nothing is cut off
    c = sh.product(a, b, result)
    values = [sh.evaluate(DIRECTIONS, sh.band_count(x)) @ x for x in (a, b, c)]
    assert np.abs(values[0] * values[1] - values[2]).max() < 1e-9
    assert np.abs(np.einsum("i,j,ijk->k", a, b, sh.triple_product(bands, other, result)) - c).max() < 1e-10


def test_triple_product_is_symmetric():
    tensor = sh.triple_product(4, 4, 4)
    assert np.abs(tensor - tensor.transpose(1, 0, 2)).max() < 1e-13
    assert np.abs(tensor - tensor.transpose(2, 1, 0)).max() < 1e-13
    assert np.abs(tensor[0] - np.eye(16) * np.sqrt(0.25 / np.pi)).max() < 1e-13


def numeric_lobe(function, bands):
    """Zonal coefficients by brute force, of a function that is 0 below the horizon."""
    z, weights = np.polynomial.legendre.leggauss(100)
    z, weights = (z + 1) / 2, weights / 2
    axis = np.stack([np.sqrt(1 - z * z), 0 * z, z], axis=-1)
    orders = np.arange(bands)
    return 2 * np.pi * (weights * function(z)) @ sh.evaluate(axis, bands)[:, orders * (orders + 1)]


def test_cosine_lobe_has_the_published_constants():
    """Ramamoorthi and Hanrahan 2001: A_l, and the five constants of their equation 12."""
    a = lobes.cosine(9) * lobes.band_scales(9)
    published = [3.141593, 2.094395, 0.785398, 0, -0.130900, 0, 0.049087, 0, -0.024544]
    assert np.allclose(a, published, atol=1e-6)
    y = [0.282095, 0.488603, 1.092548, 0.315392, 0.546274]
    assert np.allclose([a[0] * y[0], a[1] * y[1] / 2, a[2] * y[2] / 2], [0.886227, 0.511664, 0.429043], atol=1e-6)
    assert np.allclose([a[2] * y[3] * 3, a[2] * y[3]], [0.743125, 0.247708], atol=1e-6)


@pytest.mark.parametrize("exponent", [1.0, 2.5, 20.0, 200.0])
def test_phong_lobe_is_the_integral_of_a_power(exponent):
    numeric = numeric_lobe(lambda z: z**exponent, 11)
    found = lobes.phong(11, exponent)
    assert np.abs(found - numeric / numeric[0] * found[0]).max() < 1e-6
    assert found[0] == pytest.approx(np.sqrt(0.25 / np.pi))


@given(seeds, few_bands)
@settings(max_examples=20, deadline=None)
def test_convolution_is_the_integral_over_a_turned_lobe(seed, bands):
    coefficients, lobe = random_function(seed, bands), lobes.phong(bands, 3.0)
    convolved = coefficients * (lobes.band_scales(bands) * lobe)[sh.band_of(bands)]  # Funk and Hecke
    seen = sh.evaluate(DIRECTIONS, bands) @ convolved
    assert np.abs(seen - lobes.turn(lobe, DIRECTIONS) @ coefficients).max() < 1e-10


def test_window_keeps_the_mean_and_the_less_the_finer():
    factors = lobes.laplacian(11, 0.01)
    assert factors[0] == 1.0
    assert (np.diff(factors[:8]) < 0).all()
    assert (factors >= 0).all()


@given(seeds, st.integers(2, 11), st.floats(0.01, 0.99))
@settings(max_examples=20, deadline=None)
def test_laplacian_strength_leaves_what_it_says(seed, bands, keep):
    def curved(c):
        order = sh.band_of(bands)
        return ((c * order * (order + 1)) ** 2).sum()

    coefficients = random_function(seed, bands)
    strength = lobes.laplacian_strength(coefficients, keep)
    kept = curved(lobes.window(coefficients, lobes.laplacian(bands, strength)))
    assert kept == pytest.approx(keep * curved(coefficients), rel=1e-6)


def test_window_takes_the_negative_ring_of_a_small_sun_away():
    """A sun in 5 bands goes down to -15 % of its peak; with a tenth of the curvature it is 4 %."""
    sun = lobes.turn(lobes.phong(5, 1000.0), np.array([0.0, 0.0, 1.0]))
    basis = sh.evaluate(sphere.spread(2000), 5)
    plain, soft = basis @ sun, basis @ lobes.window(sun, lobes.laplacian(5, lobes.laplacian_strength(sun, 0.1)))
    assert plain.min() < -0.1 * plain.max()
    assert soft.min() > -0.05 * soft.max()


@pytest.mark.parametrize("bands", range(1, 10))
def test_narrowest_lobe_is_one_that_is_nowhere_negative_and_no_other_is_narrower(bands):
    """Of squares of polynomials, for even bands times 1 + cosine: the largest eigenvalue of the cosine."""
    nodes, weights = np.polynomial.legendre.leggauss(32)
    weights = weights * (1.0 if bands % 2 else 1.0 + nodes)
    powers = np.polynomial.legendre.legvander(nodes, (bands - 1) // 2)
    squares, means = (powers.T @ (w[:, None] * powers) for w in (weights, weights * nodes))
    largest = np.linalg.eigvals(np.linalg.solve(squares, means)).real.max()
    assert lobes.narrowest(bands) == pytest.approx(largest, abs=1e-9)


def test_constant_function_needs_no_window():
    assert lobes.laplacian_strength(np.eye(25)[0], 0.5) == 0.0

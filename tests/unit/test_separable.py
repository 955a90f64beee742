"""Lobes as sums of products against the lobes themselves."""

from functools import cache

import numpy as np
import pytest

from rebound.bake import separable
from rebound.bake.sphere import quadrature
from rebound.tests.support.brdf_reference import ggx_values, mirrored, phong_values

LIGHTS, AREAS = quadrature(120)
ABOVE = LIGHTS[:, 2] > 0
VALUES_OF = {"GGX": ggx_values, "PHONG": phong_values}


@cache
def factored(lobe, roughness, terms):
    """And its factors of LIGHTS."""
    found = separable.factor(separable.LOBES[lobe], roughness, terms)
    return found, found.of_light(LIGHTS)


def lobe_of(factors, cosine, turn=0.0):
    """Over LIGHTS, of a view leaning to -X that is turned around the normal."""
    found, of_light = factors
    view = mirrored(cosine) * [-1, 1, 1]
    c, s = np.cos(turn), np.sin(turn)
    view = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ view
    return of_light @ found.of_view(view[None])[0]


@pytest.mark.parametrize("lobe", list(separable.LOBES))
@pytest.mark.parametrize("cosine", [1.0, 0.8, 0.5])
def test_many_terms_are_the_lobe(lobe, cosine):
    found = factored(lobe, 0.6, 160)
    right = np.where(ABOVE, VALUES_OF[lobe](LIGHTS, 0.6, cosine), 0.0)
    right /= right @ AREAS
    error = np.sqrt((lobe_of(found, cosine) - right) ** 2 @ AREAS / (right**2 @ AREAS))
    assert error < 0.06  # the steps of the angles


@pytest.mark.parametrize("lobe", list(separable.LOBES))
@pytest.mark.parametrize("terms", [8, 24])
def test_a_white_sky_stays_white_and_error_is_what_is_said(lobe, terms):
    """Over all views as a picture has them: what is left out is the ``error``."""
    found = factored(lobe, 0.6, terms)
    cosines = np.sqrt((np.arange(20) + 0.5) / 20)  # even in solid angle times cosine
    left = whole = 0.0
    for cosine in cosines:
        seen = lobe_of(found, cosine)
        assert seen @ AREAS == pytest.approx(1.0, abs=0.05)  # at grazing views few of the directions meet Phong's
        right = np.where(ABOVE, VALUES_OF[lobe](LIGHTS, 0.6, cosine), 0.0)
        right /= right @ AREAS
        left, whole = left + (seen - right) ** 2 @ AREAS, whole + right**2 @ AREAS
    assert np.sqrt(left / whole) == pytest.approx(found[0].error, abs=0.05)


def test_more_terms_err_less_and_rougher_surfaces_need_fewer():
    errors = {r: [factored("GGX", r, n)[0].error for n in (4, 16, 64)] for r in (0.4, 0.6, 0.8)}
    for few, some, many in errors.values():
        assert few > some > many
    assert errors[0.4][1] > errors[0.6][1] > errors[0.8][1]
    assert errors[0.8][1] < 0.03


def test_the_tangent_makes_no_difference():
    """Light and view turned together: what is seen is the same."""
    found, of_light = factored("GGX", 0.5, 23)
    turned = lobe_of((found, of_light), 0.7, 0.9)
    c, s = np.cos(0.9), np.sin(0.9)
    back = LIGHTS @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    view = mirrored(0.7) * [-1, 1, 1]
    np.testing.assert_allclose(turned, found.of_light(back) @ found.of_view(view[None])[0], atol=1e-9)


def test_pairs_stay_together():
    for terms in (1, 2, 3, 8, 15):
        found = separable.factor(separable.phong, 0.6, terms)
        assert terms - 1 <= len(found.orders) <= terms
        assert (found.orders[~found.odd] > 0).sum() == found.odd.sum()


def test_tangents_are_at_right_angles():
    normals = np.random.default_rng(1).normal(size=(1000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = separable.tangents(normals)
    np.testing.assert_allclose((found * normals).sum(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)

"""How glossy surfaces are seen: the table's weights against BRDFs summed over all directions."""

import numpy as np
import pytest

from rebound.bake import sh, view_table
from rebound.bake.lobes import narrowest
from rebound.bake.sphere import quadrature
from rebound.tests.support.brdf_reference import ggx_values, mirrored, phong_values

TOWARDS, AREAS = quadrature(300)
LIGHT = np.random.default_rng(2).normal(size=36)


def seen(reflections, roughness, cosine, bands=6):
    weights = view_table.weights(reflections, bands, [roughness], cosine)[0]
    parts = sh.evaluate(view_table.plane_directions(bands), bands) * LIGHT[: bands * bands]
    return sum(weights[:, band] @ parts[:, band**2 : (band + 1) ** 2].sum(axis=1) for band in range(bands))


def summed(values, bands=6):
    shares = values * AREAS
    return shares @ (sh.evaluate(TOWARDS, bands) @ LIGHT[: bands * bands]) / shares.sum()


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.3, 0.05])
@pytest.mark.parametrize("roughness", [0.4, 0.6, 1.0])
@pytest.mark.parametrize("bands", [3, 6])
def test_ggx_is_the_brdf_times_the_cosine(roughness, cosine, bands):
    right = summed(ggx_values(TOWARDS, roughness, cosine), bands)
    assert seen(view_table.ggx, roughness, cosine, bands) == pytest.approx(right, abs=0.01)


@pytest.mark.parametrize("cosine", [1.0, 0.6, 0.1])
@pytest.mark.parametrize("roughness", [0.3, 0.5, 0.9])
def test_phong_is_the_power_of_the_cosine(roughness, cosine):
    right = summed(phong_values(TOWARDS, roughness, cosine))
    assert seen(view_table.phong, roughness, cosine) == pytest.approx(right, abs=2e-3)


@pytest.mark.parametrize("lobe", list(view_table.LOBES))
def test_smooth_lobes_are_the_mirror(lobe):
    for cosine in (1.0, 0.6, 0.3):
        right = sh.evaluate(mirrored(cosine), 6) @ LIGHT
        assert seen(view_table.LOBES[lobe], 0.05, cosine) == pytest.approx(right, abs=0.05)


@pytest.mark.parametrize("lobe", list(view_table.LOBES))
def test_least_roughness_is_as_wide_as_the_narrowest_lobe_of_its_bands(lobe):
    reflections = view_table.LOBES[lobe]
    found = [view_table.least_roughness(reflections, bands) for bands in range(2, 8)]
    assert found == sorted(found, reverse=True)
    assert found[0] == 1.0 and found[-1] < 0.6
    for bands in (5, 6):
        towards, shares = reflections(found[bands - 2], 1.0)
        assert shares @ towards[:, 2] == pytest.approx(narrowest(bands), abs=1e-3)


def test_lobe_of_the_least_roughness_rings_less_than_a_smoother_one():
    """How far five bands of it go below 0, seen along the normal, in parts of its peak."""

    def depth(roughness):
        towards, shares = view_table.ggx(roughness, 1.0)
        halves = np.concatenate([towards, towards * [1, -1, 1]])
        values = sh.evaluate(TOWARDS, 5) @ (np.tile(shares, 2) @ sh.evaluate(halves, 5))
        return -values.min() / values.max()

    assert depth(view_table.least_roughness(view_table.ggx, 5)) < 0.03
    assert depth(0.3) > 0.1


def test_any_isotropic_brdf_can_be_asked_for_its_values():
    """One that is neither: it sends light back to where it comes from, and to the mirrored side."""

    def both_ways(light, view, roughness):
        return np.maximum(light @ view, 0) ** 12 + np.maximum(light @ (view * [-1, -1, 1]), 0) ** 6 + roughness

    for cosine in (0.9, 0.5, 0.2):
        view = mirrored(cosine) * [-1, 1, 1]
        right = summed(np.where(TOWARDS[:, 2] > 0, both_ways(TOWARDS, view, 0.3) * TOWARDS[:, 2], 0.0))
        assert seen(view_table.measured(both_ways), 0.3, cosine) == pytest.approx(right, abs=2e-3)

"""The GGX lobe's GLSL against the same formulas in float64, and against what a reflector must do with energy."""

import numpy as np
import pytest

from rebound.tests.support.bxdf_reference import (
    albedo,
    compensation,
    dielectric,
    half_sphere,
    sample_ggx,
    single_scattering,
    specular,
)
from rebound.tests.support.glsl_functions import evaluate

LIBRARY = ["lib/bxdf_lib.glsl"]
ROUGHNESS = np.linspace(0.05, 1.0, 20)
COSINES = np.array([0.03, 0.06, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0])
GRID = np.stack(np.meshgrid(COSINES, ROUGHNESS, indexing="ij"), -1).reshape(-1, 2)


def directions(rng, count, lowest=0.02):
    """(count, 3) unit vectors of the upper half sphere."""
    z, angle = rng.uniform(lowest, 1, count), rng.uniform(0, 2 * np.pi, count)
    sine = np.sqrt(1 - z * z)
    return np.stack((sine * np.cos(angle), sine * np.sin(angle), z), -1)


def turned(rng, count):
    """(count, 3, 3) random rotations: the functions must not know where up is."""
    q, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    return q * np.sign(np.linalg.det(q))[:, None, None]


@pytest.fixture(scope="module")
def case():
    rng = np.random.default_rng(1)
    count, rotations = 400, turned(np.random.default_rng(2), 400)
    v, l = directions(rng, count), directions(rng, count)  # noqa: E741
    roughness = rng.uniform(0.1, 1, (count, 1))
    world = {name: np.einsum("nij,nj->ni", rotations, a) for name, a in (("V", v), ("L", l))}
    normals = rotations[:, :, 2]
    f0, xi = rng.uniform(0.02, 1, (count, 3)), rng.random((count, 2))
    sent = {"n": normals, "v": world["V"], "l": world["L"], "f": np.concatenate((f0, roughness), 1), "xi": xi}
    return sent, v, l, f0, roughness[:, 0]


def test_brdf_is_the_formula(headless_device, case):
    sent, v, l, f0, roughness = case  # noqa: E741
    found = evaluate(headless_device, LIBRARY, "vec4(bxdf_specular(n.xyz, v.xyz, l.xyz, f.rgb, f.a), 0.0)", sent)
    exact = specular(v, l, f0, roughness) * compensation(v[:, 2], f0, roughness)
    # What differs is the fit of the lobe's albedo.
    np.testing.assert_allclose(found[:, :3], exact, rtol=0.012, atol=1e-6)


def test_sampled_directions_are_of_their_density(headless_device, case):
    sent, v, _, f0, roughness = case
    call = "bxdf_sample_ggx(n.xyz, v.xyz, f.a, xi.xy)"
    sampled = evaluate(headless_device, LIBRARY, f"vec4({call}, 0.0)", sent)[:, :3]
    np.testing.assert_allclose(np.linalg.norm(sampled, axis=1), 1.0, atol=1e-5)
    cosine = (sampled * sent["n"]).sum(1)
    # Only the turn about the normal is free: in their own frame they are the reference's.
    expected = sample_ggx(v, roughness, sent["xi"])
    assert np.abs(np.sort(cosine) - np.sort(expected[:, 2])).mean() < 0.02
    sent = {**sent, "l": sampled}
    weight = evaluate(
        headless_device, LIBRARY, "vec4(bxdf_specular_weight(n.xyz, v.xyz, l.xyz, f.rgb, f.a), 0.0)", sent
    )
    text = "vec4(bxdf_specular(n.xyz, v.xyz, l.xyz, f.rgb, f.a), bxdf_sample_density(n.xyz, v.xyz, l.xyz, f.a))"
    value = evaluate(headless_device, LIBRARY, text, sent)
    above = cosine > 1e-3
    expected = value[above, :3] * cosine[above, None] / value[above, 3:]
    np.testing.assert_allclose(weight[above, :3], expected, rtol=2e-3)
    assert not weight[cosine <= 0].any() and above.mean() > 0.8


def test_albedo_of_one_bounce_is_the_integral(headless_device):
    text = "vec4(bxdf_single_albedo(a.x, a.y), bxdf_grazing_albedo(a.x, a.y), bxdf_mean_albedo(a.y), 0.0)"
    found = evaluate(headless_device, LIBRARY, text, {"a": GRID})
    single, grazing = np.array([single_scattering(*row) for row in GRID]).T
    np.testing.assert_allclose(found[:, 0], single, rtol=0.005)
    np.testing.assert_allclose(found[:, 1], grazing, atol=0.007)
    cosines, weights = half_sphere(32)
    mean = [sum(w * sum(single_scattering(c, r)[:1]) for c, w in zip(cosines, weights, strict=True)) for r in ROUGHNESS]
    np.testing.assert_allclose(found[: len(ROUGHNESS), 2], mean, atol=0.004)


def test_white_furnace_loses_and_makes_no_light(headless_device):
    """All that falls on a lobe of F0 = 1 leaves it: the compensated BRDF, integrated by its own density."""
    xi = np.stack(np.meshgrid(*((np.arange(48) + 0.5) / 48,) * 2), -1).reshape(-1, 2)
    for cosine in COSINES:
        v = np.array([[np.sqrt(1 - cosine * cosine), 0, cosine]])
        for roughness in (0.05, 0.3, 0.6, 1.0):
            count = len(xi)
            sent = {"v": np.repeat(v, count, 0), "xi": xi, "r": np.full((count, 1), roughness)}
            call = "bxdf_sample_ggx(vec3(0.0, 0.0, 1.0), v.xyz, r.x, xi.xy)"
            up = "vec3(0.0, 0.0, 1.0), v.xyz"
            text = f"vec4(bxdf_specular_weight({up}, {call}, vec3(1.0), r.x), 0.0)"
            level = evaluate(headless_device, LIBRARY, text, sent)[:, 0].mean()
            assert level == pytest.approx(1.0, abs=0.01), (cosine, roughness)


def test_albedo_of_the_whole_lobe_is_below_one_and_the_integral(headless_device):
    f0 = np.array([0.04, 0.5, 1.0])
    found = evaluate(headless_device, LIBRARY, "vec4(bxdf_albedo(vec3(0.04, 0.5, 1.0), a.y, a.x), 0.0)", {"a": GRID})
    expected = np.array([albedo(cosine, f0, roughness) for cosine, roughness in GRID])
    assert (found <= 1.0).all()
    np.testing.assert_allclose(found[:, :3], expected, atol=0.01)


@pytest.mark.parametrize("ior", [1.4, 1.5, 2.0])
def test_schlick_is_as_near_to_a_dielectric_as_the_library_says(ior):
    cosines, weights = half_sphere(256)
    f0 = ((ior - 1) / (ior + 1)) ** 2
    error = f0 + (1 - f0) * (1 - cosines) ** 5 - dielectric(cosines, ior)
    assert abs(error).max() <= 0.05 and abs((error * weights).sum()) <= 0.01

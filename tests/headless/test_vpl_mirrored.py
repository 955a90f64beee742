"""What glossy surfaces mirror of things that glow, against the lobe summed over the thing."""

import numpy as np
import pytest

from rebound.scene.data import Material
from rebound.tests.support.brdf_reference import ggx_values
from rebound.tests.support.render_scenes import Studio, perspective, quad, scene, sphere

ROUGHNESS = 0.3
EYE = np.array([0.0, -4.0, 1.6])
VIEW = perspective(80, 45, 33, EYE, (0.0, 2.0, 0.4))
MATERIALS = [
    Material("Floor", (1.0, 1.0, 1.0), metallic=1.0, roughness=ROUGHNESS),
    Material("Glowing", (0.0, 0.0, 0.0), emission=(5.0, 4.0, 3.0)),
    Material("Black", (0.0, 0.0, 0.0)),
]
FLOOR = quad("floor", u=(3, 0, 0), v=(0, 3, 0))
WALL = quad("wall", (0, 3, 3), (3, 0, 0), (0, 0, 3))
# Half the sides of screens, metres. Cells at the rim of a small one have more of its light than it sends by them.
SCREENS = [((0.4, 0.24), 0.2), ((0.05, 0.6), 0.4), ((0.8, 0.8), 0.2)]


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def mirrored(studio, meshes):
    """(n,) radiance that the floor mirrors, and (n, 3) where."""
    shown = scene(meshes, materials=MATERIALS[: len(meshes)])
    found = studio.render(shown, VIEW, 32, ("glossy_direct", "position"), method="VPL")
    points = found["position"]
    floor = (np.abs(points[..., 2]) < 1e-4) & points.any(axis=-1)
    return found["glossy_direct"][floor][:, 0], points[floor]


def summed(points, sources, facing):
    """(n,) of radiance 5 from parts of a light at ``sources`` (m, 3); ``facing`` (m, 3): their normals times areas."""
    total = []
    for point in points:
        view = (EYE - point) / np.linalg.norm(EYE - point)
        side = -np.array([view[0], view[1], 0.0]) / np.hypot(view[0], view[1])
        frame = np.stack([side, np.cross([0.0, 0.0, 1.0], side), [0.0, 0.0, 1.0]])
        away = sources - point
        distance = np.linalg.norm(away, axis=1)
        angle = np.maximum(-(away * facing).sum(axis=1), 0.0) / distance**3
        total.append(5.0 * (ggx_values(away / distance[:, None] @ frame.T, ROUGHNESS, view[2]) * angle).sum())
    return np.array(total)


@pytest.mark.parametrize(("sides", "off"), SCREENS)
@pytest.mark.parametrize("before_a_wall", [False, True])
def test_a_screen_is_mirrored_with_all_of_its_light_and_no_more(studio, sides, off, before_a_wall):
    """On a wall too, which rays that miss the screen hit as near to its points."""
    center = np.array([0.0, 2.98, 1.0])
    screen = quad("screen", center, (sides[0], 0, 0), (0, 0, sides[1]))
    found, points = mirrored(studio, [FLOOR, screen, *[WALL] * before_a_wall])
    x, z = np.meshgrid(*((np.arange(24) + 0.5) / 12.0 - 1.0 for _ in sides))
    sources = center + np.stack([x * sides[0], 0.0 * x, z * sides[1]], axis=-1).reshape(-1, 3)
    facing = np.array([0.0, -1.0, 0.0]) * 4.0 * sides[0] * sides[1] / len(sources)
    assert found.mean() == pytest.approx(summed(points, sources, facing).mean(), rel=off)


@pytest.mark.parametrize("before_a_wall", [False, True])
def test_a_bulb_is_mirrored_with_all_of_its_light_and_no_more(studio, before_a_wall):
    radius, center = 0.08, np.array([0.0, 2.8, 1.0])
    found, points = mirrored(studio, [FLOOR, sphere("bulb", center, radius, 12), *[WALL] * before_a_wall])
    normals = np.random.default_rng(0).normal(size=(2000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    wanted = summed(points, center + radius * normals, 4.0 * np.pi * radius**2 / len(normals) * normals)
    # Where the index has no point that faces the ray, none answers: a third of what a small ball sends is not found.
    assert 0.65 < found.mean() / wanted.mean() < 1.1

"""The pool of virtual point lights: drawn in proportion to strength, stratified, an unbiased estimate of all flux."""

import math
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from rebound.gpu_shaders.frame.maps import Atlas
from rebound.gpu_shaders.frame.reflective_shaders import SourceKind
from rebound.gpu_shaders.vpl.pool import Pool
from rebound.gpu_shaders.vpl.sources import TILE_STEP, Sources
from rebound.gpu_shaders.vpl.structs import TILE
from rebound.scene.data import World
from rebound.tests.support.render_scenes import Studio, light, quad, scene

FORMATS = ("RGBA32F", "RGBA16F", "RGBA32F", "RGBA32F")
TEXELS = ("position_area", "normal_kind", "flux", "specular")
# Tiles, how many of them lights', texels along a side, tiles that one light has.
LAYOUTS = {
    "one": (1, 1, 16, 1),
    "three": (3, 2, 48, 1),
    "one_large": (2, 1, 256, 1),
    "cubes": (64, 60, 48, 6),
    "many": (300, 300, 16, 1),
}


class FakeAtlas:
    """What the pool reads of ``Sources``, with random lights: some tiles dark, most texels empty, few very bright."""

    def __init__(self, device, layout: str, brightness=1.0) -> None:
        self.device = device
        count, self.light_tiles, side, owned = LAYOUTS[layout]
        self.atlas = Atlas.fitting(count, side, 1 << 24, 16384)
        assert self.atlas.tile == side
        self.tiles, self.revision = (None,) * count, 1
        rng = np.random.default_rng(count)
        self.slots = rng.permutation(count)  # tiles lie anywhere in the atlas
        self.arrays = self._arrays(rng, brightness)
        flux, specular = (self.arrays[name].astype(np.float64) for name in ("flux", "specular"))
        used = np.zeros(flux.shape[:2])  # what is in the atlas outside of tiles is nobody's
        for index in range(count):
            used[self.part(index)] = 1.0
        self.counted = used * flux[..., 3]
        self.strengths = self.counted * (flux[..., :3].mean(-1) + specular[..., :3].mean(-1))
        rows = [self._row(index, owned) for index in range(count)]
        self.firsts, self.owned = (np.array([row[name] for row in rows]) for name in ("first", "owned"))
        named = zip(FORMATS, TEXELS, strict=True)
        self.colors = tuple(device.texture(self.atlas.size, name, self.arrays[texels]) for name, texels in named)
        packed = TILE.pack(rows)
        self.tile_table = device.texture((packed.shape[1], packed.shape[0]), "RGBA32F", packed)

    def _arrays(self, rng, brightness) -> dict[str, np.ndarray]:
        """(h, w, 4) float32 each, by the names TEXELS."""
        width, height = self.atlas.size
        arrays = {name: rng.normal(size=(height, width, 4)).astype(np.float32) for name in TEXELS}
        normals, flux, specular = (arrays[name] for name in TEXELS[1:])
        normals[..., :3] /= np.linalg.norm(normals[..., :3], axis=-1, keepdims=True)
        normals[..., 3] = SourceKind.SKY
        arrays["position_area"][..., 3] = rng.uniform(0.1, 2.0, (height, width))
        strength = np.exp(2.0 * rng.normal(size=(height, width, 1))) * (rng.random((height, width, 1)) < 0.6)
        flux[..., :3] = strength * rng.random((height, width, 3)) * brightness
        flux[..., 3] = 1.0
        specular[:] = 0.3 * flux * (rng.random((height, width, 1)) < 0.5)
        for index in range(len(self.tiles)):
            part = self.part(index)
            if index < self.light_tiles:
                normals[part][..., 3] = SourceKind.BOUNCE
            elif index == len(self.tiles) - 1:
                flux[part][..., 3] = 0.0  # counts nothing, as the cache's
            if index % 7 == 5:
                flux[part][..., :3] = specular[part] = 0.0
        return arrays

    def _row(self, index: int, owned: int) -> dict:
        """Of the table of tiles; every light has ``owned`` ones."""
        origin = self.atlas.origin(int(self.slots[index]))
        if index >= self.light_tiles:
            return {"origin": origin, "light": -1, "first": index, "owned": 1}
        first = index // owned * owned
        return {
            "origin": origin,
            "light": index // owned,
            "first": first,
            "owned": min(owned, self.light_tiles - first),
        }

    def part(self, index: int):
        x, y = self.atlas.origin(int(self.slots[index]))
        return np.s_[y : y + self.atlas.tile, x : x + self.atlas.tile]

    def tile_sums(self) -> np.ndarray:
        return np.array([self.strengths[self.part(index)].sum() for index in range(len(self.tiles))])

    def tile_weights(self) -> np.ndarray:
        """What tiles are chosen by: their strength, and as much again evenly among those that send anything."""
        sums = self.tile_sums()
        return np.where(sums > 0, sums + sums.sum() / max((sums > 0).sum(), 1), 0.0)

    def chances(self) -> np.ndarray:
        """The probability of every texel."""
        chance = np.zeros(self.strengths.shape)
        sums, weights = self.tile_sums(), self.tile_weights()
        for index in np.flatnonzero(sums):
            part = self.part(index)
            chance[part] = self.strengths[part] / sums[index] * weights[index] / weights.sum()
        return chance

    def free(self) -> None:
        for texture in (*self.colors, self.tile_table):
            self.device.free(texture)


class Drawn:
    """The entries of one or more draws: where in the atlas, and what the pool says of them."""

    def __init__(self, pool: Pool, sources, count: int, numbers=(1,)) -> None:
        found = []
        for number in numbers:
            pool.draw(sources, count, number, 0)
            textures = list(pool.bindings().values())[:3]
            found.append([pool.device.read(t).reshape(-1, 4)[:count] for t in textures])
        self.position, self.facing, self.flux = (np.concatenate(parts) for parts in zip(*found, strict=True))
        ids = self.facing[:, 3].copy().view(np.int32)
        self.x, self.y, self.kind = ids & 8191, ids >> 13 & 8191, ids >> 26
        self.probability = self.flux[:, 3].astype(np.float64)


@pytest.fixture
def pool(headless_device):
    pool = Pool(headless_device)
    yield pool
    pool.free()
    assert headless_device.error == "GL_NO_ERROR"


@pytest.fixture(params=LAYOUTS)
def atlas(request, headless_device):
    atlas = FakeAtlas(headless_device, request.param)
    yield atlas
    atlas.free()


def test_entries_are_texels_with_their_probability(pool, atlas):
    drawn = Drawn(pool, atlas, 3001)  # no whole row
    expected = atlas.chances()[drawn.y, drawn.x]
    assert (expected > 0).all()
    np.testing.assert_allclose(drawn.probability, expected, rtol=1e-5)
    for found, name in ((drawn.position, "position_area"), (drawn.flux[:, :3], "flux")):
        np.testing.assert_array_equal(found, atlas.arrays[name][drawn.y, drawn.x][:, : found.shape[1]])
    np.testing.assert_array_equal(drawn.kind, atlas.arrays["normal_kind"][drawn.y, drawn.x, 3])
    x, y = drawn.facing[:, 0].astype(np.float64), drawn.facing[:, 1].astype(np.float64)
    z = 1 - abs(x) - abs(y)
    fold = np.maximum(-z, 0)
    normal = np.stack((x - np.sign(x) * fold, y - np.sign(y) * fold, z), -1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    np.testing.assert_allclose(normal, atlas.arrays["normal_kind"][drawn.y, drawn.x, :3], atol=2e-3)  # half floats


def test_rays_find_lights_as_often_as_entries_say(pool, atlas):
    """A ray that hits something asks one light, in proportion to what all its tiles send; others are always found."""
    drawn = Drawn(pool, atlas, 2048)
    sums, weights = atlas.tile_sums(), atlas.tile_weights()
    lights = weights[: atlas.light_tiles].sum()
    share = np.zeros(atlas.strengths.shape)
    for index in range(len(atlas.tiles)):
        owner = np.s_[atlas.firsts[index] : atlas.firsts[index] + atlas.owned[index]]
        share[atlas.part(index)] = weights[owner].sum() / lights if index < atlas.light_tiles else 1.0
    np.testing.assert_allclose(drawn.facing[:, 2], share[drawn.y, drawn.x], rtol=1e-4)
    sums_read = pool.device.read(pool.bindings()["sums_tx"])[0].astype(np.float64)
    over = np.divide(weights, sums, out=np.zeros_like(sums), where=sums > 0)
    np.testing.assert_allclose(sums_read[:, 0], over, rtol=1e-4)
    np.testing.assert_allclose(sums_read[:, 1], np.cumsum(weights), rtol=1e-5)
    np.testing.assert_allclose(sums_read[: atlas.light_tiles, 2], np.cumsum(weights)[: atlas.light_tiles], rtol=1e-5)


def test_entries_are_chosen_in_proportion_to_strength(pool, atlas):
    count, draws = 4096, 12
    drawn = Drawn(pool, atlas, count, range(100, 100 + draws))
    found = np.zeros(atlas.strengths.shape)
    np.add.at(found, (drawn.y, drawn.x), 1)
    expected = atlas.chances() * count * draws
    # Texels of which few are expected are taken together, in the order in which they lie.
    flat, hits = expected.ravel(), found.ravel()
    assert not hits[flat == 0].any()
    groups = (np.cumsum(flat) / 20.0).astype(int)
    used = np.unique(groups, return_inverse=True)[1]
    wanted, got = np.bincount(used, flat), np.bincount(used, hits)
    chi = ((got - wanted) ** 2 / wanted)[wanted > 5].sum()
    degrees = (wanted > 5).sum()
    # Strata make the numbers more even than chance does, never less.
    assert chi < degrees + 4 * math.sqrt(2 * degrees), (chi, degrees)


def test_entries_are_stratified_over_tiles(pool, atlas):
    sums = atlas.tile_weights()
    for count in (64, 1000):
        drawn = Drawn(pool, atlas, count)
        slots = drawn.x // atlas.atlas.tile + drawn.y // atlas.atlas.tile * atlas.atlas.columns
        got = np.bincount(slots, minlength=atlas.atlas.columns**2)[atlas.slots]
        # A tile's part of the whole is a run of whole strata and a piece of one at each end.
        assert np.abs(got - count * sums / sums.sum()).max() < 2.0
        order = np.argsort(atlas.slots)[slots]
        assert (np.diff(order) >= 0).all()


def test_mean_of_flux_over_probability_is_the_whole_flux(pool, atlas):
    count, draws = 2048, 8
    drawn = Drawn(pool, atlas, count, range(draws))
    flux = atlas.arrays["flux"].astype(np.float64)
    total = (flux[..., :3] * atlas.counted[..., None]).sum((0, 1))
    each = drawn.flux[:, :3].astype(np.float64) / drawn.probability[:, None]
    error = each.std(0) / math.sqrt(count * draws)
    assert (np.abs(each.mean(0) - total) < 4 * error).all()
    assert (error < 0.03 * total).all()


@pytest.mark.parametrize("layout", ["one", "cubes"])
def test_black_atlas_gives_no_entries(pool, headless_device, layout):
    atlas = FakeAtlas(headless_device, layout, brightness=0.0)
    drawn = Drawn(pool, atlas, 500)
    assert not drawn.flux.any() and not drawn.position.any() and not drawn.facing.any()
    atlas.free()


def test_strengths_are_measured_once_a_revision(pool, headless_device):
    atlas = FakeAtlas(headless_device, "three")

    def total():
        Drawn(pool, atlas, 64)
        return headless_device.read(pool.bindings()["sums_tx"])[0, -1, 1]

    before = total()
    dark = headless_device.texture(atlas.atlas.size, FORMATS[2])
    atlas.colors = (*atlas.colors[:2], dark, dark)
    assert before > 0 and total() == before
    atlas.revision += 1
    assert total() == 0
    atlas.free()


def test_pool_of_another_size_is_as_good(pool, headless_device):
    atlas = FakeAtlas(headless_device, "three")
    for count in (1, 63, 64, 65, 5000):
        drawn = Drawn(pool, atlas, count)
        assert len(drawn.probability) == count and (drawn.probability > 0).all()
    atlas.free()


# --- the atlas that the pool is drawn from ---------------------------------------------------------------------------


@pytest.mark.parametrize(("lights", "resolution"), [(1, 65), (3, 100), (64, 272), (64, 1000), (300, 256)])
def test_blocks_of_strength_straddle_no_tiles(headless_device, lights, resolution):
    """However the memory's budget shrinks the tiles."""
    device = Mock(max_texture_size=8192, texture=lambda size, *_, **__: SimpleNamespace(size=size))
    studio = Studio(headless_device)
    studio.show(scene([quad("floor")], [light("SPOT", key=f"lamp {i}") for i in range(lights)]))
    sources = Sources(device)
    sources._draw = Mock()
    for _ in sources.update_all(studio.gpu_scene, resolution, with_cache=False, most=0):
        pass
    assert sources.atlas.tile % TILE_STEP == 0
    assert sources._draw.call_count == sources.light_tiles == lights
    studio.free()


@pytest.mark.parametrize("side", [16, 64, 256])
def test_sky_patches_cover_the_sphere_once(headless_device, side):
    studio = Studio(headless_device)
    studio.show(scene([quad("floor")], [], world=World((0.5, 1.0, 2.0))))
    sources = Sources(headless_device)
    for _ in sources.update_all(studio.gpu_scene, side, with_cache=False, most=0):
        pass
    (tile,) = sources.tiles
    x, y, width, height = sources.viewport(tile)
    part = np.s_[y : y + height, x : x + width]
    place, facing, flux = (headless_device.read(texture)[part].astype(np.float64) for texture in sources.colors[:3])
    center = 0.5 * (studio.gpu_scene.boxes[0][0] + studio.gpu_scene.boxes[0][1])
    away = place[..., :3] - center
    distance = np.linalg.norm(away, axis=-1)
    omega = place[..., 3] / distance**2
    assert omega.sum() == pytest.approx(4 * math.pi, rel=1e-3)
    direction = away / distance[..., None]
    # First and second moments of the sphere: 0, and a third of its area on each axis.
    assert np.abs((omega[..., None] * direction).sum((0, 1))).max() < 1e-3
    moments = np.einsum("ij,ija,ijb->ab", omega, direction, direction)
    np.testing.assert_allclose(moments, 4 * math.pi / 3 * np.eye(3), atol=4 * math.pi * 2e-3)
    np.testing.assert_allclose(facing[..., :3], -direction, atol=2e-3)
    assert (facing[..., 3] == SourceKind.SKY).all()
    radiance = flux[..., :3] / (math.pi * place[..., 3:])
    np.testing.assert_allclose(radiance, np.broadcast_to((0.5, 1, 2), radiance.shape), rtol=1e-5)
    sources.free()
    studio.free()

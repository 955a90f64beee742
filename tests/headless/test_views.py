"""Views in place of the picture: each shows what it says at any size, and leaves no trace in what follows."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.gpu_shaders import TECHNIQUES
from rebound.gpu_shaders.frame import views
from rebound.passes import PASSES
from rebound.scene.data import Material, World
from rebound.settings import VIEWPORT_SETTINGS, Settings, shown_view
from rebound.tests.support.render_scenes import QUICK, Studio, box, light, ortho, perspective, quad, scene

ALL = [p.key for p in PASSES]
LAMPS = [
    light("POINT", (-1, 0.5, 1), power=10.0, key="point"),
    light("SPOT", (1, -1, 2.5), key="spot", radius=0.1, spot_blend=0.3),
    light("SUN", (1, 2, 3), power=1.0, key="sun"),
]
MESHES = [quad("floor", u=(2, 0, 0), v=(0, 2, 0)), box("box", (-0.4, -0.4, 0), (0.3, 0.4, 0.9))]
SCENE = scene(MESHES, LAMPS, (0.8, 0.5, 0.2), world=World((0.1, 0.2, 0.3)))
PLACES = {
    "37 x 3": perspective(37, 3),
    "1 x 1": perspective(1, 1),
    "odd": perspective(41, 33),
    "orthographic": ortho(7, 5, 3, (-3, -4, 5)),
}
SMALL = {**QUICK, "vpl_resolution": 64, "vpl_voxels": 64, "vpl_pool": 256}
REUSE = {"vpl_reuse": True, "vpl_scale": "QUARTER", "rsm_interpolation": "QUARTER"}  # as a viewport has it
METHODS = ["NONE", *(technique.id.upper() for technique in TECHNIQUES)]
OF_ALL = [(method, view.key) for method in METHODS for view in views.VIEWS]
OF_ONE = [(technique.id.upper(), view.key) for technique in TECHNIQUES for view in technique.views]


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


class Moving:
    """A viewport without Blender: one frame, begun anew for every picture, that follows the one before."""

    def __init__(self, device, place):
        self.studio, self.place = Studio(device), place
        self.studio.show(SCENE)
        self.frame = self.studio.renderer.begin(place, ("combined",))

    def picture(self, samples=2, **changed):
        """The combined pass of a picture that follows the last one."""
        settings = Settings.defaults(**{**SMALL, **REUSE, **changed})
        self.studio.renderer.restart(self.frame)
        for _ in range(samples):
            for _ in self.studio.renderer.sample(self.frame, self.studio.gpu_scene, self.place, settings):
                pass
        return self.studio.renderer.read(self.frame, "combined")

    def free(self):
        self.studio.renderer.free_frame(self.frame)
        self.studio.free()


@pytest.fixture
def moving(headless_device):
    made = Moving(headless_device, PLACES["odd"])
    yield made
    made.free()


@pytest.mark.parametrize(("method", "view"), [*OF_ALL, *OF_ONE], ids=str)
def test_views_show_something_else_at_any_size(studio, method, view):
    values = {**SMALL, **REUSE, "method": method}
    for name, place in PLACES.items():
        picture = studio.render(SCENE, place, 2, ALL, **values)
        shown = studio.render(SCENE, place, 2, ALL, **values, show=view)
        assert np.isfinite(shown["combined"]).all() and (shown["combined"] >= 0).all(), name
        for key in ("diffuse_direct", "diffuse_indirect", "normal"):
            np.testing.assert_array_equal(shown[key], picture[key], err_msg=key)
        if name == "odd" and (method, view) != ("NONE", "DIRECT"):
            assert (shown["combined"] != picture["combined"]).any()
            assert (shown["combined"][..., :3].max() > 0) == ((method, view) != ("NONE", "INDIRECT"))


@pytest.mark.parametrize(("method", "view"), [("VPL", view) for _, view in OF_ALL[:6]] + OF_ONE, ids=str)
def test_a_view_leaves_no_trace(headless_device, moving, method, view):
    """The pictures after a view are those after as many samples of the picture itself."""
    other = Moving(headless_device, PLACES["odd"])
    for shown in ("PICTURE", view, "PICTURE"):
        found = moving.picture(method=method, show=shown)
        expected = other.picture(method=method)
    np.testing.assert_array_equal(found, expected)
    other.free()


def test_views_cost_no_memory_when_off(moving):
    moving.picture()
    before = moving.studio.device.allocated_bytes
    moving.picture(show="VARIANCE", split=True)
    assert moving.studio.device.allocated_bytes > before
    moving.picture()
    assert moving.studio.device.allocated_bytes == before


def test_view_of_another_method_shows_the_picture():
    assert shown_view(Settings.defaults(method="RSM", show="VPL_VOXELS")) is None
    assert shown_view(Settings.defaults(method="VPL", show="VPL_VOXELS")).label == "Voxels"
    assert shown_view(Settings.defaults(method="NONE", show="ALBEDO")) is views.ALBEDO
    assert shown_view(Settings.defaults()) is None


def test_every_view_is_named_once_and_says_what_it_shows():
    all_views = [*views.VIEWS, *(view for technique in TECHNIQUES for view in technique.views)]
    assert len({view.key for view in all_views}) == len(all_views)
    for technique in TECHNIQUES:
        labels = [view.label for view in (*views.VIEWS, *technique.views)]
        assert len(set(labels)) == len(labels)
        assert all(view.key.startswith(f"{technique.id.upper()}_") for view in technique.views)
    assert all(len(view.description) > 20 and not view.description.endswith(".") for view in all_views)


# --- what they show --------------------------------------------------------------------------------------------------


def test_albedo_and_normals_are_the_surfaces(studio):
    place = ortho(8, 8, 1.0, (1.2, 1.2, 5), (1.2, 1.2, 0))
    for view, expected in (("ALBEDO", (0.8, 0.5, 0.2)), ("NORMALS", (0.5, 0.5, 1.0))):
        shown = studio.render(SCENE, place, 3, **SMALL, method="NONE", show=view)["combined"]
        np.testing.assert_allclose(shown, np.broadcast_to((*expected, 1.0), shown.shape), atol=2e-3)


def test_irradiance_is_the_light_without_the_albedo(studio):
    place = ortho(8, 8, 1.0, (1.2, 1.2, 5), (1.2, 1.2, 0))
    passes = studio.render(SCENE, place, 3, ALL, **SMALL)
    shown = studio.render(SCENE, place, 3, **SMALL, show="IRRADIANCE")["combined"]
    total = passes["diffuse_direct"] + passes["diffuse_indirect"]
    np.testing.assert_allclose(shown[..., :3], total, rtol=2e-3)


@pytest.mark.parametrize("reuse", [False, True])
def test_direct_and_indirect_add_up_to_the_picture(studio, reuse):
    values = {**SMALL, "vpl_reuse": reuse}
    picture, direct, indirect = (
        studio.render(SCENE, PLACES["odd"], 3, **values, show=show)["combined"]
        for show in ("PICTURE", "DIRECT", "INDIRECT")
    )
    np.testing.assert_allclose(direct[..., :3] + indirect[..., :3], picture[..., :3], rtol=1e-5, atol=1e-6)
    without = studio.render(SCENE, PLACES["odd"], 3, **{**values, "method": "NONE"})["combined"]
    np.testing.assert_array_equal(direct, without)
    assert indirect[..., :3].max() > 0.01


def test_variance_is_the_standard_error_of_the_mean(studio, headless_device):
    """Against samples taken one by one: a ramp of three decades whose colours can be told apart."""
    place, count = PLACES["odd"], 8
    values = {**SMALL, "show": "PICTURE"}
    sums = [studio.render(SCENE, place, n, **values)["combined"][..., :3] * n for n in range(count + 1) if n]
    samples = np.diff(np.stack([np.zeros_like(sums[0]), *sums]), axis=0) @ np.array((0.2126, 0.7152, 0.0722))
    mean = samples.mean(0)
    error = samples.std(0, ddof=1) / np.sqrt(count) / np.maximum(mean, 1e-9)
    shown = studio.render(SCENE, place, count, **{**values, "show": "VARIANCE"})["combined"][..., :3]
    decade = np.clip(np.log10(np.maximum(error, 1e-9)) + 3, 0, 3)
    blue = np.where(decade < 1, decade, np.clip(2 - decade, 0, 1))
    green = np.clip(np.where(decade < 2, decade - 1, 3 - decade), 0, 1)
    red = np.clip(decade - 2, 0, 1)
    np.testing.assert_allclose(shown, np.stack((red, green, blue), -1), atol=0.02)
    assert (error > 0.01).any() and (error < 0.001).any()
    once = studio.render(SCENE, place, 1, **{**values, "show": "VARIANCE"})["combined"]
    np.testing.assert_allclose(once[..., :3], 0.2, rtol=1e-6)


def test_occlusion_is_white_in_the_open_and_darker_in_a_corner(studio):
    place = ortho(32, 32, 3.6, (0, 0, 10))
    shown = studio.render(SCENE, place, 16, **SMALL, show="VPL_OCCLUSION")["combined"][..., 0]
    assert shown[2, 2] > 0.95
    beside = shown[16, 18:20].mean()  # at the foot of the box
    assert beside < 0.85


def test_maps_of_each_light_are_its_own(studio):
    place, found = PLACES["odd"], []
    for number in range(1, len(LAMPS) + 1):
        found.append(studio.render(SCENE, place, 1, **SMALL, show="VPL_MAP_FLUX", show_light=number)["combined"])
    assert all((found[i] != found[j]).any() for i, j in ((0, 1), (0, 2), (1, 2)))
    first = studio.render(SCENE, place, 1, **SMALL, show="VPL_MAP_FLUX")["combined"]
    np.testing.assert_array_equal(first, found[0])
    none = studio.render(SCENE, place, 1, **SMALL, show="VPL_MAP_FLUX", show_light=9)["combined"]
    assert not none[..., :3].any()


def test_flux_of_a_map_is_as_bright_as_the_surface(studio):
    """A spot straight above a floor: the middle of its map, beside the middle of the picture."""
    lit = scene(MESHES[:1], [light("SPOT", (0, 0, 3), power=100.0)], (0.8, 0.5, 0.2))
    place = ortho(9, 9, 0.1, (0, 0, 10))
    picture = studio.render(lit, place, 1, **SMALL, show="DIRECT")["combined"][4, 4]
    shown = studio.render(lit, ortho(9, 9, 1.0), 1, **SMALL, show="VPL_MAP_FLUX")["combined"][4, 4]
    np.testing.assert_allclose(shown, picture, rtol=0.02)


def test_depth_and_normal_of_a_map(studio):
    lit = scene(MESHES[:1], [light("SPOT", (0, 0, 3), power=100.0)], (0.8, 0.5, 0.2))
    values = {**SMALL, "rsm_resolution": 128}
    depth, normal = (
        studio.render(lit, ortho(9, 9, 1.0), 1, **values, method="RSM", show=f"RSM_MAP_{part}")["combined"][4, 4]
        for part in ("DEPTH", "NORMAL")
    )
    np.testing.assert_allclose(normal[:3], (0.5, 0.5, 1.0), atol=2e-3)
    assert 0.0 < depth[0] < 0.5 and depth[0] == depth[1] == depth[2]  # the floor is near the scene's far end


def test_strip_covers_only_the_lower_part_of_the_picture(studio):
    values = {**SMALL, "vpl_reuse": True}
    place = perspective(96, 64)
    picture = studio.render(SCENE, place, 2, **values)["combined"]
    shown = studio.render(SCENE, place, 2, **values, show="VPL_MAPS")["combined"]
    np.testing.assert_allclose(shown[24:], picture[24:], rtol=1e-6)
    assert (shown[4:20] != picture[4:20]).any(-1).mean() > 0.3


def test_pool_is_drawn_where_light_falls(studio):
    lit = scene(MESHES[:1], [light("SPOT", (0, 0, 3), power=100.0, spot_angle=0.4)], (0.9, 0.1, 0.1))
    place = ortho(33, 33, 4.0)
    shown = studio.render(lit, place, 1, **SMALL, show="VPL_POOL")["combined"][..., :3]
    dark = 0.25 * studio.render(lit, place, 1, **SMALL)["combined"][..., :3]
    points = (shown - dark).max(-1) > 0.1
    assert points[12:21, 12:21].any() and not points[:8].any() and not points[:, :8].any()
    assert (shown - dark)[points].argmax(-1).max() == 0, "red like the floor that sends it"


def test_resolution_shows_the_grid_of_gathering_pixels(studio):
    place = ortho(32, 32, 1.0, (1.2, 1.2, 5), (1.2, 1.2, 0))
    for scale, part in (("FULL", 1.0), ("HALF", 1 / 4), ("QUARTER", 1 / 16)):
        shown = studio.render(SCENE, place, 1, **SMALL, show="VPL_RESOLUTION", vpl_scale=scale)["combined"][..., :3]
        assert (shown == 1.0).all(-1).mean() == pytest.approx(part, abs=0.02), scale
        others = shown[(shown != 1.0).any(-1)]
        assert (others[:, 1] > 0.9).all(), "all of a floor is one surface"


# --- bounced light off and on ----------------------------------------------------------------------------------------


def test_viewport_settings_have_defaults_that_change_nothing():
    values = Settings.defaults()
    assert {s.name for s in VIEWPORT_SETTINGS} <= values.values.keys()
    assert values["indirect"] is True and values["split"] is False


def test_without_indirect_light_the_picture_is_that_of_no_method(moving, headless_device):
    off = moving.picture(indirect=False)
    without = Moving(headless_device, PLACES["odd"])
    np.testing.assert_array_equal(off, without.picture(method="NONE"))
    without.free()


def test_indirect_light_comes_back_with_all_that_was_kept(moving):
    moving.picture()
    moving.picture()
    technique = moving.studio.renderer._techniques["vpl"]
    built, drawn, picture = technique.voxels.built, technique.sources.drawn, technique._picture
    moving.picture(indirect=False)
    assert moving.studio.renderer._techniques["vpl"] is technique
    assert technique._picture == picture, "off costs nothing: no sample of the method ran"
    moving.picture(1)
    assert (technique.voxels.built, technique.sources.drawn) == (built, drawn)
    assert technique._picture == picture + 1, "its mean goes on"


def test_split_holds_both_pictures(moving, headless_device):
    renderer, frame = moving.studio.renderer, moving.frame
    assert renderer.unbounced(frame) is None
    whole = moving.picture(split=True)
    without = moving.studio.device.read(renderer.unbounced(frame)) / frame.samples
    other = Moving(headless_device, PLACES["odd"])
    np.testing.assert_array_equal(whole, other.picture())
    none = other.picture(indirect=False)
    np.testing.assert_allclose(without, none, rtol=1e-6)
    assert (whole != without).any()
    other.free()


def test_emitters_light_belongs_to_the_method_in_the_split_too(headless_device):
    """Without a lamp all light on others is the method's: the side without it is what turning it off shows."""
    glowing = (Material("Glow", (0.5, 0.5, 0.5), emission=(3.0, 3.0, 3.0)), Material("Grey", (0.5, 0.5, 0.5)))
    made = Moving(headless_device, PLACES["odd"])
    lit = replace(SCENE, materials=glowing[:1], lights=(), world=World())
    made.studio.show(lit)
    made.picture(split=True)
    without = made.studio.device.read(made.studio.renderer.unbounced(made.frame)) / made.frame.samples
    np.testing.assert_allclose(without, made.picture(indirect=False), rtol=1e-6)
    made.free()


# --- times -----------------------------------------------------------------------------------------------------------


def test_passes_are_timed_only_while_wanted(moving, monkeypatch):
    waits = []
    monkeypatch.setattr(moving.studio.device, "finish", lambda: waits.append(1))
    moving.picture()
    assert not waits and not moving.studio.renderer.clock.seconds
    moving.studio.renderer.clock.on = True
    moving.picture()
    seconds = moving.studio.renderer.clock.seconds
    assert {"surfaces", "direct light", "light maps", "voxels", "virtual lights", "gather", "sum"} <= seconds.keys()
    assert waits and all(value >= 0 for value in seconds.values()) and sum(seconds.values()) > 0
    moving.studio.renderer.clock.on = False
    moving.picture()
    assert not moving.studio.renderer.clock.seconds


def test_time_between_pieces_is_not_counted(moving, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("rebound.gpu_shaders.frame.clock.time.perf_counter", lambda: now[0])
    clock = moving.studio.renderer.clock
    clock.on = True
    clock.begin()
    now[0] = 1.0
    clock.pause()
    now[0] = 100.0
    clock.resume()
    now[0] = 102.0
    clock.mark("pass")
    clock.end()
    assert clock.seconds == {"pass": 3.0}

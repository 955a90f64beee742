"""A picture of a loaded snapshot is the picture of the scene that was saved."""

from rebound.scene.data import Material
from rebound.scene.snapshot import load_snapshot, save_snapshot
from rebound.tests.support.render_scenes import Studio, box, light, perspective, quad, scene, sphere


def test_rendering_from_a_snapshot_gives_the_same_bits(headless_device, tmp_path):
    original = scene(
        [quad("floor", u=(4, 0, 0), v=(0, 4, 0)), box("box", (-1, -1, 0), (0, 0, 1)), sphere("ball", (1, 1, 1))],
        [light("SPOT", (2, -2, 4)), light("AREA", (-2, 0, 3), key="panel", area_shape="DISK")],
        materials=(Material("A", (0.7, 0.2, 0.1)), Material("B", (0.5, 0.5, 0.5)), Material("C", (0.1, 0.6, 0.2))),
    )
    view = perspective(33, 21)
    save_snapshot(tmp_path / "scene.npz", original, view)
    pictures = []
    for each_scene, each_view in ((original, view), load_snapshot(tmp_path / "scene.npz")):
        studio = Studio(headless_device)
        pictures.append(studio.render(each_scene, each_view, samples=2, passes=("combined", "diffuse_indirect")))
        studio.free()
    assert pictures[0]["diffuse_indirect"].any()
    for name, picture in pictures[0].items():
        assert picture.tobytes() == pictures[1][name].tobytes(), name

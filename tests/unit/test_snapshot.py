"""A snapshot holds a scene and a view bit by bit, and a file that is none is refused in one line."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rebound.scene import data, node_graph, snapshot
from rebound.scene.data import Image, Instance, Light, LightKind, Material, Mesh, Scene, Texture, View, Visibility
from rebound.scene.snapshot import SnapshotError, load_snapshot, save_snapshot
from rebound.tests.support.snapshots import assert_same

VIEW = View(np.eye(4), np.diag([2.0, 2.0, -0.1, 1.0]), 32, 16)

keys = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text(max_size=5)
    | st.binary(max_size=5),
    lambda inner: st.tuples(inner, inner),
    max_leaves=4,
)
numbers = st.floats(width=64)  # infinite and not a number, too: they are kept as they are
colors = st.tuples(numbers, numbers, numbers)
matrices = hnp.arrays(np.float64, (4, 4))


def floats(*shape):
    return hnp.arrays(np.float32, shape)


@st.composite
def meshes(draw, key):
    corners = 3 * draw(st.integers(0, 4))
    uvs = draw(st.dictionaries(st.text(max_size=3), floats(corners, 2), max_size=2))
    slots = tuple(draw(st.lists(st.tuples(*[st.integers(0, 9)] * 3), max_size=2)))
    arrays = (draw(floats(corners, 3)), draw(floats(corners, 3)))
    return Mesh(
        key, *arrays, uvs, draw(st.text(max_size=3)), slots, draw(floats(2, 3)), tuple(draw(st.lists(st.text())))
    )


@st.composite
def scenes(draw):
    mesh_keys = draw(st.lists(keys, unique_by=repr, max_size=3))
    image_keys = draw(st.lists(keys, unique_by=repr, max_size=2))
    textures = (
        st.none() | st.builds(Texture, st.sampled_from(image_keys), st.text(max_size=3)) if image_keys else st.none()
    )
    images = {key: Image(key, draw(st.text()), draw(hnp.arrays(np.float32, (2, 3, 4)))) for key in image_keys}
    instances = st.builds(
        Instance,
        keys,
        st.sampled_from(mesh_keys or [None]),
        st.tuples(st.integers(0, 3)),
        matrices,
        st.integers(0, 15).map(Visibility),
    )
    lights = st.builds(Light, keys, st.text(), st.sampled_from(LightKind), colors, matrices, numbers)
    materials = st.builds(Material, st.text(), colors, textures, colors, textures)
    return Scene(
        {key: draw(meshes(key)) for key in mesh_keys},
        tuple(draw(st.lists(instances, max_size=3))),
        tuple(draw(st.lists(materials, max_size=2))),
        images,
        tuple(draw(st.lists(lights, max_size=2))),
        film_transparent=draw(st.booleans()),
        filter_width=draw(numbers),
    )


def round_trip(folder, scene, view=VIEW):
    save_snapshot(folder / "snapshot.npz", scene, view)
    return load_snapshot(folder / "snapshot.npz")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(scene=scenes(), matrix=matrices)
def test_any_scene_comes_back_bit_by_bit(tmp_path, scene, matrix):
    view = replace(VIEW, view_from_world=matrix)
    loaded_scene, loaded_view = round_trip(tmp_path, scene, view)
    assert_same(scene, loaded_scene)
    assert_same(view, loaded_view)


def test_every_class_of_the_scene_data_has_a_place():
    """A class that is added to scene.data or node_graph is found by itself, one from elsewhere is refused at saving."""
    assert {
        "Scene",
        "View",
        "Mesh",
        "Instance",
        "Material",
        "Light",
        "LightKind",
        "Visibility",
    } <= snapshot.KINDS.keys()
    assert {kind.__module__ for kind in snapshot.KINDS.values()} == {data.__name__, node_graph.__name__}


def test_one_array_in_two_places_is_written_once(tmp_path):
    points = np.random.default_rng(1).random((30_000, 3), np.float32)

    def size(other):
        mesh = Mesh("mesh", points, other, {}, "", (), np.zeros((2, 3), np.float32))
        round_trip(tmp_path, Scene({"mesh": mesh}))
        return (tmp_path / "snapshot.npz").stat().st_size

    assert size(points) < 0.6 * size(points.copy())


def test_many_instances_make_few_parts(tmp_path):
    """One part of the file for each matrix would take minutes for 50,000 instances."""
    instances = tuple(Instance(i, "mesh", (0,), np.full((4, 4), i / 7), Visibility.CAMERA) for i in range(2000))
    loaded, _ = round_trip(tmp_path, Scene(instances=instances))
    assert_same(instances, loaded.instances)
    assert len(np.load(tmp_path / "snapshot.npz").files) < 6


def test_what_has_no_place_is_refused_by_name_and_leaves_no_file(tmp_path):
    for wrong in (object(), {1, 2}, np.array([object()]), pytest):
        with pytest.raises(TypeError, match="no place"):
            save_snapshot(tmp_path / "snapshot.npz", Scene(warnings=(wrong,)), VIEW)
    assert not list(tmp_path.iterdir())


def test_failing_save_leaves_the_older_file(tmp_path):
    round_trip(tmp_path, Scene())
    with pytest.raises(TypeError):
        save_snapshot(tmp_path / "snapshot.npz", Scene(warnings=(object(),)), VIEW)
    assert load_snapshot(tmp_path / "snapshot.npz")[0].instances == ()


# --- files that are none ---------------------------------------------------------------------------------------------


def rewrite_header(path, change):
    """Change the JSON text inside a snapshot."""
    with np.load(path) as file:
        parts = {name: file[name] for name in file.files}
    header = json.loads(bytes(parts["header"]))
    change(header)
    parts["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    with open(path, "wb") as file:
        np.savez(file, **parts)


def test_newer_file_says_to_update(tmp_path):
    round_trip(tmp_path, Scene())
    rewrite_header(tmp_path / "snapshot.npz", lambda header: header.update(version=99))
    with pytest.raises(SnapshotError, match="newer Rebound.*format 99"):
        load_snapshot(tmp_path / "snapshot.npz")


def test_unknown_field_is_named(tmp_path):
    round_trip(tmp_path, Scene())
    rewrite_header(tmp_path / "snapshot.npz", lambda header: header["scene"]["fields"].update(fog=1))
    with pytest.raises(SnapshotError, match="Scene has fog"):
        load_snapshot(tmp_path / "snapshot.npz")


def test_field_that_is_new_takes_its_default(tmp_path):
    """An older file, from before a field with a default was added, is still good."""
    round_trip(tmp_path, Scene(filter_width=3.0))
    rewrite_header(tmp_path / "snapshot.npz", lambda header: header["scene"]["fields"].pop("filter_width"))
    assert load_snapshot(tmp_path / "snapshot.npz")[0].filter_width == Scene().filter_width


def test_field_without_default_that_is_missing_is_named(tmp_path):
    round_trip(tmp_path, Scene())
    rewrite_header(tmp_path / "snapshot.npz", lambda header: header["view"]["fields"].pop("width"))
    with pytest.raises(SnapshotError, match="View has no width"):
        load_snapshot(tmp_path / "snapshot.npz")


@pytest.mark.parametrize("content", [b"", b"PK", b"no archive at all" * 9, b"\x93NUMPY\x01\x00", b"\x80\x04]\x94."])
def test_other_file_is_refused(tmp_path, content):
    (tmp_path / "other.npz").write_bytes(content)
    with pytest.raises(SnapshotError, match="other.npz"):
        load_snapshot(tmp_path / "other.npz")


def test_other_archive_is_refused(tmp_path):
    np.savez(tmp_path / "other.npz", header=np.zeros(3))
    with pytest.raises(SnapshotError, match="other.npz"):
        load_snapshot(tmp_path / "other.npz")


def test_missing_file_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_snapshot(tmp_path / "none.npz")


def test_cut_off_file_is_refused(tmp_path):
    ones = np.ones((3, 3), np.float32)
    round_trip(tmp_path, Scene({"m": Mesh("m", ones, 2 * ones, {}, "", (), ones[:2])}))
    whole = (tmp_path / "snapshot.npz").read_bytes()
    for length in range(0, len(whole), max(len(whole) // 40, 1)):
        (tmp_path / "cut.npz").write_bytes(whole[:length])
        with pytest.raises(SnapshotError, match="cut.npz"):
            load_snapshot(tmp_path / "cut.npz")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=300)
@given(where=st.floats(0, 1, exclude_max=True), bits=st.integers(1, 255))
def test_damaged_byte_is_refused_or_harmless(tmp_path, where, bits):
    """What is raised is a SnapshotError, never anything else; what is not covered by a checksum changes nothing."""
    instances = (Instance(("a", 1), "m", (0,), np.arange(16.0).reshape(4, 4), Visibility.SHADOW),)
    original = Scene(instances=instances)
    save_snapshot(tmp_path / "damaged.npz", original, VIEW)
    content = bytearray((tmp_path / "damaged.npz").read_bytes())
    content[int(where * len(content))] ^= bits
    (tmp_path / "damaged.npz").write_bytes(content)
    try:
        loaded, _ = load_snapshot(tmp_path / "damaged.npz")
    except SnapshotError:
        return
    assert_same(original, loaded)


def test_nothing_is_unpickled(tmp_path):
    """A snapshot from somebody else can hold no code: arrays of objects are refused."""

    class Bomb:
        def __reduce__(self):
            return pytest.fail, ("unpickled",)

    round_trip(tmp_path, Scene(instances=(Instance("a", "m", (0,), np.eye(4), Visibility.SHADOW),)))
    with np.load(tmp_path / "snapshot.npz") as file:
        parts = {name: file[name] for name in file.files}
    parts["<f8"] = np.array([Bomb()], object)
    np.savez(tmp_path / "bomb.npz", **parts)
    with pytest.raises(SnapshotError, match="bomb.npz"):
        load_snapshot(tmp_path / "bomb.npz")

"""One bake of some objects of a scene, from its settings to what their files hold; and whether a file still fits."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable, Generator, Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from ..scene.data import Array, Instance, Mesh, Scene, Visibility
from . import sh
from .compress import Compressed, compress
from .file import Bake
from .glossy import glossy, what_is_seen
from .haar import SparseRows
from .matrices import turn_matrices
from .occlusion import Caster, make_caster
from .refine import Detail, refine, with_details
from .separable import LOBES, factor, tangents
from .surfaces import Surfaces, frame_of, gather, is_mirror, mesh_fingerprint
from .transfer import Lit, Progress, Sampling, diffuse, passed_on, scaled
from .wavelets import mirrored_bounces, wavelet

_logger = logging.getLogger("rebound")  # by name: as an extension the package is bl_ext.….rebound

# Roughnesses that look alike.
_SAME_ROUGHNESS = 0.02
# Of the time of a bake, the part that finding points inside triangles is said to take.
_DETAIL_PART = 0.15


class Kind(Enum):
    """What is baked."""

    DIFFUSE = "DIFFUSE"  # a vector a vertex: soft light on matt surfaces
    GLOSSY = "GLOSSY"  # a matrix a vertex: soft light on shiny surfaces
    WAVELET = "WAVELET"  # a sparse row a vertex: light with sharp edges on matt surfaces
    WAVELET_GLOSSY = "WAVELET_GLOSSY"  # and a few more, of a lobe: on shiny surfaces of one roughness


@dataclass(frozen=True)
class BakeSettings:
    """What a bake costs and how good it is. Kinds leave alone what is not theirs."""

    kind: Kind = Kind.DIFFUSE
    bands: int = 5  # 1..11, GLOSSY with result_bands 12 together: the light's detail; WAVELET: of light that bounced
    result_bands: int = 5  # GLOSSY: detail of what arrives
    lobe: str = "GGX"  # WAVELET_GLOSSY: of separable.LOBES
    lobe_terms: int = 24  # WAVELET_GLOSSY: products that the lobe is the sum of
    directions: int = 1024  # rays a vertex, over the whole sphere; WAVELET: of light that bounced, texels are its rays
    shadows: bool = True
    bounces: int = 2  # by way of other surfaces
    cuts: int = (
        32  # with bounces: how finely large triangles reflect, in parts of the scene's diagonal; 0: by their corners
    )
    error: float = 0.01  # GLOSSY, WAVELET_GLOSSY's bounces: root mean square error of the compression, of the length
    texels: int = 32  # WAVELET...: a power of two, up to 64; along a side of a face of the light's cube map
    keep: float = 0.999  # WAVELET...: the part of each row's energy that is kept; a lobe's leave ten times as much out
    points: int = 0  # at most so many inside an object's triangles, where its vertices do not tell what is between them
    detail: float = (
        0.05  # with points: which error between the vertices is left, in parts of what an open place receives
    )
    rays: str = ""  # "embree", "numpy", or "" for the better one there is

    def __post_init__(self) -> None:
        """Raises ValueError naming the setting that is out of its limits."""
        limits: dict[str, tuple[float, float]] = {"bands": (1, sh.MAX_BANDS), "directions": (16, 65536)}
        limits |= {
            "bounces": (0, 64),
            "cuts": (0, 256),
            "points": (0, 1 << 20),
            "detail": (0, 1),
            "error": (0, 1),
            "keep": (0, 1),
            "texels": (1, 64),
            "result_bands": (1, 11),
            "lobe_terms": (1, 64),
        }
        for name, (low, high) in limits.items():
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} is {getattr(self, name)}: it can be {low} to {high}")
        if self.texels & (self.texels - 1):
            raise ValueError(f"texels is {self.texels}: it can be 1, 2, 4, 8, 16, 32 or 64")
        if self.lobe not in LOBES:
            raise ValueError(f"lobe is {self.lobe}: it can be {' or '.join(LOBES)}")
        if self.kind is Kind.GLOSSY and self.bands + self.result_bands > sh.MAX_BANDS + 1:
            raise ValueError(f"bands and result_bands together are more than {sh.MAX_BANDS + 1}")


def surroundings_fingerprint(
    scene: Scene, key: Hashable, shape_of: Callable[[Mesh], str] = mesh_fingerprint, lobes: bool = False
) -> str:
    """Hexadecimal SHA-256 of all that a bake of ``key`` depends on beside its own mesh: who stands where, how coloured.

    Seen from the object: moving it and all others together rigidly changes nothing to speak of (5 digits are kept).
    ``shape_of``: mesh_fingerprint, or the like of it that remembers. ``lobes``: how rough the others are that light
    keeps its direction at, too; the object's own roughness may be changed after its bake.
    """
    others = [i for i in scene.instances if i.key == key or i.visibility & Visibility.SHADOW]
    own = next(i for i in others if i.key == key)
    home = np.eye(4)
    home[:3, :3], home[:3, 3] = frame_of(own.world_from_object), own.world_from_object[:3, 3]
    places = np.round(np.linalg.inv(home) @ np.stack([i.world_from_object for i in others]), 5) + 0.0
    shapes: dict[Hashable, str] = {}
    lines = []
    for other, place in zip(others, places.tolist(), strict=True):
        colours = [scene.materials[m] for m in other.materials]
        look = [(c.base_color, str(c.base_color_texture), c.metallic, c.specular, c.layered) for c in colours]
        rough = [round(c.roughness, 2) for c in colours if is_mirror(c)] if lobes and other.key != key else []
        flags = int(other.visibility & (Visibility.SHADOW | Visibility.BOUNCE))
        if other.mesh not in shapes:  # one mesh may stand in 50,000 places
            shapes[other.mesh] = shape_of(scene.meshes[other.mesh])
        line = f"{shapes[other.mesh]} {other.key == key} {place} {look} {flags}"
        lines.append(f"{line} {rough}" if rough else line)
    return hashlib.sha256("\n".join(sorted(lines)).encode()).hexdigest()


def unfit(about: Any, scene: Scene, key: Hashable, shape_of: Callable[[Mesh], str] = mesh_fingerprint) -> str:
    """Why the bake that ``about`` tells of is not one of this object as it stands; "" where it is. One line."""
    instance = next((i for i in scene.instances if i.key == key), None)
    if instance is None:
        return "the object is no longer there"
    if about.get("fingerprint") != shape_of(scene.meshes[instance.mesh]):
        return "the mesh has changed since it was baked: bake again"
    bounced, lobes = _has_bounces(about.get("settings", {})), bool(about.get("lobes"))
    if bounced and not lobes and any(is_mirror(scene.materials[m]) for i in scene.instances for m in i.materials):
        return "it was baked by an older Rebound, in which metals passed light on to all sides alike: bake again"
    if about.get("surroundings") != surroundings_fingerprint(scene, key, shape_of, lobes):
        return "what stands around the object, or how it looks, has changed since it was baked: bake again"
    if "roughness" in about and abs(about["roughness"] - roughness_of(scene, instance)[0]) > _SAME_ROUGHNESS:
        return f"its roughness is no longer {about['roughness']:.2f}, for which it was baked: bake again"
    return ""


def _has_bounces(settings: Mapping[str, Any]) -> bool:
    return bool(settings.get("bounces") and settings.get("shadows"))


def roughness_of(scene: Scene, instance: Instance) -> tuple[float, float]:
    """Mean over the object's triangles, of those that reflect where some do, and how far they are apart."""
    materials = [scene.materials[m] for m in instance.materials]
    slots = scene.meshes[instance.mesh].slots
    used = [(materials[min(slot, len(materials) - 1)], count) for slot, _, count in slots if count]
    used = [(material, count) for material, count in used if material.is_glossy] or used
    values = [material.roughness for material, _ in used]
    return float(np.average(values, weights=[count for _, count in used])), max(values) - min(values)


def bake_objects(
    scene: Scene, keys: Sequence[Hashable], settings: BakeSettings
) -> Generator[Progress, None, dict[Hashable, Bake]]:
    """What the files of the objects ``keys`` hold. Closing the generator ends the bake.

    The bounces of all are found together. Raises ValueError for a key that is not in the scene or has
    no surface.
    """
    by_key = {i.key: i for i in scene.instances}
    missing = [key for key in keys if key not in by_key]
    if missing:
        raise ValueError(f"the scene has no object {missing[0]!r}")
    bare = [key for key in keys if not scene.meshes[by_key[key].mesh].triangle_count]
    if bare:
        raise ValueError(f"object {bare[0]!r} has no surface to bake")
    surfaces = gather(scene, frozenset(keys), settings.cuts if settings.bounces and settings.shadows else 0)
    caster = make_caster(surfaces.corners[surfaces.blocks], settings.rays)
    device = f"CPU, rays by {caster.name}"
    yield Progress(0.0, "shadows", device)
    instances = [by_key[key] for key in keys]
    details, start = {}, 0.0
    if settings.points:
        start = _DETAIL_PART
        details = yield from scaled(_details(scene, surfaces, caster, instances, settings), 0.0, start)
        surfaces = with_details(surfaces, details)
    if settings.kind is Kind.DIFFUSE:
        work = _diffuse(surfaces, caster, instances, settings)
    else:
        work = _one_by_one(scene, surfaces, caster, instances, settings)
    found = yield from scaled(work, start, 1.0 - start)
    bakes = {}
    for key, (more, arrays) in found.items():
        inside, splits = _of_detail(details.get(key))
        bakes[key] = Bake(_about(scene, key, settings) | {"device": device} | inside | more, arrays | splits)
    return bakes


Found = dict[Hashable, tuple[dict[str, Any], dict[str, Array]]]


def _about(scene: Scene, key: Hashable, settings: BakeSettings) -> dict[str, Any]:
    plain = asdict(settings) | {"kind": settings.kind.value}
    mesh = scene.meshes[next(i for i in scene.instances if i.key == key).mesh]
    lobes = _has_bounces(plain)
    about = {"kind": plain["kind"], "object": str(key), "fingerprint": mesh_fingerprint(mesh), "lobes": lobes}
    return about | {"surroundings": surroundings_fingerprint(scene, key, lobes=lobes), "settings": plain}


def _sampling(settings: BakeSettings) -> Sampling:
    return Sampling(settings.bands, settings.directions, settings.shadows, settings.bounces)


def _details(
    scene: Scene, surfaces: Surfaces, caster: Caster, instances: Sequence[Instance], settings: BakeSettings
) -> Generator[Progress, None, dict[Hashable, Detail]]:
    """Of the objects whose vertices are not enough."""
    sampling, found = _sampling(settings), {}
    if settings.kind in (Kind.WAVELET, Kind.WAVELET_GLOSSY):
        sampling = replace(sampling, bands=sh.MAX_BANDS)  # which has no end there
    for number, instance in enumerate(instances):
        work = refine(scene, surfaces, caster, instance, sampling, settings.points, settings.detail)
        detail = yield from scaled(work, number / len(instances), 1.0 / len(instances))
        if detail is not None:
            found[instance.key] = detail
    return found


def _of_detail(detail: Detail | None) -> tuple[dict[str, Any], dict[str, Array]]:
    """What a file says of the points inside triangles, and has of them."""
    if detail is None:
        return {}, {}
    return {"points": len(detail.origins), "detail_error": detail.error}, {"splits": detail.splits}


def _diffuse(
    surfaces: Surfaces, caster: Caster, instances: Sequence[Instance], settings: BakeSettings
) -> Generator[Progress, None, Found]:
    rows = np.sort(np.concatenate([surfaces.rows(instance.key) for instance in instances]))
    transfer = yield from diffuse(surfaces, caster, _sampling(settings), rows)
    turned = ((i, sh.rotate(transfer[surfaces.rows(i.key)], frame_of(i.world_from_object).T)) for i in instances)
    return {instance.key: ({}, {"diffuse": vectors.astype(np.float16)}) for instance, vectors in turned}


def _one_by_one(
    scene: Scene, surfaces: Surfaces, caster: Caster, instances: Sequence[Instance], settings: BakeSettings
) -> Generator[Progress, None, Found]:
    """Glossy matrices or wavelet rows of each; what they have in common, light that bounced, is found once before."""
    sampling, start = _sampling(settings), 0.0
    bounced: Array | None = None  # WAVELET: with all bounces
    seen: Lit | None = None  # the others: a bounce less, for their own rays
    if settings.bounces and settings.shadows:
        if settings.kind is Kind.WAVELET:
            bounced = yield from scaled(diffuse(surfaces, caster, sampling), 0.0, 0.4)
        else:
            seen = yield from scaled(passed_on(surfaces, caster, what_is_seen(sampling)), 0.0, 0.4)
        start = 0.4
    found: Found = {}
    for number, instance in enumerate(instances):
        if settings.kind is Kind.WAVELET_GLOSSY:
            work = _wavelet_glossy(scene, surfaces, caster, instance, settings, seen)
        elif settings.kind is Kind.GLOSSY:
            work = _glossy(surfaces, caster, instance, settings, seen)
        else:
            work = _wavelet(surfaces, caster, instance, settings, bounced)
        part = (1.0 - start) / len(instances)
        found[instance.key] = yield from scaled(work, start + number * part, part)
    return found


def _glossy(
    surfaces: Surfaces, caster: Caster, instance: Instance, settings: BakeSettings, seen: Lit | None
) -> Generator[Progress, None, tuple[dict[str, Any], dict[str, Array]]]:
    rows = surfaces.rows(instance.key)
    bake = glossy(surfaces, caster, _sampling(settings), settings.result_bands, rows, seen)
    matrices = yield from scaled(bake, 0.0, 0.8)
    matrices = turn_matrices(matrices, frame_of(instance.world_from_object))
    return (yield from scaled(_compressed(matrices, settings.error), 0.8, 0.2))


def _compressed(matrices: Array, error: float) -> Generator[Progress, None, tuple[dict[str, Any], dict[str, Array]]]:
    """Of matrices (n, channels, results, light)."""
    packed = yield from compress(matrices.reshape(len(matrices), -1), error)
    more = {"matrix": list(matrices.shape[1:]), "rms": packed.rms, "worst": packed.worst}
    arrays = {"clusters": packed.clusters.astype(np.uint32), "means": packed.means}
    if packed.weights.shape[1]:  # means alone may be enough
        arrays |= {"weights": packed.weights, "axes": packed.axes}
    return more, arrays


def _wavelet(
    surfaces: Surfaces, caster: Caster, instance: Instance, settings: BakeSettings, lit: Array | None
) -> Generator[Progress, None, tuple[dict[str, Any], dict[str, Array]]]:
    frame, rows = frame_of(instance.world_from_object), surfaces.rows(instance.key)
    work = wavelet(surfaces, caster, settings.texels, settings.keep, frame, rows, settings.shadows)
    sparse, _ = yield from scaled(work, 0.0, 0.8)
    arrays = _sparse_arrays("", sparse)
    if lit is not None:
        first = yield from scaled(diffuse(surfaces, caster, replace(_sampling(settings), bounces=0), rows), 0.8, 0.2)
        arrays["bounced"] = sh.rotate(lit[rows] - first[rows], frame.T).astype(np.float16)
    return {"width": sparse.width}, arrays


def _wavelet_glossy(
    scene: Scene, surfaces: Surfaces, caster: Caster, instance: Instance, settings: BakeSettings, seen: Lit | None
) -> Generator[Progress, None, tuple[dict[str, Any], dict[str, Array]]]:
    frame, rows = frame_of(instance.world_from_object), surfaces.rows(instance.key)
    roughness, apart = roughness_of(scene, instance)
    if apart > _SAME_ROUGHNESS:
        _logger.warning(
            "Object '%s' has surfaces of several roughnesses: it is baked with their mean, %.2f",
            instance.key,
            roughness,
        )
    lobe = factor(LOBES[settings.lobe], roughness, settings.lobe_terms)
    work = wavelet(surfaces, caster, settings.texels, settings.keep, frame, rows, settings.shadows, lobe)
    sparse, mirrored = yield from scaled(work, 0.0, 0.8)
    assert mirrored is not None
    normals = surfaces.normals[rows]
    arrays = _sparse_arrays("", sparse) | _sparse_arrays("lobe_", mirrored)
    arrays["turns"] = (np.stack([normals, tangents(normals)], axis=1) @ frame).astype(np.float32)
    more: dict[str, Any] = {"width": sparse.width, "roughness": roughness, "lobe_error": lobe.error}
    if seen is not None and (surfaces.reflectance.any() or surfaces.mirrored.any()):
        bounces = mirrored_bounces(surfaces, caster, _sampling(settings), rows, seen, lobe)
        matrices = sh.rotate((yield from scaled(bounces, 0.8, 0.1)), frame.T)
        if matrices.any():
            facts, packed = yield from scaled(_compressed(matrices, settings.error), 0.9, 0.1)
            more, arrays = more | facts, arrays | packed
    return more, arrays | {"lobe": lobe.table()}


def _sparse_arrays(prefix: str, sparse: SparseRows) -> dict[str, Array]:
    arrays = {f"{prefix}counts": np.diff(sparse.starts).astype(np.uint32), f"{prefix}scales": sparse.scales}
    if len(sparse.terms):  # a wholly hidden object has none
        numbers = {"terms": sparse.terms.astype(np.uint32), "steps": sparse.steps.astype(np.float32)}
        arrays |= {prefix + name: array for name, array in numbers.items()}
    return arrays


def wavelet_rows(bake: Bake, prefix: str = "") -> SparseRows:
    """The rows of a file of Kind.WAVELET or WAVELET_GLOSSY, whose lobe's rows have the ``prefix`` "lobe_"."""
    arrays, nothing = bake.arrays, np.zeros(0)
    counts, scales = arrays[f"{prefix}counts"], arrays[f"{prefix}scales"]
    starts = np.concatenate([[0], np.cumsum(counts.astype(np.int64))])
    terms, steps = arrays.get(f"{prefix}terms", nothing), arrays.get(f"{prefix}steps", nothing)
    return SparseRows(starts, terms.astype(np.uint16), steps.astype(np.int16), scales, bake.about["width"])


def glossy_matrices(bake: Bake) -> Compressed:
    """The compressed matrices of a file of Kind.GLOSSY; ``about["matrix"]`` is the shape of one."""
    arrays, means = bake.arrays, bake.arrays["means"]
    weights = arrays.get("weights", np.zeros((len(arrays["clusters"]), 0), np.float16))
    axes = arrays.get("axes", np.zeros((len(means), 0, means.shape[1]), np.float16))
    clusters = arrays["clusters"].astype(np.uint16)
    return Compressed(clusters, weights, means, axes, bake.about["rms"], bake.about["worst"])

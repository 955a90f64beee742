"""The light of baked objects in a picture: their bakes' answers (bake/live.py) for the passes (gpu_shaders/prt)."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np

from .bake.light import Surroundings
from .bake.live import Live, make_live
from .bake.refine import tree
from .bake.surfaces import frame_of, mesh_vertices
from .bake.view_table import LOBES, least_roughness, weights
from .device.interface import Device, Target
from .gpu_scene import GpuScene
from .gpu_shaders.frame.inputs import FrameInputs, LightTargets
from .gpu_shaders.prt import BakedObject, BakedObjects, Look
from .gpu_shaders.prt.shaders import LOBE_BANDS, LOBE_TEXELS, LOBES_SIDE
from .scene.data import Instance, Scene, Visibility
from .settings import Settings

_SEEN = Visibility.CAMERA
_NOT_LIT = Visibility.HOLDOUT | Visibility.NO_INDIRECT


class BakedLight:
    """Bakes of one renderer; ``updates`` counts answers worked out, for the reactivity tests."""

    def __init__(self, device: Device) -> None:
        self.updates = 0
        self._objects = BakedObjects(device)
        self._live: dict[Hashable, Live] = {}
        self._answered: dict[Hashable, tuple] = {}  # by Instance.key: what its light was worked out for
        self._surroundings = Surroundings(np.zeros(3))
        self._revision = -1  # of the environment that these are
        self._drawn: list[BakedObject] = []
        self._up_to_date: tuple = ()
        self._lobe = ""  # of which the GPU has the table
        self._lit: list[Instance] = []
        self._shown: dict[Hashable, tuple] = {}  # by Instance.key: of which coefficient there is a picture

    def update(self, gpu_scene: GpuScene, settings: Settings) -> bool:
        """Work out what has changed of the objects' light; whether there is any to draw."""
        wanted = settings.of("transfer")
        key = (gpu_scene.scene, gpu_scene.revision, wanted)
        if self._up_to_date == key:
            return bool(self._drawn)
        self._up_to_date = key
        scene = gpu_scene.scene
        lit = [i for i in scene.instances if i.transfer is not None and _is_lit(i)] if wanted["use"] else []
        if self._revision != gpu_scene.environment.revision:
            self._revision = gpu_scene.environment.revision
            world = scene.world
            self._surroundings = Surroundings(
                np.array(world.color) if world.graph is None else gpu_scene.environment.pixels
            )
            self._answered.clear()
        self._drawn = [self._object(scene, instance, wanted) for instance in lit]
        self._forget(lit)
        return bool(self._drawn)

    def draw(self, inputs: FrameInputs, targets: LightTargets, *, glossy: bool) -> None:
        """Add it to the direct targets, and mark its pixels for the techniques."""
        world = inputs.gpu_scene.environment
        self._objects.draw(inputs, self._drawn, targets, glossy=glossy, seen=(world.lights, world.mirrored))

    def view(self, inputs: FrameInputs, settings: Settings, target: Target) -> None:
        """Draw one coefficient of each bake into ``target`` (frame.views.TRANSFER)."""
        scene, objects = inputs.gpu_scene.scene, []
        numbers = int(settings["show_term"]), int(settings["show_result"])
        for instance in scene.instances:
            if instance.transfer is None or not instance.visibility & _SEEN:
                continue
            live, name = self._prepare(scene, instance), ("shown", instance.key)
            if self._shown.get(instance.key) != (instance.transfer, *numbers):
                self._shown[instance.key] = (instance.transfer, *numbers)
                self._objects.set_light(name, _signed(live.coefficient(*numbers)))
            place = (instance.mesh, name, instance.transfer, instance.world_from_object, np.eye(3))
            objects.append(self._objects.object(*place, bounces=live.bounces))
        self._objects.show(inputs, objects, target)

    def end_view(self) -> None:
        """Give back what a view made."""
        if self._shown:
            self._shown.clear()
            self._keep(self._lit)

    def free(self) -> None:
        self._objects.free()
        self._lobe = ""
        self._shown.clear()
        self._live.clear()
        self._answered.clear()
        self._drawn, self._up_to_date = [], ()

    def _object(self, scene: Scene, instance: Instance, settings: Mapping[str, Any]) -> BakedObject:
        live, frame = self._prepare(scene, instance), frame_of(instance.world_from_object)
        if live.look is Look.HARMONICS and self._lobe != settings["lobe"]:
            self._lobe = str(settings["lobe"])
            self._objects.set_lobes(lobe_table(self._lobe))
        question = (instance.transfer, frame.tobytes(), *(settings[name] for name in ("bands", "window", "terms")))
        if self._answered.get(instance.key) != question:
            answer = live.answer(
                self._surroundings, frame, int(settings["bands"]), float(settings["window"]), int(settings["terms"])
            )
            self._objects.set_light(instance.key, answer, live.look, live.views)
            self._answered[instance.key] = question
            self.updates += 1
        place = (instance.mesh, instance.key, instance.transfer, instance.world_from_object, frame)
        least = 0.0
        if live.look is Look.HARMONICS and settings["widen"]:
            least = least_roughness(LOBES[self._lobe], live.held(int(settings["bands"])))
        return self._objects.object(*place, bounces=live.bounces, least_roughness=least)

    def _prepare(self, scene: Scene, instance: Instance) -> Live:
        """Have the mesh on the GPU and the bake laid out."""
        mesh = scene.meshes[instance.mesh]
        if not self._objects.has_mesh(mesh.key):
            self._objects.add_mesh(mesh.key, mesh.positions, mesh_vertices(mesh)[1])
        if instance.transfer not in self._live:
            self._live[instance.transfer] = make_live(scene.transfers[instance.transfer])
        live = self._live[instance.transfer]
        if live.splits is not None and not self._objects.has_tree(instance.transfer):
            self._objects.add_tree(instance.transfer, tree(live.splits, mesh.triangle_count))
        return live

    def _forget(self, lit: list[Instance]) -> None:
        """Give back what is no longer drawn."""
        keys, transfers = {i.key for i in lit}, {i.transfer for i in lit}
        self._keep(lit)
        self._lit, self._shown = lit, {}
        self._answered = {key: question for key, question in self._answered.items() if key in keys}
        self._live = {key: live for key, live in self._live.items() if key in transfers}

    def _keep(self, lit: list[Instance]) -> None:
        self._objects.keep({i.mesh for i in lit}, {i.key for i in lit}, {i.transfer for i in lit})


def _is_lit(instance: Instance) -> bool:
    return bool(instance.visibility & _SEEN) and not instance.visibility & _NOT_LIT


def _signed(values: np.ndarray) -> np.ndarray:
    """(n, 1, 3) float32 colours of (n,) numbers: red above zero, blue below, full for the largest."""
    scaled = values / max(float(np.abs(values).max(initial=0.0)), 1e-12)
    return np.stack([np.maximum(scaled, 0), 0 * scaled, np.maximum(-scaled, 0)], axis=-1)[:, None].astype(np.float32)


def lobe_table(lobe: str) -> np.ndarray:
    """(views, LOBE_TEXELS roughnesses, 4): what prt_harmonics_frag.glsl reads of a lobe of bake.view_table.LOBES."""
    table = np.zeros((LOBES_SIDE, LOBES_SIDE, 4 * LOBE_TEXELS))
    steps = np.linspace(0.0, 1.0, LOBES_SIDE)
    for row, slant in enumerate(steps):
        found = weights(LOBES[lobe], LOBE_BANDS, steps.tolist(), 1.0 - slant * slant)[:, :, 1:]
        table[row, :, : found[0].size] = found.reshape(LOBES_SIDE, -1)
    return table.reshape(LOBES_SIDE, LOBE_TEXELS * LOBES_SIDE, 4)

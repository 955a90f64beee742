"""Draws: the names and kinds of what they are given are checked here, once for all backends."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .resources import DrawState, Target, Vertices, Viewport
from .shader import Shader

if TYPE_CHECKING:
    from .interface import Device


class Program:
    """A compiled shader: ``setters`` take the value of each declared resource by name."""

    def __init__(self, shader: Shader, handle: Any):
        self.shader, self.handle = shader, handle
        self.setters: dict[str, Callable[[Any], None]] = {}

    def set(self, values: Mapping[str, Any]) -> None:
        """Set resources. Raises TypeError or ValueError naming shader and resource."""
        name = ""
        try:
            for name, value in values.items():
                self.setters[name](value)
        except (TypeError, ValueError, AttributeError, OverflowError) as error:
            kind = ValueError if isinstance(error, ValueError | OverflowError) else TypeError
            raise kind(f"Shader {self.shader.name}, {name!r}: {error}") from error

    def check_names(self, given: Mapping[str, Any], wanted: Sequence[str]) -> None:
        """Raise TypeError unless exactly the wanted names are given."""
        missing = [n for n in wanted if n not in given]
        unknown = [n for n in given if n not in wanted]
        if missing or unknown:
            parts = [
                f"{what} {', '.join(names)}" for what, names in (("missing", missing), ("unknown", unknown)) if names
            ]
            raise TypeError(f"Shader {self.shader.name}: {'; '.join(parts)}")


class Drawing:
    """Many draws with one shader into one target: what ``Device.drawing`` gives.

    A call sets only the resources that were not given to ``drawing``, and its check of names is one set comparison: a
    draw costs a few microseconds of Python.
    """

    def __init__(
        self,
        device: Device,
        shader: Shader,
        target: Target | None,
        state: DrawState,
        viewport: Viewport | None,
        shared: Mapping[str, Any],
    ):
        self._device, self._target, self._state, self._viewport = device, target, state, viewport
        self._program = program = device._program(shader)
        if shader.compute:
            raise TypeError(f"Shader {shader.name}: a compute shader cannot draw")
        unknown = [n for n in shared if n not in program.setters]
        if unknown:
            raise TypeError(f"Shader {shader.name}: unknown {', '.join(unknown)}")
        if target is not None:
            _check_target(shader, target, state, shared)
        if viewport is not None and min(viewport[2:]) < 1:
            raise ValueError(f"Shader {shader.name}: the viewport {tuple(viewport)} is empty")
        self._shared = shared
        self._rest = {n: None for n in program.setters if n not in shared}.keys()

    def __enter__(self) -> Drawing:
        self._device._check_idle(self._program.shader)
        self._device._busy = self._program.shader
        try:
            self._device._begin(self._program, self._target, self._state, self._viewport)
            self._program.set(self._shared)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_error: object) -> None:
        self._device._busy = None
        self._device._end(self._program, self._target)

    def __call__(
        self,
        vertices: Vertices | None = None,
        count: int | None = None,
        instances: int = 1,
        *,
        paired: bool = False,
        **resources: Any,
    ) -> None:
        """Draw all of ``vertices`` ``instances`` times; gl_InstanceID counts from 0.

        None: no attributes, ``count`` corners (3 unless given) known by gl_VertexID alone. ``paired``, of one instance:
        of six corners the fourth is the first and the fifth is the third, so that nobody need be asked for them.
        """
        program = self._program
        if resources.keys() != self._rest:
            program.check_names(resources, tuple(self._rest))
        program.set(resources)
        if vertices is None:
            if program.shader.inputs:
                raise TypeError(f"Shader {program.shader.name}: needs vertices with {', '.join(program.shader.inputs)}")
            count = 3 if count is None else count
        else:
            if program not in vertices.cache:
                _check_inputs(program.shader, vertices)
            if count is not None:
                raise ValueError(f"Shader {program.shader.name}: vertices are drawn whole, count is for draws without")
            count = vertices.count
        if count % 3:
            raise ValueError(f"Shader {program.shader.name}: {count} corners are not whole triangles")
        if paired and (vertices is not None or instances != 1):
            raise ValueError(f"Shader {program.shader.name}: paired triangles are for one instance without vertices")
        if count and instances:
            self._device._draw(program, vertices, count, instances, paired)


def _check_inputs(shader: Shader, vertices: Vertices) -> None:
    for name, type_name in shader.inputs.items():
        if name not in vertices.layout:
            raise TypeError(
                f"Shader {shader.name}: the vertices have no {name}; they have {', '.join(vertices.layout)}"
            )
        scalar, components = vertices.layout[name]
        wanted = ("F" if type_name[0] in "FV" else type_name[0], int(type_name[-1]) if type_name[-1].isdigit() else 1)
        if (scalar, components) != wanted:
            raise TypeError(
                f"Shader {shader.name}: input {name} is {type_name}, its array is {scalar}32 x {components}"
            )


def _check_target(shader: Shader, target: Target, state: DrawState, resources: Mapping[str, Any]) -> None:
    if target.is_freed:
        raise ValueError(f"Shader {shader.name}: the target or a texture of it was freed")
    if len(shader.outputs) > len(target.colors):
        raise TypeError(
            f"Shader {shader.name}: {len(shader.outputs)} outputs, the target has {len(target.colors)} colours"
        )
    for (name, type_name), texture in zip(shader.outputs.items(), target.colors, strict=False):
        scalar = {"I": "INT", "U": "UINT"}.get(type_name[0], "FLOAT")
        if texture.info.scalar != scalar:
            raise TypeError(f"Shader {shader.name}: output {name} is {type_name}, its texture is {texture.format}")
    if state.depth_test != "NONE" and target.depth is None:
        raise TypeError(f"Shader {shader.name}: a depth test needs a target with depth")
    written = (*target.colors, target.depth) if state.depth_write else target.colors
    for name in shader.samplers:
        # Reading what is being written is undefined everywhere and looks right on some.
        if name in resources and any(resources[name] is texture for texture in written):
            raise TypeError(f"Shader {shader.name}: {name} is part of the target that it draws into")

"""A shader declared once, in Python: its stages, resources and constants. The GLSL files hold mathematics only.

The same declaration is compiled by the Blender device (blender.py) and the standalone one (headless.py); this module
imports neither. The limits checked here are those of Blender's gpu module, the narrower of the two.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType

from . import standalone
from .names import is_name
from .source import ShaderError, Source, assemble
from .structs import Struct

__all__ = ["CONSTANT_TYPES", "Image", "Shader", "ShaderError", "Source", "Struct"]

# Blender's limits. More than 8 images corrupt memory without an error; see also GPU specification minima.
MAX_IMAGES = 8
MAX_OUTPUTS = 6
MAX_SAMPLERS = 32
MAX_UNIFORMS = 14
MAX_INPUTS = 16
MAX_UNIFORM_BYTES = 65536
MAX_CONSTANT_BYTES = 128
MAX_LOCAL_SIZE = 1024

# type: (components, bytes of alignment in a push constant block)
CONSTANT_TYPES = {
    "FLOAT": (1, 4),
    "INT": (1, 4),
    "VEC2": (2, 8),
    "IVEC2": (2, 8),
    "VEC3": (3, 16),
    "VEC4": (4, 16),
    "MAT4": (16, 16),
}
VARYING_TYPES = ("FLOAT", "VEC2", "VEC3", "VEC4", "INT", "UINT", "IVEC2", "UVEC2", "IVEC4", "UVEC4")
INPUT_TYPES = ("FLOAT", "VEC2", "VEC3", "VEC4", "INT", "UINT", "IVEC2", "UVEC2", "IVEC3", "UVEC3", "IVEC4", "UVEC4")
OUTPUT_TYPES = ("FLOAT", "VEC2", "VEC3", "VEC4", "INT", "UINT", "IVEC2", "UVEC2", "IVEC4", "UVEC4")
_DIMENSIONS = ("2D", "3D")
SAMPLER_TYPES = tuple(f"{scalar}_{d}" for scalar in ("FLOAT", "INT", "UINT") for d in _DIMENSIONS)
IMAGE_TYPES = SAMPLER_TYPES + tuple(f"{scalar}_{d}_ATOMIC" for scalar in ("INT", "UINT") for d in _DIMENSIONS)
IMAGE_FORMATS = ("RGBA32F", "RGBA16F", "RG32F", "RG16F", "R32F", "R16F", "RGBA8", "RG8", "R8", "R32UI", "R32I")


@dataclass(frozen=True)
class Image:
    """An image that a shader loads from or stores to: ``Image("RGBA16F", "FLOAT_3D", "WRITE")``.

    Atomics need R32UI or R32I and a type that ends in ``_ATOMIC``.
    """

    format: str
    type: str
    access: str = "READ_WRITE"

    def __post_init__(self):
        for what, value, allowed in (
            ("format", self.format, IMAGE_FORMATS),
            ("type", self.type, IMAGE_TYPES),
            ("access", self.access, ("READ", "WRITE", "READ_WRITE")),
        ):
            if value not in allowed:
                raise ValueError(f"Image: {what} {value!r} is none of {', '.join(allowed)}")
        scalar = {"UI": "UINT", "2I": "INT"}.get(self.format[-2:], "FLOAT")
        if not self.type.startswith(scalar + "_"):
            raise ValueError(f"Image: format {self.format} does not go with type {self.type}")


def _frozen() -> Mapping:
    return field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, eq=False)
class Shader:
    """One program and all it is given. Names in ``samplers``, ``images``, ``uniforms`` and ``constants`` are the
    keyword arguments of ``Device.draw`` and ``Device.dispatch``.

    Two shaders with the same contents are equal and share one compiled program. Raises ValueError, naming the shader,
    for a declaration that some supported Blender could not run.
    """

    name: str
    #: Path below gpu_shaders/. Without it, a fragment shader is drawn by the built-in full-screen triangle, which
    #: gives it ``vec2 uv`` in [0, 1].
    vertex: str = ""
    #: Without it, a vertex shader writes depth only.
    fragment: str = ""
    compute: str = ""
    local_size: tuple[int, int, int] = (8, 8, 1)
    #: Vertex attributes: {"in_position": "VEC3"}.
    inputs: Mapping[str, str] = _frozen()
    #: {"v_position": "VEC3"}; "flat INT" is not interpolated and takes the value of the triangle's last vertex.
    varyings: Mapping[str, str] = _frozen()
    #: Fragment outputs in slot order: {"out_color": "VEC4"}.
    outputs: Mapping[str, str] = _frozen()
    #: {"flux_tx": "FLOAT_2D"}; depth textures are read as FLOAT_2D.
    samplers: Mapping[str, str] = _frozen()
    images: Mapping[str, Image] = _frozen()
    #: Uniform blocks: {"frame": FRAME} makes ``frame.exposure`` readable.
    uniforms: Mapping[str, Struct] = _frozen()
    #: Structs whose GLSL (with its table fetch function) is put ahead of the source.
    structs: tuple[Struct, ...] = ()
    #: Push constants, 128 bytes in all: {"pc_gain": "FLOAT"}. The prefix is needed: Vulkan up to Blender 5.0 makes
    #: macros of the names.
    constants: Mapping[str, str] = _frozen()
    defines: tuple[tuple[str, str], ...] = ()
    #: The fragment shader writes gl_FragDepth.
    depth_write: bool = False
    #: Generated GLSL files, path to text, that stand in front of gpu_shaders/ (material code; tests).
    files: Mapping[str, str] = _frozen()
    _key: tuple = field(init=False, repr=False)
    _hash: int = field(init=False, repr=False)

    def __post_init__(self):
        key = []
        for f in fields(self):
            if not f.init:
                continue
            value = getattr(self, f.name)
            if isinstance(value, Mapping):
                value = MappingProxyType(dict(value))
                object.__setattr__(self, f.name, value)
                value = tuple(value.items())
            elif isinstance(value, list):
                value = tuple(value)
                object.__setattr__(self, f.name, value)
            key.append(value)
        object.__setattr__(self, "_key", tuple(key))
        object.__setattr__(self, "_hash", hash(self._key))
        self._validate()

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, Shader) and self._key == other._key)

    def __repr__(self) -> str:
        return f"Shader({self.name!r})"

    # --- what it is --------------------------------------------------------------------------------------------------

    @property
    def stages(self) -> tuple[str, ...]:
        """("compute",) or ("vertex", "fragment")."""
        return ("compute",) if self.compute else ("vertex", "fragment")

    @property
    def is_fullscreen(self) -> bool:
        """Whether the built-in full-screen triangle draws it."""
        return bool(self.fragment) and not self.vertex

    @property
    def all_varyings(self) -> dict[str, tuple[str, str]]:
        """Varyings including the built-in ``uv``: name to ("smooth" or "flat", type)."""
        given = {"uv": "VEC2"} if self.is_fullscreen else self.varyings
        return {n: ("flat", t[5:]) if t.startswith("flat ") else ("smooth", t) for n, t in given.items()}

    @property
    def all_structs(self) -> tuple[Struct, ...]:
        """Table and uniform structs, each once."""
        return tuple(dict.fromkeys((*self.uniforms.values(), *self.structs)))

    # --- source ------------------------------------------------------------------------------------------------------

    def assemble(self, stage: str) -> Source:
        """The body of a stage ("vertex", "fragment", "compute") with includes resolved, ahead of it the fetch functions
        of ``structs``; without any declaration. Raises ShaderError."""
        if stage not in self.stages:
            raise ShaderError(self.name, stage, "the shader has no such stage")
        source = Source()
        source.add("".join(struct.glsl_fetch() + "\n" for struct in self.structs), "<structs>")
        path = getattr(self, stage)
        if path:
            source.extend(assemble(self.name, stage, path, self.files))
        elif stage == "vertex":
            source.add(standalone.FULLSCREEN_VERTEX, "<full-screen triangle>")
        else:
            source.add("void main() {}", "<depth only>")
        return source

    def source(self, stage: str) -> str:
        """The text of ``assemble``."""
        return self.assemble(stage).text

    def standalone(self, stage: str) -> Source:
        """A complete GLSL 4.30 core text of one stage."""
        return standalone.complete(self, stage)

    def standalone_sources(self) -> dict[str, str]:
        """Complete GLSL 4.30 core texts, for moderngl and glslangValidator: {"vert", "frag"} or {"comp"}."""
        return {stage[:4]: self.standalone(stage).text for stage in self.stages}

    # --- validation --------------------------------------------------------------------------------------------------

    def _validate(self) -> None:
        self._require(
            bool(re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", self.name)), "the name must be lower_snake_case"
        )
        self._validate_stages()
        self._validate_types()
        self._validate_limits()
        self._validate_names()

    def _require(self, condition: bool, message: str) -> None:
        if not condition:
            raise ValueError(f"Shader {self.name}: {message}")

    def _validate_stages(self) -> None:
        drawn = self.vertex or self.fragment
        self._require(bool(self.compute) != bool(drawn), "give either compute, or vertex and fragment")
        if self.compute:
            for what in ("inputs", "varyings", "outputs"):
                self._require(not getattr(self, what), f"a compute shader has no {what}")
            x, y, z = self.local_size
            self._require(
                min(x, y, z) >= 1 and x * y * z <= MAX_LOCAL_SIZE, f"local_size {self.local_size} is not valid"
            )
        if self.is_fullscreen:
            self._require(not self.inputs and not self.varyings, "the full-screen triangle has no inputs or varyings")
        if not self.fragment:
            self._require(not self.outputs, "outputs need a fragment shader")

    def _validate_types(self) -> None:
        for what, allowed in (
            ("inputs", INPUT_TYPES),
            ("outputs", OUTPUT_TYPES),
            ("samplers", SAMPLER_TYPES),
            ("constants", tuple(CONSTANT_TYPES)),
        ):
            for name, type_name in getattr(self, what).items():
                hint = "; use INT" if type_name in ("BOOL", "UINT") else ""
                self._require(type_name in allowed, f"{what} {name!r}: unknown type {type_name!r}{hint}")
        for name, type_name in self.varyings.items():
            base = type_name.removeprefix("flat ")
            self._require(base in VARYING_TYPES, f"varyings {name!r}: unknown type {type_name!r}")
            self._require(base[0] in "FV" or type_name != base, f"varyings {name!r}: integers must be flat")
        for name, image in self.images.items():
            self._require(isinstance(image, Image), f"images {name!r}: not an Image")
        for struct in (*self.uniforms.values(), *self.structs):
            self._require(isinstance(struct, Struct), f"{struct!r} is not a Struct")
        names = [s.name for s in self.all_structs]
        self._require(len(set(names)) == len(names), f"two structs have one name: {names}")

    def _validate_limits(self) -> None:
        for what, limit in (
            ("images", MAX_IMAGES),
            ("outputs", MAX_OUTPUTS),
            ("samplers", MAX_SAMPLERS),
            ("uniforms", MAX_UNIFORMS),
            ("inputs", MAX_INPUTS),
        ):
            count = len(getattr(self, what))
            self._require(count <= limit, f"{count} {what}; at most {limit}")
        for name, struct in self.uniforms.items():
            self._require(struct.size <= MAX_UNIFORM_BYTES, f"uniforms {name!r}: {struct.size} bytes; at most 64 KiB")
        size = constant_bytes(self.constants)
        self._require(size <= MAX_CONSTANT_BYTES, f"{size} bytes of constants; at most {MAX_CONSTANT_BYTES}")

    def _validate_names(self) -> None:
        seen: dict[str, str] = {}
        for what in ("inputs", "outputs", "samplers", "images", "uniforms", "constants"):
            for name in getattr(self, what):
                self._validate_name(what, name, seen)
        for name in self.all_varyings:
            self._validate_name("varyings", name, seen)
        for struct in self.all_structs:
            self._require(struct.name not in seen, f"{struct.name!r} is a struct and in {seen.get(struct.name)}")
        for name in self.constants:
            self._require(name.startswith("pc_"), f"constants {name!r}: the name must begin with pc_")
        for name, _value in self.defines:
            self._require(name not in seen, f"{name!r} is a define and in {seen.get(name)}")

    def _validate_name(self, what: str, name: str, seen: dict[str, str]) -> None:
        self._require(is_name(name), f"{what}: {name!r} cannot be a name in GLSL")
        self._require(name not in seen, f"{name!r} is in {what} and in {seen.get(name)}")
        seen[name] = what


def constant_bytes(constants: Mapping[str, str]) -> int:
    """The bytes of a push constant block by the rules of std430."""
    end = 0
    for type_name in constants.values():
        components, alignment = CONSTANT_TYPES[type_name]
        end = -(-end // alignment) * alignment + components * 4
    return end

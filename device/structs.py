"""A struct written once: the numpy bytes and the GLSL that reads them.

A ``Struct`` is packed in declaration order into whole vec4 texels, by the rules of std140 (source: OpenGL 4.6
specification, section 7.6.2.2): a vec2 starts on 8 bytes, a vec3, vec4 or mat4 on 16, and a float or int may follow a
vec3 in the same texel. So one layout serves both ways to the GPU:

- a table: an RGBA32F texture, one row an element, read by the generated ``<name>_fetch(table_tx, index)``; after
  ``MAX_TABLE_ROWS`` elements the next ones stand beside the first (``table_texels``);
- a uniform block: the same bytes in a uniform buffer.

They differ in one thing: a table holds an int as its *value* in a float (exact to 2**24), a uniform block as int bits.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .names import is_name

TEXEL_BYTES = 16
# Every Vulkan device takes so many rows, and every OpenGL of Blender's more. A power of two: the shader divides by it.
MAX_TABLE_ROWS = 4096
MAX_EXACT_INT = 2**24

# type: (floats, alignment in floats)
_TYPES = {"float": (1, 1), "int": (1, 1), "vec2": (2, 2), "vec3": (3, 4), "vec4": (4, 4), "mat4": (16, 4)}


@dataclass(frozen=True)
class Field:
    """One member: ``offset`` counts floats from the start of the struct, ``floats`` is its length."""

    name: str
    type: str
    offset: int
    floats: int

    @property
    def shape(self) -> tuple[int, ...]:
        """The numpy shape of one value."""
        if self.type == "mat4":
            return (4, 4)
        return () if self.floats == 1 else (self.floats,)


class Struct:
    """A named list of members, e.g. ``Struct("Light", position="vec3", kind="int", shadow_from_world="mat4")``.

    Types: float, int, vec2, vec3, vec4, mat4. Raises ValueError for an unknown type or a name GLSL would refuse.
    """

    def __init__(self, name: str, **fields: str):
        if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", name):
            raise ValueError(f"Struct {name!r}: the name must be CamelCase")
        if not fields:
            raise ValueError(f"Struct {name}: has no fields")
        self.name = name
        self.fields = tuple(_lay_out(name, fields))
        end = self.fields[-1].offset + self.fields[-1].floats
        #: Number of vec4 texels of one element.
        self.texels = -(-end // 4)
        self._key = (name, tuple(fields.items()))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Struct) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def __repr__(self) -> str:
        return f"Struct({self.name!r}, {', '.join(f'{f.name}={f.type!r}' for f in self.fields)})"

    @property
    def size(self) -> int:
        """Bytes of one element."""
        return self.texels * TEXEL_BYTES

    @property
    def snake_name(self) -> str:
        """The name in lower_snake_case, the prefix of the generated functions."""
        return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", self.name).lower()

    # --- numpy -------------------------------------------------------------------------------------------------------

    @cached_property
    def dtype(self) -> np.dtype:
        """The structured dtype of a table row; a mat4 member is (4, 4) and holds the matrix's *columns* as its rows."""
        return self._dtype(np.float32)

    @cached_property
    def uniform_dtype(self) -> np.dtype:
        """The same layout with ints as int32: the bytes of a uniform block."""
        return self._dtype(np.int32)

    def _dtype(self, int_type: type) -> np.dtype:
        formats = [(int_type if f.type == "int" else np.float32, f.shape) for f in self.fields]
        return np.dtype(
            {
                "names": [f.name for f in self.fields],
                "formats": formats,
                "offsets": [f.offset * 4 for f in self.fields],
                "itemsize": self.size,
            }
        )

    def pack(self, rows: Sequence[Mapping], *, for_uniform: bool = False) -> np.ndarray:
        """Pack one mapping an element, field name to value. A mat4 is given as it is written: (4, 4), row by row.

        Returns (n, texels, 4) float32. For a uniform block (``for_uniform``) ints are stored as their bits.
        Raises ValueError naming struct and field for a missing, unknown or misshapen one.
        """
        for row in rows:
            self._check_names(row)
        columns = {f.name: self._column(f, [row[f.name] for row in rows]) for f in self.fields}
        return self.pack_arrays(len(rows), for_uniform=for_uniform, **columns)

    def pack_arrays(self, count: int, *, for_uniform: bool = False, **columns: np.ndarray) -> np.ndarray:
        """The same from one array a field, each (count, ...), or a single value for all. Quick for many elements."""
        self._check_names(columns)
        packed = np.zeros(count, self.uniform_dtype if for_uniform else self.dtype)
        for field in self.fields:
            values = np.asarray(columns[field.name])
            if values.shape not in ((count, *field.shape), field.shape):
                raise ValueError(
                    f"Struct {self.name}, field {field.name!r}: expected shape {field.shape} "
                    f"or {(count, *field.shape)}, got {values.shape}"
                )
            if field.type == "mat4":
                values = values.swapaxes(-1, -2)  # GLSL stores columns
            if field.type == "int":
                self._check_ints(field, values, for_uniform)
            packed[field.name] = values
        return packed.view(np.float32).reshape(count, self.texels, 4)

    def _column(self, field: Field, values: list) -> np.ndarray:
        try:
            column = np.array(values, dtype=None if field.type == "int" and values else np.float32)
        except (TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"Struct {self.name}, field {field.name!r}: {error}") from None
        if not values:
            return column.reshape(0, *field.shape)
        return column

    def _check_names(self, names: Mapping) -> None:
        wanted = [f.name for f in self.fields]
        for problem, found in (
            ("missing", [n for n in wanted if n not in names]),
            ("unknown", [n for n in names if n not in wanted]),
        ):
            if found:
                raise ValueError(f"Struct {self.name}: {problem} field(s) {', '.join(map(repr, found))}")

    def _check_ints(self, field: Field, values: np.ndarray, for_uniform: bool) -> None:
        if not values.size:
            return
        if values.dtype.kind not in "iub":
            raise ValueError(f"Struct {self.name}, field {field.name!r}: expected integers, got {values.dtype}")
        bound = 2**31 - 1 if for_uniform else MAX_EXACT_INT
        if np.abs(values.astype(np.int64)).max() > bound:
            raise ValueError(f"Struct {self.name}, field {field.name!r}: a value is beyond +-{bound}")

    # --- GLSL --------------------------------------------------------------------------------------------------------

    def glsl_struct(self, vec3: str = "vec3") -> str:
        """The GLSL struct, padding written out, on one line.

        ``vec3`` is the spelling of that type: Metal needs its packed form to let a scalar follow it within 16 bytes.
        """
        members, end = [], 0
        for field in (*self.fields, None):
            start = field.offset if field else self.texels * 4
            members += [f"float pad_{i};" for i in range(end, start)]
            if field:
                members.append(f"{vec3 if field.type == 'vec3' else field.type} {field.name};")
                end = field.offset + field.floats
        return f"struct {self.name} {{ {' '.join(members)} }};"

    def glsl_fetch(self) -> str:
        """The GLSL function ``Name name_fetch(sampler2D table_tx, int index)``, on one line. It needs the struct."""
        texels = "".join(
            f" vec4 t{k} = texelFetch(table_tx, ivec2(at.x + {k}, at.y), 0);"
            for k in sorted({t for f in self.fields for t in range(f.offset // 4, (f.offset + f.floats - 1) // 4 + 1)})
        )
        members = "".join(f" e.{f.name} = {_from_texels(f)};" for f in self.fields)
        return (
            f"{self.name} {self.snake_name}_fetch(sampler2D table_tx, int index) "
            f"{{ ivec2 at = ivec2(index / {MAX_TABLE_ROWS} * {self.texels}, index % {MAX_TABLE_ROWS});"
            f"{texels} {self.name} e;{members} return e; }}"
        )


def table_texels(packed: np.ndarray) -> np.ndarray:
    """The texels of a table from what ``Struct.pack`` made, (n, texels, 4): one to MAX_TABLE_ROWS rows."""
    count, texels = packed.shape[:2]
    rows = min(max(count, 1), MAX_TABLE_ROWS)
    columns = -(-max(count, 1) // rows)
    padded = np.zeros((columns * rows, texels, 4), np.float32)
    padded[:count] = packed
    return np.ascontiguousarray(padded.reshape(columns, rows, texels, 4).swapaxes(0, 1)).reshape(rows, -1, 4)


def _lay_out(struct: str, fields: Mapping[str, str]) -> list[Field]:
    """Give each member its std140 offset."""
    laid_out, end = [], 0
    for name, type_name in fields.items():
        if type_name not in _TYPES:
            raise ValueError(f"Struct {struct}, field {name!r}: unknown type {type_name!r}; one of {', '.join(_TYPES)}")
        if not is_name(name) or name.startswith("pad_"):
            raise ValueError(f"Struct {struct}: a field cannot be named {name!r}")
        floats, alignment = _TYPES[type_name]
        offset = -(-end // alignment) * alignment
        laid_out.append(Field(name, type_name, offset, floats))
        end = offset + floats
    return laid_out


def _from_texels(field: Field) -> str:
    """The expression that takes a member out of the texels t0, t1, ..."""
    texel, lane = divmod(field.offset, 4)
    if field.type == "mat4":
        return f"mat4({', '.join(f't{texel + k}' for k in range(4))})"
    value = f"t{texel}" + ("" if field.floats == 4 else "." + "xyzw"[lane : lane + field.floats])
    return f"int({value})" if field.type == "int" else value

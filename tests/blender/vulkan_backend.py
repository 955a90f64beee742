"""TEST ONLY: make the bpy wheel use Vulkan.

The wheel ignores the `gpu_backend` preference and has no command line, but it is not stripped: this calls
`GPU_backend_type_selection_set` and `GPU_backend_type_selection_set_override` by their addresses, before anything has
used the GPU. Without the override, loading factory settings goes back to OpenGL. Linux, ELF64, little endian.
"""

from __future__ import annotations

import ctypes
import mmap
import struct
from collections.abc import Iterator
from pathlib import Path

_SYMBOL = b"GPU_backend_type_selection_set"
_GPU_BACKEND_VULKAN = 8  # eGPUBackendType in Blender's GPU_platform_backend_enum.h
_SECTION_IS_SYMBOLS = 2  # SHT_SYMTAB
_SYMBOL_BYTES = 24


def select_vulkan() -> None:
    """Ask the loaded bpy for its Vulkan backend. Raises RuntimeError when the wheel has no such symbol."""
    library, base = _loaded_library()
    with open(library, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as image:
        addresses = list(_symbol_addresses(image))
    if not addresses:
        raise RuntimeError(f"{_SYMBOL.decode()} is not in the symbol table of {library}")
    for address in addresses:
        ctypes.CFUNCTYPE(None, ctypes.c_int)(base + address)(_GPU_BACKEND_VULKAN)


def _loaded_library() -> tuple[Path, int]:
    """The bpy shared library of this process and the lowest address it is mapped at."""
    mappings = [line.split() for line in Path("/proc/self/maps").read_text().splitlines()]
    ours = [fields for fields in mappings if fields[-1].endswith("/bpy/__init__.so")]
    if not ours:
        raise RuntimeError("bpy is not loaded as a shared library in this process")
    return Path(ours[0][-1]), min(int(fields[0].split("-")[0], 16) for fields in ours)


def _symbol_tables(image: mmap.mmap) -> Iterator[tuple[int, int, int]]:
    """(offset, symbol count, offset of the names) of each symbol table."""
    (sections_at,) = struct.unpack_from("<Q", image, 0x28)
    section_bytes, section_count = struct.unpack_from("<HH", image, 0x3A)
    sections = [struct.unpack_from("<IIQQQQIIQQ", image, sections_at + i * section_bytes) for i in range(section_count)]
    for _, kind, _, _, offset, size, names_section, *_ in sections:
        if kind == _SECTION_IS_SYMBOLS:
            yield offset, size // _SYMBOL_BYTES, sections[names_section][4]


def _symbol_addresses(image: mmap.mmap) -> Iterator[int]:
    """C++ names are mangled, so they are found by what they contain; compilers also emit a `.cold` part of each."""
    for offset, count, names_at in _symbol_tables(image):
        for name_at, _, _, _, value, _ in struct.iter_unpack("<IBBHQQ", image[offset : offset + count * _SYMBOL_BYTES]):
            start = names_at + name_at
            if (
                value
                and _SYMBOL in image[start : start + 64]
                and b".cold" not in image[start : image.find(b"\0", start)]
            ):
                yield value

"""The random number of an object, as Cycles has it for Object Info and its kin."""

from __future__ import annotations

WORD = 0xFFFFFFFF


def object_random(instance) -> float:
    """The number of a depsgraph's instance, 0..1. Blender gives one to instances only; an object's is its name's."""
    # Signed in Blender 4.5.
    number = instance.random_id & WORD if instance.is_instance else _hashed(_of_text(instance.object.name), 0)
    return number / WORD


def _of_text(text: str) -> int:
    """Cycles' hash_string()."""
    found = 0
    for byte in text.encode():
        found = (found * 37 + byte) & WORD
    return found


def _hashed(x: int, y: int) -> int:
    """Bob Jenkins' hash of two words (lookup3.c, final), as Cycles' hash_uint2()."""
    start = 0xDEADBEEF + (2 << 2) + 13
    a, b, c = (start + x) & WORD, (start + y) & WORD, start & WORD
    for turn_c, turn_a, turn_b in ((14, 11, 25), (16, 4, 14)):
        c = ((c ^ b) - _turned(b, turn_c)) & WORD
        a = ((a ^ c) - _turned(c, turn_a)) & WORD
        b = ((b ^ a) - _turned(a, turn_b)) & WORD
    return ((c ^ b) - _turned(b, 24)) & WORD


def _turned(word: int, bits: int) -> int:
    return ((word << bits) | (word >> (32 - bits))) & WORD

"""Whether two scenes are the same to the last bit: what a snapshot has to keep."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from enum import Enum

import numpy as np


def assert_same(a, b, place="scene"):
    """Both have the same types, bits and order throughout; ``place`` says where they do not."""
    assert type(a) is type(b), place
    if isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), place
    elif isinstance(a, Enum):
        assert a is b or a == b, place
    elif is_dataclass(a):
        for entry in fields(a):
            assert_same(getattr(a, entry.name), getattr(b, entry.name), f"{place}.{entry.name}")
    elif isinstance(a, dict):
        assert list(map(repr, a)) == list(map(repr, b)), place
        for (key, item), other in zip(a.items(), b.values(), strict=True):
            assert_same(item, other, f"{place}[{key!r}]")
    elif isinstance(a, tuple):
        assert len(a) == len(b), place
        for i, (item, other) in enumerate(zip(a, b, strict=True)):
            assert_same(item, other, f"{place}[{i}]")
    else:
        assert repr(a) == repr(b), place  # tells -0.0 from 0.0 and takes NaN for itself

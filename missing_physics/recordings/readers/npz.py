"""NPZ: NumPy arrays by name; never a pickle. Noise and resolution stand in ``noise/NAME`` and
``resolution/NAME``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.raw import Raw, Want
from missing_physics.recordings.readers.base import flattened_records, reading
from robot_model import InputError

__all__ = ["NOISE", "RESOLUTION", "SUFFIXES", "read"]

SUFFIXES = (".npz",)
NOISE = "noise/"
RESOLUTION = "resolution/"


def read(path: Path, *, want: Want) -> Raw:
    """The arrays of an NPZ file. Raises `InputError` when it is damaged or holds Python objects."""
    found: dict[str, NDArray[Any]] = {}
    known: dict[str, dict[str, float]] = {NOISE: {}, RESOLUTION: {}}
    with reading(path, "NPZ"), np.load(path, allow_pickle=False) as file:
        if not isinstance(file, np.lib.npyio.NpzFile):
            raise InputError(f"{path} is a single array, not an NPZ archive of named arrays.")
        for name in file.files:
            kind = next((prefix for prefix in known if name.startswith(prefix)), None)
            if kind is not None:
                known[kind][name.removeprefix(kind)] = float(file[name])
            elif want(name):
                found |= flattened_records(name, file[name])
        names = tuple(
            dict.fromkeys([n for n in file.files if not n.startswith((NOISE, RESOLUTION))] + list(found))
        )
        return Raw(str(path), found, names, noise=known[NOISE], resolution=known[RESOLUTION])
    raise AssertionError("unreachable: reading() raises")

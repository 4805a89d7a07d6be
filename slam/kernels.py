"""Compilation of the inner loops, with a cache that cannot be stale.

numba notices a change of the file a kernel stands in, not of the functions it calls in other
files. The cache is therefore kept under a name made from the text of this whole room and its parts.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., object])


def kernel(function: Function) -> Function:
    """The function compiled by numba on its first call, and from the cache in later processes.

    Products and sums may be contracted (fused multiply-add) but never reordered.
    """
    return _compiled(function, "never")


def inlined(function: Function) -> Function:
    """A kernel that becomes part of those that call it.

    For inner functions that are given many arrays: numba counts the references of each at every
    call, which costs more than such a function does.
    """
    return _compiled(function, "always")


def _compiled(function: Function, inline: Literal["never", "always"]) -> Function:
    settings = vars(numba.config)
    before = settings["CACHE_DIR"]
    settings["CACHE_DIR"] = before or str(cache_folder())
    try:
        compiled = numba.njit(
            cache=True, fastmath={"contract"}, error_model="numpy", inline=inline
        )(function)
    finally:
        settings["CACHE_DIR"] = before
    return cast(Function, compiled)


def cache_folder() -> Path:
    """Where compiled kernels of exactly this source are kept; `NUMBA_CACHE_DIR` overrides it."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "trackside" / f"kernels-{_SOURCE_HASH}"


def _source_hash() -> str:
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


_SOURCE_HASH = _source_hash()


@kernel
def wrapped(angle_rad: float) -> float:
    """The same direction in [-pi, pi]."""
    return angle_rad - 2.0 * math.pi * math.floor(angle_rad / (2.0 * math.pi) + 0.5)

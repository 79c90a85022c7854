"""Finished chunks of a sweep on disk, so that one that was killed goes on where it stood.

A chunk lies under a name computed from all that decides its numbers: trials, time limit and code. What is
found under a name therefore always belongs there, whatever was changed in between.
"""

import hashlib
import os
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray

from soro_lib.project import ROOT


@cache
def code_digest() -> str:
    """Sixteen hexadecimal digits that stand for the sources of this library and the versions beneath it."""
    digest = hashlib.sha256(f"numpy {np.__version__}, numba {numba.__version__}".encode())
    for path in sorted((ROOT / "soro_lib").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def chunk_path(folder: str | Path, inputs: Iterable[object]) -> Path:
    """Where the chunk computed from these inputs lies; their ``repr`` must tell them apart."""
    digest = hashlib.sha256()
    for given in inputs:
        digest.update(repr(given).encode() + b"\n")
    return Path(folder) / code_digest() / f"{digest.hexdigest()}.npy"


def read_chunk(path: Path) -> NDArray[np.float64] | None:
    """A finished chunk; None where there is none, or only a damaged file."""
    try:
        return np.load(path, allow_pickle=False)
    except (FileNotFoundError, ValueError, EOFError):
        return None


def write_chunk(path: Path, table: NDArray[np.float64]) -> None:
    """Write a chunk; it gets its name only when every byte is on the disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(f".{os.getpid()}.part")
    with unfinished.open("wb") as file:
        np.save(file, table)
        file.flush()
        os.fsync(file.fileno())
    unfinished.replace(path)

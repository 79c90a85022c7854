"""Where things lie: the only module that knows the folders of the project."""

import hashlib
import os
from functools import cache
from pathlib import Path

from soro_lib.moved import old_names

ROOT = Path(__file__).resolve().parent.parent
"""The checkout that this library is installed from."""


@cache
def slugs(root: Path = ROOT) -> tuple[str, ...]:
    """Return the short name of every paper, the same in all folders, in the order of their cards' numbers.

    A paper is a folder of ``data`` with a ``card.toml``.
    """
    import tomllib  # every import of the library comes past here

    cards = {path.parent.name: path.read_text(encoding="utf-8") for path in root.glob("data/*/card.toml")}
    return tuple(sorted(cards, key=lambda slug: tomllib.loads(cards[slug])["number"]))


def data_directory(slug: str) -> Path:
    """Return the folder of published numbers, equation index and recordings of one paper."""
    return ROOT / "data" / slug


def output_directory(slug: str) -> Path:
    """Return the folder that figures and tables of one notebook are written to.

    The runner names it in the environment variable ``SORO_OUTPUT``; a notebook opened by hand writes
    to ``build/lab/<slug>``, so that exploring never touches the committed figures.
    """
    directory = Path(os.environ.get("SORO_OUTPUT", ROOT / "build" / "lab" / slug))
    directory.mkdir(parents=True, exist_ok=True)
    return directory


def trials_directory() -> Path:
    """Return the folder that trials driven by hand are recorded to."""
    return ROOT / "build" / "trials"


def figures_directory(slug: str) -> Path:
    """Return the folder with the finished figures and tables of one notebook, for reading.

    The runner names the folder of the current run in ``SORO_FIGURES``; what that run has not produced is
    read from the committed ``figures/<slug>``.
    """
    current_run = Path(os.environ.get("SORO_FIGURES", ROOT / "figures")) / slug
    return current_run if current_run.is_dir() else ROOT / "figures" / slug


def compiled_code_directory() -> Path:
    """Return where numba keeps compiled code: one folder per state of all the sources it compiles.

    Numba itself watches only the file that a function stands in, not the files of the functions it calls, so
    an edited equation could go on running in its old form.
    """
    sources = (path.read_bytes() for path in sorted((ROOT / "soro_lib").rglob("*.py")))
    digest = hashlib.sha256(b"".join(source for source in sources if b"jit" in source)).hexdigest()
    return ROOT / "build" / "compiled" / digest[:16]


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


__getattr__ = old_names(__name__)

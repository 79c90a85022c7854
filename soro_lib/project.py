"""Where things lie: the only module that knows the folders of the project."""

import os
from pathlib import Path

SLUGS = ("gesture_steering", "shared_control", "visual_strain_fusion", "soft_handover")
"""One short name per paper, the same in notebooks, data, figures, studies and tests."""

ROOT = Path(__file__).resolve().parent.parent
"""The checkout that this library is installed from."""


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

"""Runs what fits a plant or simulates recordings: ``python -m soro_lib.workbook generate calibrations``.

A generator is a module that is run: it writes to ``data/<slug>``, or below another folder, in full or in its
small form (`soro_lib.replication.datacards.generator_options`).
"""

import re
import subprocess
import sys
from pathlib import Path

from soro_lib.project import ROOT

FILES = {"data": "recordings.py", "calibrations": "calibration.py"}
"""Name of the generators of each kind in the papers' rooms."""


class NothingToRun(LookupError):
    """No generator was found where there should be some."""


def generators(kind: str, root: Path = ROOT) -> dict[str, str]:
    """Return the slug that each generator of a kind, ``data`` or ``calibrations``, writes for, by module.

    Raises
    ------
    NothingToRun
        If there is none: their folder has been moved, or none can be run as a module any more.
    """
    rooms = root / "soro_lib" / "papers"
    found = {}
    for path in sorted(rooms.glob(f"*/{FILES[kind]}")):
        if re.search(r'^if __name__ == "__main__":', path.read_text(encoding="utf-8"), re.MULTILINE):
            found[".".join(path.relative_to(root).with_suffix("").parts)] = path.parent.name
    if not found:
        raise NothingToRun(f"nothing to run for {kind} in {rooms}; has it been moved?")
    return found


def generate(kind: str, output: Path | None = None, small: bool = False) -> int:
    """Run all generators of a kind, one after the other; stop at the first that fails.

    Parameters
    ----------
    kind
        ``data`` or ``calibrations``.
    output
        Folder that gets one folder per slug, in place of ``data``.
    small
        The small form, which takes seconds.

    Returns
    -------
    int
        Exit status of the last one.

    Raises
    ------
    NothingToRun
        If there is no generator.
    """
    for module, slug in generators(kind).items():
        print(module, flush=True)
        options = ["--small"] if small else []
        options += [] if output is None else ["--output", str(output / slug)]
        status = subprocess.run([sys.executable, "-m", module, *options], check=False).returncode
        if status:
            print(f"{module} failed", file=sys.stderr)
            return status
    return 0

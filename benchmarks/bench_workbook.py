"""A whole notebook with small parameters, the cheapest, against plain papermill: CPU time and peak memory.

Either side runs in a process of its own, with its kernel. The plain way sets by hand what the notebook must
be told, and nothing else: the parameter, the folders, small figures.
"""

import os
import sys
import tempfile
from pathlib import Path

from benchmarks.run import ROOT, Row, process_cost

SLUG = "cross_robot"


def rows() -> list[Row]:
    """Return the cost of the runner's start, and of a notebook with it and without it."""
    (notebook,) = (ROOT / "notebooks").glob(f"*_{SLUG}.ipynb")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        by_hand = {
            **environment,
            "SORO_OUTPUT": str(folder / "plain"),
            "SORO_QUICK": "1",
            "MPLBACKEND": "Agg",
            "IPYTHONDIR": str(folder / "ipython"),
        }
        run = [sys.executable, "-m", "soro_lib.workbook", "run", "--quick", "--only", SLUG]
        run += ["--output", str(folder / "ours")]
        papermill = [
            sys.executable,
            "-m",
            "papermill",
            "--kernel",
            "python3",
            "--parameters",
            "quick",
            "True",
        ]
        papermill += [str(notebook), str(folder / "plain.ipynb")]

        process_cost([*run, "--force"], folder, environment)  # compiles what is compiled and cached
        plain = process_cost(papermill, folder, by_hand)
        ours = process_cost([*run, "--force"], folder, environment)
        nothing = process_cost(run, folder, environment)
    cells = ("one notebook, small parameters", ours), ("workbook, nothing to do", nothing)
    return [
        Row(f"{what}, {kind}", value, unit, f"plain papermill: {peer:.3g} {unit}", peer / value)
        for what, cost in cells
        for kind, unit, value, peer in zip(("CPU time", "peak memory"), ("s", "MB"), cost, plain)
    ]

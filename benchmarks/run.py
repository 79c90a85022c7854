"""Measures speed against other libraries, all in one run, and prints the ratios: ``make bench``.

Every module ``benchmarks/bench_<theme>.py`` offers ``rows() -> list[Row]``. The ratios are what counts: both
sides are measured on the same machine within the same minute.
"""

import argparse
import importlib
import json
import os
import platform
import re
import subprocess
import sys
import timeit
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

# Before numpy is loaded: one thread on either side.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(variable, "1")

ROOT = Path(__file__).resolve().parent.parent
NOT_INSTALLED = "peer not installed"


@dataclass(frozen=True)
class Row:
    """One comparison.

    Parameters
    ----------
    name : str
        What is computed, such as ``tip pose, one at a time``.
    value : float
        What ours takes, or reaches.
    unit : str
        Unit of ``value``, such as ``us``.
    reference : str
        What it is compared with and what that takes, such as ``soromox 0.5.0: 38 us``.
    ratio : float or None
        How many times better ours is (above 1: ahead); None where there was nothing to compare with.
    goal : float or None
        The bound that ``value`` is to stay below, in ``unit``; None where there is none.
    """

    name: str
    value: float
    unit: str
    reference: str
    ratio: float | None = None
    goal: float | None = None


def seconds_per_call(call: Callable[[], Any], repeats: int = 5) -> float:
    """Return the best time of a call over several repeats, after a first call that is not counted [s]."""
    call()
    timer = timeit.Timer(call)
    number, _ = timer.autorange()
    return min(timer.repeat(repeats, number)) / number


def compare(
    name: str,
    ours: Callable[[], Any],
    peers: dict[str, Callable[[], Any] | None],
    unit: str = "us",
    goal: float | None = None,
) -> list[Row]:
    """Time a computation of ours and the same one of each peer; a peer that is None is not installed."""
    scale = {"s": 1.0, "ms": 1e3, "us": 1e6}[unit]
    value = seconds_per_call(ours) * scale
    rows = []
    for peer, call in peers.items():
        if call is None:
            rows.append(Row(name, value, unit, f"{peer}: {NOT_INSTALLED}", None, goal))
        else:
            theirs = seconds_per_call(call) * scale
            rows.append(Row(name, value, unit, f"{peer}: {theirs:.3g} {unit}", theirs / value, goal))
    return rows


def collect() -> Iterable[Row]:
    """Yield the rows of every benchmark module; one that fails is reported and does not stop the others."""
    for path in sorted(Path(__file__).parent.glob("bench_*.py")):
        print(f"{path.stem} ...", file=sys.stderr, flush=True)
        yield from importlib.import_module(f"benchmarks.{path.stem}").rows()


def install_peers() -> None:
    """Install the other libraries into this environment without moving any version that is pinned."""
    constraints = ROOT / "build" / "constraints.txt"
    constraints.parent.mkdir(exist_ok=True)
    pins = re.findall(r"^[A-Za-z0-9_.-]+==[^\\\n]+", (ROOT / "environment.txt").read_text(), re.MULTILINE)
    constraints.write_text("\n".join(pins) + "\n")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for peer in project["optional-dependencies"]["bench"]:
        if subprocess.run([*pip, "--constraint", str(constraints), peer], check=False).returncode:
            print(f"{peer} could not be installed; its rows stay empty", file=sys.stderr)


def table(rows: Iterable[Row]) -> str:
    """Return the rows as text, the ratios in front."""
    lines = [f"{'ratio':>7}  {'ours':>12}  {'goal':>10}  what, against what"]
    for row in rows:
        ratio = f"{row.ratio:.2f}" if row.ratio is not None else "-"
        goal = "" if row.goal is None else f"<= {row.goal:g}" + (" !" if row.value > row.goal else "")
        lines.append(f"{ratio:>7}  {row.value:>9.3g} {row.unit:<2}  {goal:>10}  {row.name}; {row.reference}")
    return "\n".join(lines)


def main() -> None:
    """Run all benchmarks, print the table and write ``build/benchmarks.json``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--install-peers", action="store_true", help="first install the libraries to compare")
    if parser.parse_args().install_peers:
        install_peers()
    rows = list(collect())
    print(table(rows))
    machine = {"python": platform.python_version(), "system": platform.platform(), "cores": os.cpu_count()}
    target = ROOT / "build" / "benchmarks.json"
    target.parent.mkdir(exist_ok=True)
    target.write_text(json.dumps({**machine, "rows": [asdict(row) for row in rows]}, indent=1) + "\n")
    print(f"\nratio above 1: ours is ahead; written to {target.relative_to(ROOT)}")


if __name__ == "__main__":
    main()

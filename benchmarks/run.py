"""Measures speed against other libraries, all in one run, and prints the ratios: ``make bench``.

Every module ``benchmarks/bench_<theme>.py`` offers ``rows() -> list[Row]``. The ratios are what counts: both
sides are measured on the same machine within the same minute. Times are CPU times, which other work on the
machine hardly changes; a row whose work runs in several threads says wall.

``make bench REF=<commit>`` measures against another commit instead, see `benchmarks.alternation`.
"""

import argparse
import importlib
import json
import math
import os
import platform
import re
import subprocess
import sys
import time
import timeit
import tomllib
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

# Before numpy is loaded: one thread on either side.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(variable, "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

ROOT = Path(__file__).resolve().parent.parent
NOT_INSTALLED = "peer not installed"


@dataclass(frozen=True)
class Row:
    """One comparison.

    Parameters
    ----------
    name : str
        What is computed, such as ``tip pose, one at a time``. Rows of two commits are matched by it, so it
        holds nothing that is measured.
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
    """Return the best CPU time of a call over several repeats, after a first call that is not counted [s]."""
    call()
    timer = timeit.Timer(call, timer=time.process_time)
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


def process_cost(command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> tuple[float, float]:
    """Run a command and return its cost with all processes that it waits for.

    Returns
    -------
    tuple of float
        CPU time of all of them together [s], peak memory of the largest [MB].

    Raises
    ------
    subprocess.CalledProcessError
        If the command fails; the exception has what it wrote.
    """
    # Its peak would begin with the memory of this process: it is started by a small one, which counts.
    counted = [sys.executable, "-S", "-c", COUNT, *command]
    done = subprocess.run(counted, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise subprocess.CalledProcessError(done.returncode, command, done.stdout + done.stderr)
    spent, peak = json.loads(done.stdout.splitlines()[-1])
    return spent, peak


COUNT = """
import json, resource, subprocess, sys
status = subprocess.run(sys.argv[1:]).returncode
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
print()
print(json.dumps([usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024]))
sys.exit(status)
"""


def peak_memory() -> float:
    """Return the largest memory of this process so far [MB], where Linux tells; else NaN.

    Not ru_maxrss, which begins with the memory of the process that started this one.
    """
    try:
        text = Path("/proc/self/status").read_text(encoding="ascii")
    except FileNotFoundError:
        return math.nan
    return int(re.findall(r"VmHWM:\s+(\d+) kB", text)[0]) / 1024


def module_names() -> list[str]:
    """Return the names of the benchmark modules here."""
    return sorted(path.stem for path in Path(__file__).parent.glob("bench_*.py"))


def collect(modules: Iterable[str]) -> Iterable[Row]:
    """Yield the rows of benchmark modules; one that fails is reported and does not stop the others."""
    for module in modules:
        print(f"{module} ...", file=sys.stderr, flush=True)
        try:
            yield from importlib.import_module(f"benchmarks.{module}").rows()
        except Exception:
            traceback.print_exc()


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
    """Run benchmarks and print the table: against other libraries, or against another checkout."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--install-peers", action="store_true", help="first install the libraries to compare")
    parser.add_argument("--only", action="append", choices=module_names(), help="this module (repeatable)")
    parser.add_argument("--against", metavar="REF", help="a commit, or the folder of a checkout")
    parser.add_argument("--runs", type=int, default=5, help="runs of either side, with --against")
    options = parser.parse_args()
    modules = options.only or module_names()
    if options.against:
        from benchmarks.alternation import compare_with
        from soro_lib.workbook.golden import GoldenError

        try:
            compare_with(options.against, modules, options.runs)
        except GoldenError as error:
            parser.error(str(error))
        except KeyboardInterrupt:
            sys.exit("stopped")
        return
    if options.install_peers:
        install_peers()
    _measure(modules)


def _measure(modules: Iterable[str]) -> None:
    """Measure against other libraries and write ``build/benchmarks.json``."""
    rows = list(collect(modules))
    print(table(rows))
    machine = {"python": platform.python_version(), "system": platform.platform(), "cores": os.cpu_count()}
    target = ROOT / "build" / "benchmarks.json"
    target.parent.mkdir(exist_ok=True)
    target.write_text(json.dumps({**machine, "rows": [asdict(row) for row in rows]}, indent=1) + "\n")
    print(f"\nratio above 1: ours is ahead; written to {target.relative_to(ROOT)}")


if __name__ == "__main__":
    main()

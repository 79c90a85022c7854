"""Simulated trials per second, from a hundred to a hundred thousand, against a plain Python loop.

And what many trials cost in memory and time apart from their simulation, against plain pandas and numpy; a
million of them where SORO_BENCH_LARGE is set.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import cycle, islice
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.run import ROOT, Row, peak_memory
from soro_lib.papers.shared_control.experiments import simulation
from soro_lib.papers.shared_control.experiments.demonstrations import (
    CELLS,
    RESULTS,
    demonstration_plans,
    run_demonstrations,
    summary,
)
from soro_lib.papers.shared_control.experiments.factorial import (
    RESPONSES,
    plain_anova,
    repeated_measures_anova,
    run_factorial,
)
from soro_lib.papers.shared_control.experiments.simulation import (
    CHUNK,
    METRICS,
    TRACE,
    TrialPlan,
    play_trial,
    simulate,
)
from soro_lib.papers.shared_control.world.people import NAIVE

CORES = 2
"""Threads; the issue states its goals for two cores."""

TRIALS_PER_PERSON = 120
"""Two environments, two kinds of people, six paradigms, five trials each."""


def rows() -> list[Row]:
    """Measure the scaling, the tuning study and the demonstrations."""
    plain = _plain_rate(list(islice(_endless(), 0, 240, 40)))
    measured = []
    for count in (100, 1_000, 10_000, 100_000):
        spent = _seconds(lambda count=count: simulate(islice(_endless(), count), jobs=CORES))
        memory = peak_memory()
        measured.append(
            Row(
                f"{count} trials on {CORES} threads, wall",
                spent,
                "s",
                f"{count / spent:.0f} per s, peak {memory:.0f} MB; plain Python loop: {plain:.2f} per s",
                count / spent / plain,
            )
        )
    return [*measured, *_studies(), *_large_tables()]


def _studies() -> list[Row]:
    tuning = _seconds(_tuning_study)
    crowd = _seconds(lambda: simulate(demonstration_plans(200, seed=1), jobs=CORES))
    return [
        Row(
            "tuning study, 192 trials, both analyses of four responses, wall",
            tuning,
            "s",
            "the goal",
            2 / tuning,
            2.0,
        ),
        Row("24000 demonstration trials, wall", crowd, "s", "the goal", 30 / crowd, 30.0),
    ]


def _large_tables() -> list[Row]:
    """Peak memory and CPU time of the table of trials and its intervals, each way in a process of its own."""
    counts = [10_000, 100_000, *([1_000_000] if os.environ.get("SORO_BENCH_LARGE") else [])]
    measured = []
    for count in counts:
        (memory, spent), (plain_memory, plain_spent) = (
            _in_a_process(way, count) for way in ("in_chunks", "plainly")
        )
        name = f"{count} trials, table and intervals"
        for what, ours, plain, unit, goal in (
            ("peak memory", memory, plain_memory, "MB", 400.0),
            ("CPU time", spent, plain_spent, "s", None),
        ):
            reference = f"plain pandas and numpy: {plain:.3g} {unit}"
            measured.append(Row(f"{name}, {what}", ours, unit, reference, plain / ours, goal))
    return measured


def _in_a_process(way: str, count: int) -> tuple[float, float]:
    """Peak memory [MB] and CPU time [s] of one way to do it."""
    code = f"from benchmarks import bench_shared_control as bench; bench.measure(bench.{way}, {count})"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True)
    memory, spent = json.loads(run.stdout)
    return memory, spent


def measure(way: Callable[[int], pd.DataFrame], count: int) -> None:
    """Print peak memory and CPU time of the demonstrations of so many trials; their numbers are made up."""
    made_up = np.random.default_rng(1).normal(20.0, 3.0, (CHUNK, len(METRICS)))
    simulation.simulate_chunk = lambda plans, time_limit: made_up[: len(plans)].copy()
    start = time.process_time()
    way(count // TRIALS_PER_PERSON)
    spent = time.process_time() - start
    print(json.dumps([peak_memory(), spent]))


def in_chunks(people: int) -> pd.DataFrame:
    """Ours."""
    return summary(run_demonstrations(people, seed=1))


def plainly(people: int) -> pd.DataFrame:
    """A dict per trial, and all resamples at once."""
    plans = list(demonstration_plans(people, seed=1))
    pieces = [plans[first : first + CHUNK] for first in range(0, len(plans), CHUNK)]
    metrics = np.concatenate([simulation.simulate_chunk(piece, 240.0) for piece in pieces])
    lines = [
        {**plan.labels, **dict(zip(METRICS, line, strict=True))}
        for plan, line in zip(plans, metrics, strict=True)
    ]
    trials = pd.DataFrame(lines)
    rng = np.random.default_rng(0)
    rows = []
    for cell, group in trials.groupby(CELLS, sort=False):
        values = group.groupby("operator")[list(RESULTS)].mean().to_numpy()
        picks = rng.integers(len(values), size=(2000, len(values)))
        low, high = np.nanpercentile(np.nanmean(values[picks], axis=1), [2.5, 97.5], axis=0)
        for index, metric in enumerate(RESULTS):
            rows.append((*cell, metric, np.nanmean(values[:, index]), low[index], high[index]))
    names = [*CELLS, "metric", "mean", "low", "high"]
    return pd.DataFrame(rows, columns=names)


def _tuning_study() -> None:
    trials = run_factorial([NAIVE], seed=1, jobs=CORES)
    for response in RESPONSES:
        repeated_measures_anova(trials, response)
        plain_anova(trials, response)


def _plain_rate(plans: list[TrialPlan]) -> float:
    """Trials per second of the same functions in the interpreter, one trial after the other."""
    no_trace = np.empty((0, len(TRACE)))

    def run() -> None:
        for plan in plans:
            play_trial(plan, plan.settings.rule(), 24_000, no_trace, compiled=False)

    return len(plans) / _seconds(run, warm=False)


def _endless() -> Iterator[TrialPlan]:
    """The demonstrations of two people, over and over: the mix of short and long trials stays the same."""
    return cycle(demonstration_plans(2, seed=1))


def _seconds(call: Callable[[], Any], warm: bool = True) -> float:
    """Wall time [s]: the trials run in several threads."""
    if warm:
        simulate(islice(_endless(), 4))
    start = time.perf_counter()
    call()
    return time.perf_counter() - start

"""Simulated trials per second, from a hundred to a hundred thousand, against a plain Python loop."""

import resource
import time
from collections.abc import Callable, Iterator
from itertools import cycle, islice
from typing import Any

import numpy as np

from benchmarks.run import Row
from soro_lib.operators import NAIVE
from soro_lib.studies.shared_control.demonstrations import demonstration_plans
from soro_lib.studies.shared_control.factorial import (
    RESPONSES,
    plain_anova,
    repeated_measures_anova,
    run_factorial,
)
from soro_lib.studies.shared_control.simulation import TRACE, TrialPlan, play_trial, simulate

CORES = 2
"""Threads; the issue states its goals for two cores."""


def rows() -> list[Row]:
    """Measure the scaling, the tuning study and the demonstrations."""
    plain = _plain_rate(list(islice(_endless(), 0, 240, 40)))
    measured = []
    for count in (100, 1_000, 10_000, 100_000):
        spent = _seconds(lambda count=count: simulate(islice(_endless(), count), jobs=CORES))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        measured.append(
            Row(
                f"{count} trials, {count / spent:.0f} per s on {CORES} threads, peak {memory:.0f} MB",
                spent,
                "s",
                f"plain Python loop: {plain:.2f} trials/s",
                count / spent / plain,
            )
        )
    return [*measured, *_studies()]


def _studies() -> list[Row]:
    tuning = _seconds(_tuning_study)
    crowd = _seconds(lambda: simulate(demonstration_plans(200, seed=1), jobs=CORES))
    return [
        Row(
            "tuning study, 192 trials, both analyses of four responses",
            tuning,
            "s",
            "the goal",
            2 / tuning,
            2.0,
        ),
        Row("24000 demonstration trials", crowd, "s", "the goal", 30 / crowd, 30.0),
    ]


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
    if warm:
        simulate(islice(_endless(), 4))
    start = time.perf_counter()
    call()
    return time.perf_counter() - start

"""The demonstrations: six paradigms, expert and naive, simulated and real, five trials each.

First as the paper did, with four individuals; then with a crowd, for effects with intervals.

Source: Stroppa et al., Section 5.4.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.checks import one_of
from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control.experiments.simulation import TrialPlan, person_plans, simulate
from soro_lib.papers.shared_control.experiments.task import TaskSettings
from soro_lib.papers.shared_control.world.people import ATTITUDES, POPULATIONS, Operator

ENVIRONMENTS = ("simulated", "real")
KINDS = ("expert", "naive")
TRIALS = 5


def draw_operators(kind: str, count: int, seed: int, **changes: float) -> list[Operator]:
    """People of one kind; the first ones are the same however many are drawn.

    Parameters
    ----------
    kind : {"expert", "naive"}
    count : int
    seed : int
    **changes
        Parameters of `Operator` set alike for all (an attitude, no approach from above, ...).

    Raises
    ------
    ValueError
        If there is no such kind, or a parameter is out of bounds.
    """
    one_of("kind", kind, POPULATIONS)
    streams = (np.random.default_rng([seed, 1, KINDS.index(kind), person]) for person in range(count))
    return [replace(POPULATIONS[kind].draw(rng), **changes) for rng in streams]


def demonstration_plans(
    operators: int,
    seed: int,
    trials: int = TRIALS,
    attitude: str = "ignore",
    approach_height: float = 0.1,
    paradigms: Iterable[str] = PARADIGMS,
    **settings: Any,
) -> Iterator[TrialPlan]:
    """Every operator of every kind through every paradigm in every environment.

    A trial's chance is shared by the six paradigms: comparisons are paired. The two environments have
    different people, as in the paper.

    Parameters
    ----------
    operators : int
        People per kind and environment.
    seed : int
    trials : int
        Per person and paradigm.
    attitude : {"ignore", "use", "yield"}
        To the guidance force.
    approach_height : float
        0.1 m: from above, as the paper says; 0: in a straight line.
    paradigms : iterable of str
    **settings
        Passed on to `TaskSettings` (force_law, detection_error, ...).
    """
    changes = {**ATTITUDES[attitude], "approach_height": approach_height}
    for place, environment in enumerate(ENVIRONMENTS):
        for group, kind in enumerate(KINDS):
            people = draw_operators(kind, operators, seed + 1000 * place, **changes)
            for name in paradigms:
                setting = TaskSettings(PARADIGMS[name], environment=environment, **settings)  # type: ignore[arg-type]
                labels = {"environment": environment, "kind": kind, "paradigm": name}
                yield from person_plans(setting, people, (seed, 2, place, group), trials, labels)


def run_demonstrations(
    operators: int, seed: int, jobs: int = 1, scheduler: Any = None, store: Any = None, **options: Any
) -> pd.DataFrame:
    """Simulate the demonstrations; one line per trial. Options as in `demonstration_plans` and `simulate`."""
    plans = demonstration_plans(operators, seed, **options)
    return simulate(plans, jobs=jobs, scheduler=scheduler, store=store)


GUIDED = ("assist_as_needed", "fixed_assistance")
"""Paradigms that the force law and the attitude to the force concern."""


def run_conditions(operators: int, seed: int, trials: int = 2, **run: Any) -> pd.DataFrame:
    """The demonstrations under every attitude, force law, and way to approach.

    The paradigms without a force are simulated once for each approach and serve every attitude and law.
    ``run``: jobs, scheduler or store of `simulate`.

    Returns
    -------
    pandas.DataFrame
        As `run_demonstrations`, with the columns attitude, law and approach before.
    """

    free = {"paradigms": [name for name in PARADIGMS if name not in GUIDED]}
    forces = list(product(ATTITUDES, ("printed", "program")))
    cases: dict[tuple[str, str], dict[str, Any]] = {("any", "any"): free}
    for attitude, law in forces:
        cases[attitude, law] = {"paradigms": GUIDED, "attitude": attitude, "force_law": law}

    def plans() -> Iterator[TrialPlan]:
        for (approach, height), ((attitude, law), case) in product(APPROACHES.items(), cases.items()):
            condition = {"attitude": attitude, "law": law, "approach": approach}
            for plan in demonstration_plans(operators, seed, trials, approach_height=height, **case):
                yield replace(plan, labels={**condition, **plan.labels})

    table = simulate(plans(), **run)
    unforced = table[table["attitude"] == "any"]
    copies = [unforced.assign(attitude=attitude, law=law) for attitude, law in forces]
    return pd.concat([*copies, table[table["attitude"] != "any"]], ignore_index=True)


APPROACHES = {"from above": 0.1, "straight": 0.0}
"""How much higher the operators aim while far away [m]."""


RESULTS = ("time_s", "release_error_mm", "path_m", "assistance_n")
"""What the tables of results show."""

CELLS = ["environment", "kind", "paradigm"]


def summary(trials: pd.DataFrame, resamples: int = 2000) -> pd.DataFrame:
    """Mean of each metric over people, with a 95 % bootstrap interval over people.

    Time-outs count with their full time; errors are those of finished trials.

    Returns
    -------
    pandas.DataFrame
        Columns environment, kind, paradigm, metric, mean, low, high, finished (share of trials).
    """
    people = trials.groupby([*CELLS, "operator"], sort=False)[list(RESULTS)].mean()
    finished = trials.groupby(CELLS, sort=False)["finished"].mean()
    return _over_people(people, resamples).join(finished, on=CELLS)


def effects(trials: pd.DataFrame, resamples: int = 2000) -> pd.DataFrame:
    """What each paradigm changes against full teleoperation, person by person, with 95 % bootstrap intervals.

    The same people meet the same chance under every paradigm, so the differences are paired.

    Returns
    -------
    pandas.DataFrame
        Columns environment, kind, paradigm, metric, mean, low, high: paradigm less full teleoperation.
    """
    people = trials.groupby([*CELLS, "operator"], sort=False)[list(RESULTS)].mean().reset_index()
    keys = ["environment", "kind", "operator"]
    reference = people["paradigm"] == "full_teleoperation"
    base = people[reference].set_index(keys)[list(RESULTS)]
    others = people[~reference].set_index([*CELLS, "operator"])
    aligned = base.reindex(others.reset_index("paradigm").index).to_numpy()
    return _over_people(others.sub(aligned), resamples)


LARGEST_DRAW = 250_000
"""Numbers that are drawn at a time; they take 2 MB, and as much again for their mean."""


def resampled_means(
    values: NDArray[np.float64], resamples: int, rng: np.random.Generator, largest: int = LARGEST_DRAW
) -> NDArray[np.float64]:
    """Means of bootstrap samples, NaN left out: (people, metrics) to (resamples, metrics).

    At most ``largest`` numbers (of at least one sample) are drawn at a time; the means do not depend on it.
    """
    means = np.empty((resamples, values.shape[1]))
    step = max(1, largest // values.size)
    for first in range(0, resamples, step):
        part = means[first : first + step]
        picks = rng.integers(len(values), size=(len(part), len(values)))
        part[:] = np.nanmean(values[picks], axis=1)
    return means


def _over_people(people: pd.DataFrame, resamples: int) -> pd.DataFrame:
    """Mean and bootstrap interval over the operators of every cell."""
    rng = np.random.default_rng(0)
    rows = []
    for cell, group in people.groupby(CELLS, sort=False):
        values = group.to_numpy()
        low, high = np.nanpercentile(resampled_means(values, resamples, rng), [2.5, 97.5], axis=0)
        for index, metric in enumerate(group.columns):
            rows.append((*cell, metric, np.nanmean(values[:, index]), low[index], high[index]))
    return pd.DataFrame(rows, columns=[*CELLS, "metric", "mean", "low", "high"])

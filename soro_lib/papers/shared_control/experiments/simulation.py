"""Simulated operators at the task, thousands of trials at a time.

`play` joins the operator to the task; numba compiles it together with every rule it calls. Each trial has a
random stream of its own, so that the numbers depend neither on the other trials, nor on chunks, threads or
machines.
"""

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import joblib
import numba
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.checks import positive
from soro_lib.controllers.shared_control.guidance import distance_to_goal
from soro_lib.jit import inlined
from soro_lib.papers.shared_control.experiments.finished_chunks import chunk_path, read_chunk, write_chunk
from soro_lib.papers.shared_control.experiments.task import (
    TaskMemory,
    TaskRule,
    TaskSettings,
    TaskState,
    delivered,
    operator_view,
    task_start,
    task_step,
)
from soro_lib.papers.shared_control.world.hand import hand_command
from soro_lib.papers.shared_control.world.loop import (
    OperatorState,
    operator_start,
    operator_step,
    picture_buffer,
)
from soro_lib.papers.shared_control.world.people import EXPERT, SAMPLE_TIME, Operator

TIME_LIMIT = 240.0
"""Time after which a trial is given up [s]."""

CHUNK = 250
"""Trials per task handed to a worker."""

METRICS = (
    *("time_s", "path_m", "assistance_n", "peak_force_n", "release_error_mm", "placement_error_mm"),
    *("finished", "item1_time_s", "item2_time_s", "item1_error_mm", "item2_error_mm"),
)
"""Columns of a trial: T, L and H of the paper, the error of Section 5.2 (tip at release), P of Eq. (11)
(item in the end), and time and release error of each item for Fig. 8."""

TRACE = (
    *("time_s", "tip_x_m", "tip_y_m", "tip_z_m", "desired_x_m", "desired_y_m", "desired_z_m"),
    *("command_x_m", "command_y_m", "command_z_m", "goal_x_m", "goal_y_m", "goal_z_m"),
    *("force_x_n", "force_y_n", "force_z_n", "magnitude_n", "stiffness_n_per_m", "distance_m"),
    *("motion", "phase", "item", "closed"),
)
"""Columns of the trace of one trial; motion and phase index ``MOTIONS`` and ``PHASES``."""


@dataclass(frozen=True)
class TrialPlan:
    """One trial to be simulated.

    Parameters
    ----------
    settings : TaskSettings
    operator : Operator
    seed : tuple of int
        Entropy of the trial's random stream. Trials that share it meet the same chance.
    labels : mapping
        Columns that identify the trial in the table; every trial of a sweep has the same.
    """

    settings: TaskSettings
    operator: Operator = EXPERT
    seed: tuple[int, ...] = (1,)
    labels: Mapping[str, Any] = field(default_factory=dict)


def person_plans(
    settings: TaskSettings,
    people: Sequence[Operator],
    stream: Sequence[int],
    trials: int,
    labels: Mapping[str, Any],
    setting: Sequence[int] = (),
    counted: str = "trial",
) -> Iterator[TrialPlan]:
    """Every person for a few trials under one setting.

    Chance depends on ``stream``, person, trial and, where given, ``setting``: settings that share them meet
    the same chance. The labels gain operator and trial (or what ``counted`` says).
    """
    for person, operator in enumerate(people):
        for trial in range(trials):
            chance = (*stream, person, trial, *setting)
            yield TrialPlan(settings, operator, chance, {**labels, "operator": person, counted: trial})


@inlined
def write_trace(line: NDArray[np.float64], task: TaskRule, state: TaskState, command: Any) -> None:
    """Fill one line of the trace."""
    line[0] = SAMPLE_TIME * state.sample
    for axis in range(3):
        line[1 + axis] = state.plant.tip[axis]
        line[4 + axis] = state.desired[axis]
        line[7 + axis] = command[axis]
        line[10 + axis] = state.goal.goal[axis]
        line[13 + axis] = state.force[axis]
    line[16] = state.magnitude
    line[17] = state.assist.stiffness
    line[18] = distance_to_goal(state.plant.tip, state.goal.goal)
    line[19] = state.assist.motion
    line[20] = state.goal.phase
    line[21] = state.gripper.item
    line[22] = state.closed


@inlined
def play(
    task: TaskRule,
    state: TaskState,
    memory: TaskMemory,
    operator: Any,
    human: OperatorState,
    pictures: NDArray[np.float64],
    rng: np.random.Generator,
    samples: int,
    trace: NDArray[np.float64],
) -> TaskState:
    """Let the operator work until the last item is placed or the time is up; ``trace`` may have no lines."""
    while state.sample < samples and not delivered(task, state):
        view = operator_view(task, state, memory.items)
        human = operator_step(operator, human, pictures, view, rng)
        command = hand_command(human.hand)
        decision = human.decision
        state = task_step(task, state, memory, command, decision.closed, decision.reported, rng)
        if state.sample <= len(trace):
            write_trace(trace[state.sample - 1], task, state, command)
    return state


_compiled_play = numba.njit(cache=True, nogil=True)(play)


def play_trial(
    plan: TrialPlan, rule: TaskRule, samples: int, trace: NDArray[np.float64], compiled: bool = True
) -> tuple[TaskState, TaskMemory]:
    """Simulate one trial; ``compiled=False`` runs the same functions in the interpreter, far more slowly.

    Returns
    -------
    state : TaskState
        At the end of the trial.
    memory : TaskMemory
        With the items where they ended and the releases.
    """
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(plan.seed)))
    start = plan.settings.scene.start
    first, memory = task_start(rule, start)
    operator = plan.operator.rule()
    human, pictures = operator_start(start), picture_buffer(operator, start)
    run = _compiled_play if compiled else play
    state = run(rule, first, memory, operator, human, pictures, rng, samples, trace)
    return state, memory


def trial_metrics(rule: TaskRule, state: TaskState, memory: TaskMemory) -> list[float]:
    """The metrics of a finished trial, in the order of `METRICS`; errors are NaN where it did not finish."""
    finished = bool(delivered(rule, state))
    time = SAMPLE_TIME * state.sample
    opened = 1e3 * memory.releases[:, 1]
    across = 1e3 * np.hypot(*(memory.items - np.array(rule.targets))[:, :2].T)
    times = np.diff(memory.releases[:, 0], prepend=0.0)
    mean = float(np.mean(opened)) if finished else np.nan
    placed = float(np.mean(across)) if finished else np.nan
    assistance = state.tally.impulse / time
    values = [time, state.tally.path, assistance, state.tally.peak_force, mean, placed, float(finished)]
    return [*values, times[0], times[-1], opened[0], opened[-1]]


def simulate_chunk(plans: Sequence[TrialPlan], time_limit: float = TIME_LIMIT) -> NDArray[np.float64]:
    """Metrics (trials, len(METRICS)) of a few trials, one after the other."""
    samples = round(time_limit / SAMPLE_TIME)
    no_trace = np.empty((0, len(TRACE)))
    rules: dict[int, TaskRule] = {}
    table = np.empty((len(plans), len(METRICS)))
    for line, plan in zip(table, plans, strict=True):
        rule = rules.get(id(plan.settings)) or rules.setdefault(id(plan.settings), plan.settings.rule())
        line[:] = trial_metrics(rule, *play_trial(plan, rule, samples, no_trace))
    return table


def simulate(
    plans: Iterable[TrialPlan],
    time_limit: float = TIME_LIMIT,
    jobs: int = 1,
    scheduler: Any = None,
    chunk: int = CHUNK,
    store: str | Path | None = None,
) -> pd.DataFrame:
    """Simulate trials and return one line each: their labels, then `METRICS`.

    Parameters
    ----------
    plans : iterable of TrialPlan
        May be a generator; only the chunks under way are held in memory.
    time_limit : float
        A trial that takes longer is given up [s].
    jobs : int
        Threads in this process; the numbers do not depend on it.
    scheduler : str or distributed.Client, optional
        Address of a Dask scheduler, or a client of one. The trials then run on its workers; what a lost
        worker had under way is run again elsewhere. The numbers are the same.
    chunk : int
        Trials per task.
    store : str or Path, optional
        Folder that keeps the finished chunks. A sweep that was killed goes on from them; trials of other
        plans, or of other code, are not taken for them. It may be deleted at any time.

    Returns
    -------
    pandas.DataFrame
        Labels that are text come as categories; 100 bytes a trial or so in all.

    Raises
    ------
    ValueError
        If the time limit is not positive, the chunk holds no trial, or a plan is out of bounds.
    """
    positive("time_limit", time_limit)
    positive("chunk", chunk)
    labels: dict[str, list[Any]] = {}
    places: list[Path | None] = []
    metrics = array("d")

    def tasks() -> Iterator[Any]:
        remaining = iter(plans)
        while piece := list(islice(remaining, chunk)):
            for name in piece[0].labels:
                labels.setdefault(name, []).extend(plan.labels[name] for plan in piece)
            # Labels do not enter: they only name the numbers.
            inputs = (time_limit, *((plan.settings, plan.operator, plan.seed) for plan in piece))
            place = None if store is None else chunk_path(store, inputs)
            table = None if place is None else read_chunk(place)
            places.append(place if table is None else None)
            if table is None:
                yield joblib.delayed(simulate_chunk)(piece, time_limit)
            else:  # hand on the chunk of an earlier run, so that the chunks stay in order
                yield joblib.delayed(np.asarray)(table)

    with ExitStack() as backend:
        if scheduler is None:
            backend.enter_context(joblib.parallel_config(backend="threading"))
        else:
            from distributed import Client

            client = backend.enter_context(Client(scheduler)) if isinstance(scheduler, str) else scheduler
            backend.enter_context(joblib.parallel_config(backend="dask", client=client))
        parallel = joblib.Parallel(n_jobs=jobs if scheduler is None else -1, return_as="generator")
        for number, table in enumerate(parallel(tasks())):
            if (place := places[number]) is not None:
                write_chunk(place, table)
            metrics.frombytes(table.tobytes())
    columns = {name: _column(labels.pop(name)) for name in list(labels)}
    values = pd.DataFrame(np.frombuffer(metrics).reshape(-1, len(METRICS)), columns=list(METRICS), copy=False)
    return pd.concat([pd.DataFrame(columns), values], axis=1)


def _column(values: list[Any]) -> Any:
    """A column of labels; text as categories, a byte each."""
    return pd.Categorical(values) if isinstance(values[0], str) else values


def trace_trial(plan: TrialPlan, time_limit: float = TIME_LIMIT) -> pd.DataFrame:
    """Simulate one trial and return every sample, columns `TRACE`."""
    rule = plan.settings.rule()
    trace = np.empty((round(time_limit / SAMPLE_TIME), len(TRACE)))
    state, _ = play_trial(plan, rule, len(trace), trace)
    return pd.DataFrame(trace[: state.sample], columns=list(TRACE))

"""Recorded trials: reading and checking them, and the way into the study's metrics and figures.

The format is described in `trial_format`.
"""

import gzip
import io
import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.controllers.shared_control.goal_selection import END, LIFTING_EMPTY, PLACING
from soro_lib.papers.shared_control.experiments import trial_format
from soro_lib.papers.shared_control.experiments.metrics import (
    mean_assistance,
    placement_error,
    trajectory_length,
)
from soro_lib.papers.shared_control.experiments.simulation import METRICS, TRACE
from soro_lib.papers.shared_control.experiments.trial_format import TrialError, TrialHeader


@dataclass(frozen=True)
class RecordedTrial:
    """One trial as it was recorded.

    Attributes
    ----------
    path : Path
    header : TrialHeader
    samples : pandas.DataFrame
        Columns `trial_columns`; motion and phase as indices of ``MOTIONS`` and ``PHASES``.
    complete : bool
        The recording came to its end; False for a trial that was cut off.
    """

    path: Path
    header: TrialHeader
    samples: pd.DataFrame
    complete: bool

    @property
    def trace(self) -> pd.DataFrame:
        """The samples as `trace_trial` gives them, for the same figures."""
        distance = np.linalg.norm(self.points("goal") - self.points("tip"), axis=1)
        item, closed = self.samples["item_held"] - 1.0, self.samples["gripper_closed"]
        trace = self.samples.assign(distance_m=distance, item=item, closed=closed)
        return trace[list(TRACE)].astype(float)

    @property
    def finished(self) -> bool:
        """Whether the last item was placed."""
        return self._delivery is not None

    @property
    def _delivery(self) -> int | None:
        """Row in which the last item was placed; a recording may go on after it."""
        phase, item = self.samples["phase"], self.samples["goal_item"]
        last = len(self.header.scene.items)
        done = ((phase == END) | ((phase == LIFTING_EMPTY) & (item == last))).to_numpy()
        return int(np.argmax(done)) if done.any() else None

    def points(self, name: str) -> NDArray[np.float64]:
        """Three columns of one quantity, shape (n, 3)."""
        unit = "n" if name == "force" else "m"
        return self.samples[[f"{name}_{axis}_{unit}" for axis in trial_format.AXES]].to_numpy(dtype=float)

    def metrics(self) -> dict[str, float]:
        """The metrics of the study, `METRICS`, by the functions that stand for Eqs. (9)-(11)."""
        delivery = self._delivery
        until = len(self.samples) if delivery is None else delivery + 1
        times = self.samples["time_s"].to_numpy(dtype=float)[:until]
        forces = self.points("force")[:until]
        scene = self.header.scene
        places = [self.points(f"item{number + 1}")[until - 1] for number in range(len(scene.items))]
        released, opened = self._releases(until)
        periods = np.diff(released, prepend=0.0)
        finished = delivery is not None
        values = (
            float(times[-1]),
            trajectory_length([scene.start, *self.points("tip")[:until]]),
            mean_assistance(forces, times),
            float(np.linalg.norm(forces, axis=1).max()),
            1e3 * float(np.mean(opened)) if finished else math.nan,
            1e3 * placement_error(places, scene.targets) if finished else math.nan,
            float(finished),
            *(float(periods[0]), float(periods[-1])),
            *(1e3 * float(opened[0]), 1e3 * float(opened[-1])),
        )
        return dict(zip(METRICS, values, strict=True))

    def _releases(self, until: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Time [s] at which each item was placed and the tip's horizontal error [m] as the gripper opened."""
        samples = self.samples.iloc[:until]
        held, closed = samples["item_held"], samples["gripper_closed"]
        holding = held.shift(fill_value=0)
        opening = (holding > 0) & (closed.shift(fill_value=0) == 1) & (closed == 0)
        placing = samples["phase"].shift(fill_value=END) == PLACING
        tips = self.points("tip")
        times = np.full(len(self.header.scene.items), math.nan)
        errors = times.copy()
        for number, target in enumerate(self.header.scene.targets):
            release = np.flatnonzero((holding == number + 1) & (held == 0) & placing)
            if len(release):
                times[number] = samples["time_s"].iloc[release[-1]]
                opened = np.flatnonzero(opening[: release[-1] + 1])
                errors[number] = math.dist(tips[opened[-1], :2], target[:2]) if len(opened) else math.nan
        return times, errors

    def replay(self) -> NDArray[np.float64]:
        """Tip positions (n, 3) [m] of the simulated arm under the recorded commands.

        Raises
        ------
        ValueError
            If the trial has no seed: it was not recorded from the simulator.
        """
        if not self.header.seed:
            raise ValueError(f"{self.path.name}: no seed, so it cannot be replayed on the simulated arm")
        task = self.header.task()
        buttons = self.samples[["gripper_closed", "confirmed"]].to_numpy(dtype=bool)
        steps = zip(self.points("command"), buttons, strict=True)
        return np.array([task.step(command, closed, confirmed).tip for command, (closed, confirmed) in steps])


def load_trials(folder: str | Path) -> list[RecordedTrial]:
    """Read every trial of a folder, in the order of the file names.

    Parameters
    ----------
    folder : str or Path
        With files of the format above; other files and sub-folders are left alone.

    Returns
    -------
    list of RecordedTrial
        Empty where the folder holds no trial. Cut-off ones are among them, marked as not complete, unless
        they were cut off before their first sample.

    Raises
    ------
    FileNotFoundError
        No such folder.
    TrialError
        A file is no trial; the message names file, row and column.

    Examples
    --------
    >>> from soro_lib.project import data_directory
    >>> trials = load_trials(data_directory("shared_control") / "trials")
    >>> trial_table(trials)["finished"].tolist() == [1.0] * len(trials)
    True
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"no such folder of trials: {folder}")
    paths = sorted(path for path in folder.iterdir() if path.name.endswith(trial_format.SUFFIXES))
    return [load_trial(path) for path in paths if not (path.suffix == ".part" and _is_bare(path))]


def _is_bare(path: Path) -> bool:
    """Whether a cut-off trial has no whole line of samples."""
    return sum(not line.startswith("#") for line in _lines(path)) < 2


def load_trial(path: str | Path) -> RecordedTrial:
    """Read and check one trial.

    Raises
    ------
    FileNotFoundError
        No such file.
    TrialError
        Not a trial, a column missing or in another unit, a value that is no number, out of bounds or unknown,
        times that do not increase; the message names file, row (1 = first after the column names), column.
    """
    path = Path(path)
    lines = _lines(path)
    top = next((index for index, line in enumerate(lines) if not line.startswith("#")), len(lines))
    try:
        header = TrialHeader.parse(lines[:top])
    except ValueError as error:
        raise TrialError(f"{path.name}: {error}") from None
    rows, bound = len(lines) - top - 1, trial_format.MAXIMUM_ROWS
    if rows < 1:
        raise TrialError(f"{path.name}: no samples")
    if rows > bound:
        raise TrialError(f"{path.name}: {rows} samples, bound {bound}; cut the file")
    try:
        raw = pd.read_csv(io.StringIO("\n".join(lines[top:])), dtype=str, keep_default_na=False)
    except pd.errors.ParserError as error:
        raise TrialError(f"{path.name}: not a table of comma-separated values ({error})") from None
    return RecordedTrial(path, header, _checked(raw, header, path.name), path.suffix != ".part")


def _lines(path: Path) -> list[str]:
    """The whole lines of a file, plain or compressed; the machine may have died in the middle of one."""
    try:
        content = path.read_bytes()
        text = (gzip.decompress(content) if path.suffix == ".gz" else content).decode("utf-8")
        return (text[: text.rfind("\n") + 1] if path.suffix == ".part" else text).splitlines()
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise TrialError(f"{path.name}: truncated or damaged gzip file ({error})") from None
    except UnicodeDecodeError as error:
        raise TrialError(f"{path.name}: not a text file (byte {error.start} is not UTF-8)") from None


def _checked(raw: pd.DataFrame, header: TrialHeader, file: str) -> pd.DataFrame:
    """The samples as numbers, every column and value checked."""
    columns = trial_format.trial_columns(len(header.scene.items))
    for name, meaning in columns.items():
        if name not in raw.columns:
            raise TrialError(f"{file}: {_absent(name, meaning, list(raw.columns))}")
    table = pd.DataFrame({name: _numbers(raw[name], file) for name in columns})
    times = table["time_s"].to_numpy()
    backward = np.flatnonzero(np.diff(times, prepend=0.0) <= 0)
    if len(backward):
        row = int(backward[0])
        before = f"{times[row - 1]:g} s in the row before" if row else "0 s"
        raise TrialError(f"{file}, row {row + 1}, column time_s: {times[row]:g} s must be above {before}")
    items = len(header.scene.items)
    for name, low, high in (
        *(("gripper_closed", 0, 1), ("confirmed", 0, 1)),
        *(("goal_item", 1, items), ("item_held", 0, items)),
    ):
        allowed = range(low, high + 1)
        _refuse(~table[name].isin(allowed), raw[name], file, f"is not a whole number from {low} to {high}")
    for name, meaning in columns.items():
        unit = trial_format.unit_of(meaning)
        largest = trial_format.LARGEST.get(unit, math.inf)
        bound = f"is beyond {largest:g}: is it in [{unit}]?"
        _refuse(table[name].abs() > largest, raw[name], file, bound)
    return table


def _absent(name: str, meaning: str, present: list[str]) -> str:
    """What to say of a missing column: that it stands there in another unit, where it does."""
    unit = trial_format.unit_of(meaning)
    stem = name.removesuffix("_" + unit.lower().replace("/", "_per_"))
    for other in present:
        if unit != "-" and other.startswith(stem + "_") and other not in trial_format.COLUMNS:
            return f"column {other} has the wrong unit; {name} in [{unit}] is needed"
    return f"column {name} is missing ({meaning})"


def _numbers(column: pd.Series, file: str) -> pd.Series:
    """A column of text as finite numbers; states by their index."""
    if states := trial_format.STATES.get(str(column.name)):
        _refuse(~column.isin(states), column, file, f"is not one of {', '.join(states)}")
        return column.map(states.index).astype(int)
    values = pd.to_numeric(column, errors="coerce")
    _refuse(~np.isfinite(values), column, file, "is not a finite number")
    return values.astype(float)


def _refuse(bad: pd.Series, column: pd.Series, file: str, why: str) -> None:
    """Raise for the first bad value of a column."""
    if bad.any():
        row = int(np.argmax(bad.to_numpy()))
        raise TrialError(f"{file}, row {row + 1}, column {column.name}: {str(column.iloc[row])!r} {why}")


# --- Into the study ---------------------------------------------------------------------------------------


def trial_table(trials: Sequence[RecordedTrial]) -> pd.DataFrame:
    """One line per trial, as `simulate` gives it: labels, then `METRICS`.

    Returns
    -------
    pandas.DataFrame
        Columns environment, kind, paradigm, operator, trial (counted within those), law, file, complete, then
        the metrics.
    """
    person = ["environment", "kind", "paradigm", "operator"]
    rows = [
        {name: getattr(trial.header, name) for name in person}
        | {"law": trial.header.force_law, "file": trial.path.name, "complete": trial.complete}
        | trial.metrics()
        for trial in trials
    ]
    table = pd.DataFrame(rows, columns=[*person, "law", "file", "complete", *METRICS])
    table.insert(len(person), "trial", table.groupby(person, sort=False).cumcount())
    return table


def standing(
    own: pd.DataFrame,
    crowd: pd.DataFrame,
    metrics: Sequence[str] = ("time_s", "path_m", "assistance_n", "release_error_mm"),
) -> pd.DataFrame:
    """Where recorded trials stand among simulated ones of the same paradigm and environment.

    Parameters
    ----------
    own : pandas.DataFrame
        As `trial_table` gives it; finished trials count.
    crowd : pandas.DataFrame
        As `simulate` gives it.
    metrics : sequence of str

    Returns
    -------
    pandas.DataFrame
        Columns file, paradigm, environment, kind (of the crowd), metric, own, crowd_median, below: the share
        of the crowd's trials with a smaller value.
    """
    rows = []
    for trial in own[own["finished"] == 1].itertuples():
        alike = crowd[(crowd["paradigm"] == trial.paradigm) & (crowd["environment"] == trial.environment)]
        for kind, group in alike.groupby("kind", sort=False):
            for metric in metrics:
                value, others = float(getattr(trial, metric)), group[metric].dropna()
                labels = (trial.file, trial.paradigm, trial.environment, kind, metric)
                rows.append((*labels, value, float(others.median()), float((others < value).mean())))
    names = ("file", "paradigm", "environment", "kind", "metric", "own", "crowd_median", "below")
    return pd.DataFrame(rows, columns=list(names))

"""The contest: who follows the path how well, undisturbed and disturbed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import t as student

from soro_lib.papers.cross_robot.experiments.laws import Controller, NotApplicable, controllers
from soro_lib.papers.cross_robot.world.benches import Array, Bench, Plants, benches, disturbed_and_not

SENSOR_NOISE = 0.002
"""Standard deviation of the measured tip, as a share of the arm's length, and of its direction [rad]."""

NEAR_LIMIT = 0.011
"""An actuator this close to a limit, as a share of its range, counts as at the limit [-]."""


@dataclass(frozen=True, eq=False)
class TrackedPath:
    """One controller on a batch of one arm.

    Attributes
    ----------
    goals : ndarray (steps, 3)
        Where the tip should be [m].
    tips, directions : ndarray (steps, batch, 3)
        Where it was [m], and where it pointed.
    at_limit : ndarray (steps, batch) of bool
        Whether any actuator was at a limit.
    steers : str
        Which coordinates the controller controls.
    """

    goals: Array
    tips: Array
    directions: Array
    at_limit: NDArray[np.bool_]
    steers: str

    @property
    def error(self) -> Array:
        """Distance of tip and goal [m] in the coordinates that are steered, shape (steps, batch)."""
        axes = 2 if self.steers == "x, y" else 3
        return np.asarray(np.linalg.norm((self.tips - self.goals[:, np.newaxis])[..., :axes], axis=-1))

    @property
    def direction_error(self) -> Array:
        """Angle between the direction and straight [rad], shape (steps, batch); NaN if not steered."""
        angle = np.arccos(np.clip(self.directions[..., 2], -1.0, 1.0))
        return angle if "direction" in self.steers else np.full_like(angle, np.nan)


def track(
    controller: Controller,
    bench: Bench,
    plants: Plants,
    moving: int,
    holding: int,
    rng: np.random.Generator,
    scaled: bool = True,
) -> TrackedPath:
    """Let a batch of arms follow the path under one controller.

    Parameters
    ----------
    controller, bench, plants
        Who steers what; the plants are of the arm on the bench.
    moving, holding : int
        Steps along the path, and at its end.
    rng : numpy.random.Generator
        Draws sensor noise and the drift of a hand.
    scaled : bool
        Whether the arm is shown in the size of the controller's own.

    Raises
    ------
    NotApplicable
        If the controller cannot be used on this arm; the message says why.
    """
    batch = len(plants.compliance)
    law, arm = controller.on(bench, scaled, batch, rng)
    near = NEAR_LIMIT * (bench.robot.upper - bench.robot.lower)
    lowest, highest = bench.robot.lower + near, bench.robot.upper - near
    goals = bench.path(moving, holding)
    tips, directions = np.empty((2, len(goals), batch, 3))
    at_limit = np.empty((len(goals), batch), dtype=bool)
    tip, direction = plants.tip_and_direction(law.actuation * arm.units)
    for step, goal in enumerate(goals):
        seen = tip + rng.normal(0.0, SENSOR_NOISE * bench.length, tip.shape)
        pointing = direction + rng.normal(0.0, SENSOR_NOISE, tip.shape)
        pointing /= np.linalg.norm(pointing, axis=-1, keepdims=True)
        law.update(seen / arm.ratio, pointing, goal / arm.ratio)
        actuation = law.actuation * arm.units
        tip, direction = plants.tip_and_direction(actuation)
        tips[step], directions[step] = tip, direction
        at_limit[step] = ((actuation < lowest) | (actuation > highest)).any(axis=-1)
    return TrackedPath(goals, tips, directions, at_limit, law.steers)


def contest(
    rng: np.random.Generator, seeds: int = 10, moving: int = 180, holding: int = 60
) -> tuple[pd.DataFrame, dict[tuple[str, str], TrackedPath]]:
    """Let every controller steer every arm, as modelled and disturbed, with constants scaled and as printed.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws mounts, sensor noise and hands, the same for every controller and arm.
    seeds : int
        Arms per condition.
    moving, holding : int
        Steps along the path, and at its end.

    Returns
    -------
    table : pandas.DataFrame
        One row per controller, arm, plant ("as modelled", "disturbed") and constants ("scaled",
        "as printed"): what is steered; median and 95th percentile of the tracking error and the error held
        at the end, with mean and 95 % interval over seeds; direction error; share of steps at a limit; why
        not, where a controller cannot be applied.
    runs : dict
        With scaled constants, by controller and arm; the first half of a batch is as modelled.
    """
    rows: list[dict[str, Any]] = []
    runs: dict[tuple[str, str], TrackedPath] = {}
    mounts, noise = rng.integers(2**32, size=2)
    for arm, bench in benches().items():
        plants = disturbed_and_not(bench.robot, seeds, np.random.default_rng(mounts))
        for (name, controller), scaled in product(controllers().items(), (True, False)):
            if not scaled and not (name in PRINTED and controller.differs_in_size(bench)):
                continue
            key = {"controller": name, "arm": arm, "constants": "scaled" if scaled else "as printed"}
            try:
                run = track(controller, bench, plants, moving, holding, np.random.default_rng(noise), scaled)
            except NotApplicable as reason:
                rows += [{**key, "plant": plant, "why_not": str(reason)} for plant in PLANTS]
                continue
            for plant, outcome in zip(PLANTS, outcomes(run, bench, moving), strict=True):
                rows.append({**key, "plant": plant, **outcome})
            if scaled:
                runs[name, arm] = run
    return pd.DataFrame(rows).reindex(columns=COLUMNS), runs


PLANTS = ("as modelled", "disturbed")
"""The two halves of every batch."""

PRINTED = ("gesture steering", "fixed assistance", "hybrid, learning", "virtual stiffness")
"""One controller per paper whose constants are tried as printed, too, on arms of another size."""

COLUMNS = [
    "controller", "arm", "plant", "constants", "steers", "median_mm", "median_low_mm", "median_high_mm",
    "p95_mm", "p95_low_mm", "p95_high_mm", "held_mm", "held_low_mm", "held_high_mm", "median_percent",
    "held_percent", "direction_deg", "at_limit_percent", "why_not",
]  # fmt: skip


def outcomes(run: TrackedPath, bench: Bench, moving: int) -> list[dict[str, Any]]:
    """Return the figures of merit of a run, for the undisturbed and the disturbed half of its batch."""
    error, turn = 1e3 * run.error, np.degrees(run.direction_error)
    settled = moving + (len(error) - moving) // 2
    samples = {
        "median": np.median(error[:moving], axis=0),
        "p95": np.percentile(error[:moving], 95.0, axis=0),
        "held": np.median(error[settled:], axis=0),
    }
    rows = []
    for half in np.split(np.arange(error.shape[1]), 2):
        row: dict[str, Any] = {"steers": run.steers, "why_not": ""}
        for name, values in samples.items():
            row |= dict(zip((f"{name}_mm", f"{name}_low_mm", f"{name}_high_mm"), interval(values[half])))
        row["median_percent"] = 0.1 * row["median_mm"] / bench.length
        row["held_percent"] = 0.1 * row["held_mm"] / bench.length
        row["direction_deg"] = np.median(turn[:moving, half])
        row["at_limit_percent"] = 100.0 * run.at_limit[:, half].mean()
        rows.append(row)
    return rows


def interval(samples: Array) -> tuple[float, float, float]:
    """Return mean and 95 % interval (Student) of samples over seeds."""
    mean, count = float(np.mean(samples)), len(samples)
    half = student.ppf(0.975, count - 1) * np.std(samples, ddof=1) / np.sqrt(count) if count > 1 else np.nan
    return mean, mean - half, mean + half

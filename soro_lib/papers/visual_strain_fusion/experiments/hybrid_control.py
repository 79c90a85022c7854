"""Tables I and II with their controls: what does learning add to a gain? (Wang et al., Sec. IV-D)

Each comparison runs the model-based controller for two cycles and then, from the same state and with the same
sensor noise, two cycles with each reading of Eq. (29), and with the bare quadratic gain that learns nothing.
"""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.controllers.hybrid import HybridController, HybridSettings
from soro_lib.papers.visual_strain_fusion.experiments.tracking import (
    CYCLES,
    GAINS,
    SENSOR_NOISE,
    FittedPlant,
    TrackingRun,
    load_plant,
    path_points,
    track,
)
from soro_lib.papers.visual_strain_fusion.world.plant import ChamberParameters, PneumaticPlant
from soro_lib.robots.pneumatic import PneumaticArm

Array = NDArray[np.float64]

READINGS: dict[str, HybridSettings] = {
    "literal": HybridSettings(compensation="literal"),
    "no learning": HybridSettings(compensation="quadratic"),
    "relative": HybridSettings(compensation="relative"),
    "additive": HybridSettings(compensation="additive"),
    "actual motion": HybridSettings(compensation="literal", trained_on="actual"),
}
"""Readings of Eq. (29): the printed one, the control without learning, and three others."""


@dataclass(frozen=True)
class Comparison:
    """Runs of one path: tips are ``(steps, seeds, gains, 2)``.

    Attributes
    ----------
    path : str
        Name of the path.
    points : ndarray (n, 2)
        One cycle of it [m].
    model : TrackingRun
        Model-based cycles, from rest.
    compensated : dict of TrackingRun
        Cycles after them, by reading.
    """

    path: str
    points: Array
    model: TrackingRun
    compensated: dict[str, TrackingRun]

    @property
    def runs(self) -> dict[str, TrackingRun]:
        """All runs by controller, the model-based one first."""
        return {"model": self.model, **self.compensated}


def compare_controllers(
    path: str,
    rng: np.random.Generator,
    *,
    seeds: int = 10,
    cycles: int = CYCLES,
    readings: Mapping[str, HybridSettings] = READINGS,
    plant: FittedPlant | None = None,
    maximum_step: float = 3e-3,
    spread: float = 0.0,
    noise: float = SENSOR_NOISE,
    steps: int | None = None,
) -> Comparison:
    """Run the model-based controller and every reading of the compensator on one path, for all four gains.

    Parameters
    ----------
    path : str
        "pentagram" or "circle".
    rng : numpy.random.Generator
        Draws the noise of the position sensor, and the plants if they differ.
    seeds : int
        Number of repetitions.
    cycles : int
        Cycles of either phase; the paper runs two.
    readings : mapping of HybridSettings
        Compensators by name.
    plant : FittedPlant, optional
        The plant; by default the one fitted under the 3 mm cap.
    maximum_step : float
        Cap on the desired step [m].
    spread : float
        Spread of the plant parameters from seed to seed, as a standard deviation of logarithms [-].
    noise : float
        Standard deviation of the position sensor per axis [m].
    steps : int, optional
        Points of a cycle, as in `path_points`.
    """
    plant = plant or load_plant(path)
    points = path_points(path, plant.rotation, steps)
    targets = np.tile(points, (cycles, 1))
    batch = (seeds, len(GAINS))
    base = HybridSettings(proportional_gain=np.array(GAINS), maximum_step=maximum_step, compensation="none")
    arm = PneumaticArm()
    robots = PneumaticPlant(arm, _vary(plant.chambers, seeds, spread, rng), batch=batch)
    # The compensators see the last steps of the model-based cycles, which is all that their windows hold.
    shared = len(targets) - max((settings.window + 1 for settings in readings.values()), default=0)
    first = track(
        robots,
        HybridController(arm, base, batch),
        targets[:shared],
        compensating=False,
        rng=rng,
        noise=noise,
    )
    compensated, last = {}, None
    for name, reading in readings.items():
        settings = replace(reading, proportional_gain=base.proportional_gain, maximum_step=maximum_step)
        controller, body, chance = HybridController(arm, settings, batch), deepcopy(robots), deepcopy(rng)
        last = track(body, controller, targets[shared:], compensating=False, rng=chance, noise=noise)
        compensated[name] = track(body, controller, targets, compensating=True, rng=chance, noise=noise)
    tips = first.tip if last is None else np.concatenate([first.tip, last.tip])
    return Comparison(path, points, TrackingRun(tips, targets, first.saturated), compensated)


def _vary(
    chambers: ChamberParameters, seeds: int, spread: float, rng: np.random.Generator
) -> ChamberParameters:
    """Plants that differ from seed to seed; the same for all gains of a seed."""
    if spread == 0.0:
        return chambers
    factors = {
        name: getattr(chambers, name) * np.exp(rng.normal(0.0, spread, (seeds, 1, 1)))
        for name in ("gain", "resolution", "play", "dead_band", "softness", "exponent", "suction")
    }
    return ChamberParameters(**factors)


def summarise(comparison: Comparison) -> pd.DataFrame:
    """Errors of every run: one row per controller, gain and seed, in millimetres and percent.

    Returns
    -------
    pandas.DataFrame
        Columns path, controller, gain, seed, error_mm, error_sd_mm, error_percent (of 3 mm),
        deviation_mm, deviation_sd_mm, deviation_percent (mean of deviation over distance of the path point
        from the start), saturated.
    """
    radius = np.linalg.norm(comparison.model.target, axis=-1)[:, None, None]
    rows = []
    for name, run in comparison.runs.items():
        error, deviation = 1e3 * run.error, 1e3 * run.deviation(comparison.points)
        percent = 100.0 * (deviation / (1e3 * radius)).mean(axis=0)
        for seed, column in np.ndindex(error.shape[1:]):
            rows.append(
                {
                    "path": comparison.path,
                    "controller": name,
                    "gain": GAINS[column],
                    "seed": seed,
                    "error_mm": error[:, seed, column].mean(),
                    "error_sd_mm": error[:, seed, column].std(),
                    "error_percent": 100.0 * error[:, seed, column].mean() / 3.0,
                    "deviation_mm": deviation[:, seed, column].mean(),
                    "deviation_sd_mm": deviation[:, seed, column].std(),
                    "deviation_percent": percent[seed, column],
                    "saturated": run.saturated,
                }
            )
    return pd.DataFrame(rows)


def improvements(summary: pd.DataFrame) -> pd.DataFrame:
    """Reduction of mean error and deviation against the model-based run of the same seed [%]."""
    keys = ["path", "gain", "seed"]
    model = summary[summary.controller == "model"]
    table = summary[summary.controller != "model"].merge(model, on=keys, suffixes=("", "_model"))
    for measure in ("error", "deviation"):
        reduction = 1.0 - table[f"{measure}_mm"] / table[f"{measure}_mm_model"]
        table[f"{measure}_improvement_percent"] = 100.0 * reduction
    return table[[*keys, "controller", "error_improvement_percent", "deviation_improvement_percent"]]


def interval(values: Sequence[float], rng: np.random.Generator, resamples: int = 2000) -> tuple[float, float]:
    """Bootstrap interval (95 %) of the mean over seeds."""
    means = rng.choice(np.asarray(values, dtype=float), (resamples, len(values))).mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)


def learning_against_no_learning(summary: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Set the printed compensator beside the bare quadratic gain, seed by seed.

    Returns
    -------
    pandas.DataFrame
        One row per measure (tracking error, path deviation), path and gain: means [mm] of the model, of the
        compensator and of the quadratic gain without learning, the paired difference compensator minus no
        learning with its 95 % interval, and the share of the improvement that the gain alone has [%].
    """
    rows = []
    for measure in ("error", "deviation"):
        for (path, gain), group in summary.groupby(["path", "gain"], sort=False):
            wide = group.pivot(index="seed", columns="controller", values=f"{measure}_mm")
            difference = wide["literal"] - wide["no learning"]
            low, high = interval(difference.tolist(), rng)
            gained = (wide["model"] - wide["no learning"]) / (wide["model"] - wide["literal"])
            rows.append(
                {
                    "measure": measure,
                    "path": path,
                    "gain": gain,
                    "model_mm": wide["model"].mean(),
                    "with_learning_mm": wide["literal"].mean(),
                    "no_learning_mm": wide["no learning"].mean(),
                    "difference_mm": difference.mean(),
                    "difference_low_mm": low,
                    "difference_high_mm": high,
                    "gain_alone_percent": 100.0 * gained.mean(),
                }
            )
    return pd.DataFrame(rows)

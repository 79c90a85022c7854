"""Tables I and II with their controls: what does learning add to a gain? (Wang et al., Sec. IV-D)

Each comparison runs the model-based controller for two cycles and then, from the same state and with the same
sensor noise, two cycles with each reading of Eq. (29), and with the bare quadratic gain that learns nothing.
"""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from soro_lib.controllers.hybrid import HybridController, HybridSettings
from soro_lib.papers.visual_strain_fusion.experiments import tracking
from soro_lib.papers.visual_strain_fusion.experiments.tracking import GAINS, FittedPlant, TrackingRun, track
from soro_lib.papers.visual_strain_fusion.world.plant import Array, ChamberParameters, PneumaticPlant
from soro_lib.robots.pneumatic import PneumaticArm

READINGS: dict[str, HybridSettings] = {
    "literal": HybridSettings(compensation="literal"),
    "no learning": HybridSettings(compensation="quadratic"),
    "relative": HybridSettings(compensation="relative"),
    "additive": HybridSettings(compensation="additive"),
    "actual motion": HybridSettings(compensation="literal", trained_on="actual"),
}
"""Readings of Eq. (29): the printed one, the control without learning, and three others."""

MEASURES = ("error", "deviation")
"""Distance of the tip from its target, and from the closest point of the path."""


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
    cycles: int = tracking.CYCLES,
    readings: Mapping[str, HybridSettings] = READINGS,
    plant: FittedPlant | None = None,
    maximum_step: float = 3e-3,
    spread: float = 0.0,
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
    steps : int, optional
        Points of a cycle, as in `path_points`.
    """
    plant = plant or tracking.load_plant(path)
    points = tracking.path_points(path, plant.rotation, steps)
    targets = np.tile(points, (cycles, 1))
    batch = (seeds, len(GAINS))
    base = HybridSettings(proportional_gain=np.array(GAINS), maximum_step=maximum_step, compensation="none")
    arm = PneumaticArm()
    robots = PneumaticPlant(arm, _vary(plant.chambers, seeds, spread, rng), batch=batch)
    # The compensators see the last steps of the model-based cycles, which is all that their windows hold.
    shared = len(targets) - max((settings.window + 1 for settings in readings.values()), default=0)
    first = track(robots, HybridController(arm, base, batch), targets[:shared], compensating=False, rng=rng)
    compensated, last = {}, None
    for name, reading in readings.items():
        settings = replace(reading, proportional_gain=base.proportional_gain, maximum_step=maximum_step)
        controller, body, chance = HybridController(arm, settings, batch), deepcopy(robots), deepcopy(rng)
        last = track(body, controller, targets[shared:], compensating=False, rng=chance)
        compensated[name] = track(body, controller, targets, compensating=True, rng=chance)
    tips = first.tip if last is None else np.concatenate([first.tip, last.tip])
    return Comparison(path, points, TrackingRun(tips, targets), compensated)


def _vary(
    chambers: ChamberParameters, seeds: int, spread: float, rng: np.random.Generator
) -> ChamberParameters:
    """Plants that differ from seed to seed; the same for all gains of a seed."""
    if spread == 0.0:
        return chambers
    varied = {}
    for name, value in vars(chambers).items():
        varied[name] = value * np.exp(rng.normal(0.0, spread, (seeds, 1, 1)))
    return ChamberParameters(**varied)


def summarise(comparison: Comparison) -> pd.DataFrame:
    """Errors of every run: one row per controller, gain and seed, in millimetres and percent.

    Returns
    -------
    pandas.DataFrame
        Columns path, controller, gain, seed, error_mm, error_sd_mm, error_percent (of 3 mm),
        deviation_mm, deviation_sd_mm, deviation_percent (mean of deviation over distance of the path point
        from the start).
    """
    radius = np.linalg.norm(comparison.model.target, axis=-1)[:, None, None]
    tables = []
    for name, run in comparison.runs.items():
        error, deviation = 1e3 * run.error, 1e3 * run.deviation(comparison.points)
        seed, column = np.indices(error.shape[1:]).reshape(2, -1)
        keys = {"path": comparison.path, "controller": name, "gain": np.array(GAINS)[column], "seed": seed}
        table = pd.DataFrame(keys)
        for measure, values, whole in zip(MEASURES, (error, deviation), (3.0, 1e3 * radius)):
            table[f"{measure}_mm"] = values.mean(axis=0).ravel()
            table[f"{measure}_sd_mm"] = values.std(axis=0).ravel()
            table[f"{measure}_percent"] = 100.0 * (values / whole).mean(axis=0).ravel()
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def improvements(summary: pd.DataFrame) -> pd.DataFrame:
    """Reduction of mean error and deviation against the model-based run of the same seed [%]."""
    keys = ["path", "gain", "seed"]
    model = summary[summary.controller == "model"]
    table = summary[summary.controller != "model"].merge(model, on=keys, suffixes=("", "_model"))
    better = table[[*keys, "controller"]].copy()
    for measure in MEASURES:
        reduction = 1.0 - table[f"{measure}_mm"] / table[f"{measure}_mm_model"]
        better[f"{measure}_improvement_percent"] = 100.0 * reduction
    return better


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
    for measure in MEASURES:
        for (path, gain), group in summary.groupby(["path", "gain"], sort=False):
            wide = group.pivot(index="seed", columns="controller", values=f"{measure}_mm")
            model, literal, bare = wide["model"], wide["literal"], wide["no learning"]
            difference = literal - bare
            resampled = rng.choice(difference.to_numpy(), (2000, len(difference))).mean(axis=1)
            interval = np.percentile(resampled, [2.5, 97.5])
            gained = 100.0 * ((model - bare) / (model - literal)).mean()
            means = (values.mean() for values in (model, literal, bare, difference))
            rows.append((measure, path, gain, *means, *interval, gained))
    means_mm = ["model_mm", "with_learning_mm", "no_learning_mm", "difference_mm"]
    interval_mm = ["difference_low_mm", "difference_high_mm"]
    columns = ["measure", "path", "gain", *means_mm, *interval_mm, "gain_alone_percent"]
    return pd.DataFrame(rows, columns=columns)

"""Whole handovers through rendered images: Experiment 1 with nothing between the arm and its cameras.

Every block of eight runs has its own calibration of the cameras. The controller and the arm are those of
:mod:`soro_lib.papers.soft_handover.experiments.handover`; only the eyes differ.
"""

import numpy as np
import pandas as pd

from soro_lib.papers.soft_handover.beyond import best_controller
from soro_lib.papers.soft_handover.experiments.handover import Blocks, Settings, compare, thesis_parameters
from soro_lib.papers.soft_handover.world.observer import RenderedObserver, calibrate_on_box
from soro_lib.papers.soft_handover.world.plant import HelixPlant
from soro_lib.papers.soft_handover.world.scene import STEREO
from soro_lib.sensing.handover_vision import HandoverVision

BEST: Settings = [({"controller": "best", "alpha": 1.0}, best_controller())]
"""The best controller found."""

CONTROLLERS: Settings = [
    *(
        ({"controller": f"thesis, step {alpha}", "alpha": alpha}, thesis_parameters(alpha))
        for alpha in (0.1, 0.2, 0.3, 0.4)
    ),
    *BEST,
]
"""The thesis's controller at every step size, and the best one found."""


def rendered_block(
    plant_name: str, plant: HelixPlant, estimator: str, block: int, seed: int, settings: Settings
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return runs and traces of one block: eight runs of every controller, seen through one calibration.

    Parameters
    ----------
    plant_name : str
    plant : HelixPlant
    estimator : str
        "thesis", "gated" or "joint".
    block : int
        Number of the block: another calibration, other places of the ball, the same for all controllers.
    seed : int
    settings : sequence
        The controllers.

    Returns
    -------
    runs, traces : DataFrame
        As of :func:`soro_lib.papers.soft_handover.experiments.handover.handovers`, with plant,
        estimator, controller and alpha.
    """
    selection, places = np.random.SeedSequence((seed, block)).spawn(2)
    cameras = calibrate_on_box(STEREO, np.random.default_rng(selection))
    observer = RenderedObserver(HandoverVision(cameras, estimator))
    place_seed = int(places.generate_state(1)[0])
    tables = compare(settings, {plant_name: plant}, Blocks(observer, 1, place_seed), estimator=estimator)
    runs, traces = (table.assign(block=block) for table in tables)
    return runs, traces


def run_summary(runs: pd.DataFrame) -> pd.DataFrame:
    """Return steps, success and final miss per plant, estimator and controller."""
    groups = runs.groupby(["plant", "estimator", "controller"], sort=False)
    return groups.agg(
        runs=("steps", "size"),
        steps_median=("steps", "median"),
        steps_min=("steps", "min"),
        steps_max=("steps", "max"),
        success=("success", "mean"),
        miss_median_mm=("miss_mm", "median"),
    ).reset_index()

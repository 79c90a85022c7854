"""The best controller found, against the thesis's."""

import pandas as pd

from soro_lib.papers.soft_handover import beyond as improvements
from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments import handover
from soro_lib.papers.soft_handover.world.observer import NoisyObserver, load_vision_noise
from soro_lib.papers.soft_handover.world.plant import ElasticPlant

EYES = NoisyObserver(load_vision_noise("thesis"))
PLANTS = {"K": plant_k(), "E": ElasticPlant()}


def test_best_controller_beats_the_thesis_in_steps_and_distance():
    runs = pd.concat(
        handover.handovers(parameters, PLANTS["K"], handover.Blocks(EYES, 2, 3), controller=name, plant="K")[
            0
        ]
        for name, parameters in (
            ("thesis", handover.thesis_parameters(0.4)),
            ("best", improvements.best_controller()),
        )
    )
    table = improvements.summary(runs, ["plant", "controller"]).set_index("controller")
    assert table.loc["best", "steps"] < 0.6 * table.loc["thesis", "steps"]
    assert table.loc["best", "miss_mm"] < table.loc["thesis", "miss_mm"]
    assert table.loc["best", "success"] >= 0.9

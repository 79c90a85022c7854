"""Experiment 3: the ball ends in the bowl."""

from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments import handover, use_case
from soro_lib.papers.soft_handover.world.observer import NoisyObserver, load_vision_noise
from soro_lib.papers.soft_handover.world.plant import ElasticPlant

EYES = NoisyObserver(load_vision_noise("thesis"))
PLANTS = {"K": plant_k(), "E": ElasticPlant()}


def test_the_ball_is_carried_to_the_bowl():
    runs = use_case.use_cases(
        handover.thesis_parameters(0.2), PLANTS["K"], handover.Blocks(EYES, 1, 1), plant="K"
    )
    assert runs["dropped"].sum() >= 7
    assert (runs.loc[runs["dropped"], "bowl_miss_mm"] <= 60).all()

"""Whatever is wrong, the arm stays within its limits and goes home."""

import pytest

from soro_lib.papers.soft_handover import beyond as improvements
from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments import faults, handover
from soro_lib.papers.soft_handover.world.observer import NoisyObserver, load_vision_noise
from soro_lib.papers.soft_handover.world.plant import ElasticPlant

EYES = NoisyObserver(load_vision_noise("thesis"))
PLANTS = {"K": plant_k(), "E": ElasticPlant()}


@pytest.mark.parametrize("plant", ["K", "E"])
def test_no_fault_brings_a_command_outside_the_limits(plant):
    chosen = faults.all_faults()[3::6]
    runs = faults.run_faults(
        improvements.best_controller(), PLANTS[plant], handover.Blocks(EYES, 1, 1), chosen, step_limit=60
    )
    assert runs["violations"].sum() == 0
    assert set(runs["outcome"]) <= {"handover", "safe stop", "beside the ball", "out of time"}


@pytest.mark.parametrize("name", ["ring hidden", "ball lost", "cameras frozen", "NaN"])
def test_the_severest_loss_of_sight_ends_at_home(name):
    severest = [fault for fault in faults.all_faults() if fault.name == name][-1]
    runs = faults.run_faults(
        handover.thesis_parameters(0.2), PLANTS["K"], handover.Blocks(EYES, 1, 1), [severest]
    )
    assert set(runs["outcome"]) == {"safe stop"}

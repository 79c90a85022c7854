"""The task for a hand from outside, and its settings."""

import numpy as np
import pytest

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control.experiments.simulation import (
    TrialPlan,
    trace_trial,
)
from soro_lib.papers.shared_control.experiments.task import Scene, TaskSettings, Trial
from soro_lib.papers.shared_control.world.people import EXPERT


def columns(trace, name):
    return trace[[column for column in trace if column.startswith(name)]].to_numpy()


def test_a_trial_from_outside_is_the_simulated_one():
    """Replaying a simulated operator's commands and button through `Trial` gives the same trial."""
    settings = TaskSettings(PARADIGMS["assist_as_needed"])
    plan = TrialPlan(settings, EXPERT, (5,))
    trace = trace_trial(plan)
    trial = Trial(settings, np.random.default_rng(1))
    commands = columns(trace, "command_")
    samples = [
        trial.step(command, bool(closed)) for command, closed in zip(commands, trace["closed"], strict=True)
    ]
    np.testing.assert_array_equal([sample.tip for sample in samples], columns(trace, "tip_"))
    np.testing.assert_array_equal([sample.force for sample in samples], columns(trace, "force_"))
    assert [sample.done for sample in samples] == [False] * (len(samples) - 1) + [True]


def test_a_sample_that_is_not_a_number_holds_the_last_command():
    trial = Trial(TaskSettings(), np.random.default_rng(1))
    good = trial.step((0.1, 0.0, 0.5), gripper_closed=False)
    held = trial.step((np.nan, 0.0, 0.5), gripper_closed=False)
    assert not good.held_command
    assert held.held_command
    np.testing.assert_array_equal(held.desired, [0.1, 0.0, 0.5])
    with pytest.raises(ValueError, match=r"command must have shape \(3,\)"):
        trial.step((0.0, 1.0), gripper_closed=False)


def test_the_real_arm_waits_for_the_operator_to_report_the_item():
    trial = Trial(
        TaskSettings(environment="real", scene=Scene(start=(-0.095, 0.117, 0.64))), np.random.default_rng(1)
    )
    here = (-0.095, 0.117, 0.645)
    assert trial.step(here, True, confirm=False).item == 0
    assert trial.step(here, True, confirm=False).phase == "grasping"
    assert trial.step(here, True, confirm=True).phase == "placing"


def test_a_dropped_item_falls_and_can_be_fetched():
    trial = Trial(TaskSettings(PARADIGMS["msae"]), np.random.default_rng(1))
    here = (-0.095, 0.117, 0.645)
    for _ in range(800):
        trial.step(here, False)
    for _ in range(30):
        sample = trial.step(here, True)
    assert sample.phase == "lifting with item"
    sample = trial.step(here, False)
    assert sample.phase == "grasping"
    np.testing.assert_allclose(sample.goal, [*sample.tip[:2], 0.645])
    np.testing.assert_allclose(sample.items[0], sample.goal)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"environment": "imagined"}, "environment must be"),
        ({"force_law": "guessed"}, "force_law must be"),
        ({"scene": Scene(items=((0.0, 0.0, 3.0), (0.0, 0.0, 0.6)))}, r"items\[0\] is out of reach"),
        ({"assist_as_needed": {"maximum_force": -1.0}}, "maximum_force"),
        ({"detection_error": (np.nan, 0.0, 0.0)}, "detection_error must be finite"),
    ],
)
def test_bad_settings_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        TaskSettings(**options).rule()

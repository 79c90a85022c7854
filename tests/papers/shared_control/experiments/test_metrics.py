"""The metrics against the equations as printed and as meant."""

import numpy as np
import pandas as pd
import pytest

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control.experiments.metrics import (
    mean_assistance,
    placement_error,
    trajectory_length,
)
from soro_lib.papers.shared_control.experiments.simulation import (
    METRICS,
    TRACE,
    TrialPlan,
    play_trial,
    trial_metrics,
)
from soro_lib.papers.shared_control.experiments.task import TaskSettings
from soro_lib.papers.shared_control.world.people import EXPERT


def columns(trace, name):
    return trace[[column for column in trace if column.startswith(name)]].to_numpy()


def test_metrics_of_the_loop_are_the_equations():
    settings = TaskSettings(PARADIGMS["fixed_assistance"])
    plan = TrialPlan(settings, EXPERT, (5,))
    rule = settings.rule()
    trace = np.empty((24000, len(TRACE)))
    state, memory = play_trial(plan, rule, 24000, trace)
    metrics = dict(zip(METRICS, trial_metrics(rule, state, memory), strict=True))
    table = pd.DataFrame(trace[: state.sample], columns=list(TRACE))
    tips = np.vstack([settings.scene.start, columns(table, "tip_")])
    assert metrics["path_m"] == pytest.approx(trajectory_length(tips))
    force = mean_assistance(columns(table, "force_"), table["time_s"])
    assert metrics["assistance_n"] == pytest.approx(force)
    placed = 1e3 * placement_error(memory.items, settings.scene.targets)
    assert metrics["placement_error_mm"] == pytest.approx(placed)
    assert metrics["item1_time_s"] + metrics["item2_time_s"] == pytest.approx(metrics["time_s"])


def test_printed_path_integral_is_only_the_displacement():
    angle = np.linspace(0, 2 * np.pi, 1001)
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    assert trajectory_length(circle) == pytest.approx(2 * np.pi, rel=1e-4)
    np.testing.assert_allclose(np.diff(circle, axis=0).sum(axis=0), 0.0, atol=1e-12)


def test_printed_assistance_and_error_need_the_norm_and_the_index():
    forces = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    assert mean_assistance(forces, [1.0, 2.0]) == 1.0
    np.testing.assert_array_equal(forces.mean(axis=0), 0.0)
    items = np.array([[0.0, 0.0, 0.6], [1.0, 0.0, 0.6]])
    assert placement_error(items, items) == 0.0  # eq. (11) prints one target t for both items
    assert placement_error(items, np.tile(items[0], (2, 1))) == 0.5


def test_metrics_refuse_bad_records():
    with pytest.raises(ValueError, match=r"times must increase strictly, got 1\.0 after 1\.0 at index 2"):
        mean_assistance(np.zeros((2, 3)), [1.0, 1.0])
    with pytest.raises(ValueError, match=r"tips must be finite, got nan at index \(1, 1\)"):
        trajectory_length([[0, 0, 0], [0, np.nan, 0]])
    with pytest.raises(ValueError, match=r"items must have shape \(n, 3\)"):
        placement_error([0.0], [0.0])

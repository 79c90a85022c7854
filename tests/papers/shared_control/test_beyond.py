"""Sweeps, anyone at the controls, and the stability of the guided hand."""

import numpy as np
import pytest

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control import beyond
from soro_lib.papers.shared_control.experiments import demonstrations
from soro_lib.papers.shared_control.experiments.simulation import person_plans, simulate
from soro_lib.papers.shared_control.experiments.task import TaskSettings
from soro_lib.papers.shared_control.world.hand import pull_axis
from soro_lib.papers.shared_control.world.people import EXPERT
from soro_lib.papers.shared_control.world.plant import simulated_tip


def swings(stiffness, hand_stiffness, delay):
    """Whether a hand pushed by guidance of this stiffness ends swinging more widely than it began."""
    operator = EXPERT.__class__(hand_stiffness=hand_stiffness)
    position, velocity, tip = 0.001, 0.0, (0.0, 0.0, 0.0)
    waiting, path = [0.0] * (round(delay / 0.01) + 1), []
    for _ in range(3000):
        waiting.append(tip[2])
        force = -stiffness * waiting.pop(0)
        position, velocity, _ = pull_axis(operator, position, velocity, 0.0, force)
        tip = simulated_tip(tip, (0.0, 0.0, 15.0 * position), 0.99)
        path.append(position)
    return np.abs(path[-500:]).max() > np.abs(path[500:1000]).max()


@pytest.mark.parametrize(
    ("hand_stiffness", "delay"), [(50.0, 0.0), (150.0, 0.0), (150.0, 0.15), (300.0, 0.3)]
)
def test_critical_stiffness_divides_calm_from_swinging(hand_stiffness, delay):
    critical = beyond.critical_stiffness(hand_stiffness, delay)
    assert not swings(0.85 * critical, hand_stiffness, delay)
    assert swings(1.15 * critical, hand_stiffness, delay)


def test_critical_stiffness_without_delay_is_that_of_routh():
    mass, damping, hand, lag, scale = 0.6, 6.5, 150.0, 0.99, 15.0
    routh = ((mass + damping * lag) * (damping + hand * lag) / (lag * mass) - hand) / scale
    assert beyond.critical_stiffness(hand) == pytest.approx(routh, rel=1e-9)


@pytest.mark.parametrize("delay", [0.0, 0.15])
def test_passive_stiffness_is_where_the_least_real_part_is_covered(delay):
    frequency = np.logspace(-4, 3, 4000)
    s = 1j * frequency
    stiffness = beyond.passive_stiffness(delay)
    impedance = stiffness * 15.0 * np.exp(-s * delay) / (s * (0.99 * s + 1)) + 6.5
    assert impedance.real.min() == pytest.approx(0.0, abs=1e-3)
    assert np.all(impedance.real > -1e-6)


def test_stability_map_covers_its_grid_and_refuses_nonsense():
    table = beyond.stability_map([50, 500], [0.0, 0.1, 0.2])
    assert len(table) == 12
    assert (table.groupby(["axis", "delay_s"])["critical_stiffness_n_per_m"].diff().dropna() > 0).all()
    with pytest.raises(ValueError, match="hand_stiffness"):
        beyond.critical_stiffness(0.0)
    with pytest.raises(ValueError, match="delay"):
        beyond.critical_stiffness(100.0, -0.1)


def test_blend_has_the_paradigms_in_its_corners():
    blend = beyond.blend_surface(1, 3, (0.0, 1.0), ("expert",))
    people = demonstrations.draw_operators("expert", 1, 3)
    cases = {
        (0.0, 0.0): "full_teleoperation",
        (0.0, 1.0): "msae",
        (1.0, 0.0): "asme",
        (1.0, 1.0): "mostly_autonomous",
    }
    for (steering, eversion), name in cases.items():
        alone = simulate(person_plans(TaskSettings(PARADIGMS[name]), people, (3, 4), 1, {}))
        cell = blend[(blend["steering"] == steering) & (blend["eversion"] == eversion)]
        assert cell["time_s"].item() == alone["time_s"].item()


def test_a_wrong_goal_costs_only_where_the_machine_steers():
    table = beyond.misdetection_cost(2, 1, (0.0, 0.03))
    cost = table.pivot_table(index=["kind", "operator", "paradigm"], columns="offset_mm", values="time_s")
    change = (cost[30.0] - cost[0.0]).unstack()
    assert (change[["full_teleoperation", "msae"]] == 0).all(axis=None)
    assert (change["mostly_autonomous"] > 1).all()


def test_noise_dwell_and_lifts():
    noise = beyond.tracking_noise_effect(3, 1, (0.0, 0.0005)).groupby("noise_mm")["assistance_n"].mean()
    assert noise[0.5] < 0.1 * noise[0.0]
    dwell = beyond.dwell_effect(1, 1, (0.4, 1.5)).groupby("dwell_s")["time_s"].mean()
    assert dwell[1.5] > dwell[0.4]
    lifts = beyond.lift_effect(2, 1).groupby("case")["time_s"].mean()
    assert lifts["without lifts"] < lifts["Mostly autonomous"] - 2


def test_passive_operators_are_slow():
    table = beyond.passivity_effect(1, (0.0, 0.8), 1 + 1)
    assert table.groupby("passivity")["mean_time_s"].first().diff().iloc[-1] > 30
    assert (table["low"] <= table["high"]).all()


def test_hypercube_fills_its_ranges():
    people = beyond.draw_anyone(64, 1)
    for name, (low, high) in beyond.RANGES.items():
        values = np.sort([getattr(person, name) for person in people])
        assert low <= values[0] < low + (high - low) / 64
        assert high - (high - low) / 64 < values[-1] <= high
    correlations, held = beyond.sensitivity(8, 1, trials=1)
    assert correlations.shape == (len(beyond.RANGES), 10)
    assert held["probability"].between(0, 1).all()

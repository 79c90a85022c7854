"""Algorithm 3: two stages, and what the arm does when it cannot trust its eyes."""

from dataclasses import replace

import numpy as np
import pytest

from soro_lib.controllers.handover import (
    HandoverController,
    HandoverParameters,
    Mode,
    SafetyRules,
    goal_over,
    softened_weights,
)
from soro_lib.controllers.virtual_stiffness import VirtualStiffnessController, within_limits
from soro_lib.papers.soft_handover.world.observer import NO_NOISE, NoisyObserver
from soro_lib.papers.soft_handover.world.plant import AngleLossPlant
from soro_lib.robots import HelixArm
from soro_lib.robots.helix_motors import TendonMotors
from soro_lib.sensing.handover_observation import HandoverObservation

ARM = HelixArm()
BALL = np.array([0.15, 0.0, 0.64])
CALIBRATED = ARM.tendon_lengths(ARM.home)


def parameters(**changes):
    return HandoverParameters(control=VirtualStiffnessController(step_size=0.4), **changes)


def run(controller, steps, spoil=lambda look, step: look, ball=BALL):
    """Run a loop on a sagging arm and return its commands."""
    plant, eyes, rng = AngleLossPlant((0.5, 0.5, 0.5)), NoisyObserver(NO_NOISE), np.random.default_rng(0)
    state, commands = ARM.home, []
    for step in range(steps):
        commands.append(controller.update(spoil(eyes.observe(state, ball, rng), step)))
        if commands[-1].mode in (Mode.GRASP, Mode.STOPPED):
            break
        state = plant.settle(CALIBRATED + commands[-1].tendon_change)
    return commands


def test_handover_reaches_the_ball_in_two_stages():
    commands = run(HandoverController(parameters()), 60)
    modes = [command.mode for command in commands]
    assert modes[-1] is Mode.GRASP
    assert commands[-1].gripper_closed
    assert commands[-1].error < 0.05
    descent = modes.index(Mode.DESCEND)
    assert set(modes[:descent]) == {Mode.APPROACH}
    np.testing.assert_allclose(commands[0].goal_points, goal_over(commands[0].ball, 0.05, 0.1))
    np.testing.assert_allclose(commands[descent].goal_points, goal_over(commands[descent].ball, 0.0, 0.1))
    assert commands[descent].error > commands[descent - 1].error - 0.05


def test_commands_are_tendon_lengths_relative_to_calibration():
    command = run(HandoverController(parameters()), 1)[0]
    np.testing.assert_allclose(command.tendon_change, ARM.tendon_lengths(command.q_sys) - CALIBRATED)


def test_after_the_grasp_nothing_moves():
    controller = HandoverController(parameters())
    last = run(controller, 60)[-1]
    after = controller.update(HandoverObservation(None, None, None))
    assert after.mode is Mode.GRASP
    np.testing.assert_array_equal(after.tendon_change, last.tendon_change)


def test_carrying_needs_no_ball_in_sight_and_ends_with_an_open_gripper():
    controller = HandoverController(parameters())
    run(controller, 60)
    controller.carry_to([-0.1, 0.0, 0.66])
    assert controller.gripper_closed
    plant, eyes, rng = AngleLossPlant((0.5, 0.5, 0.5)), NoisyObserver(NO_NOISE), np.random.default_rng(0)
    state = plant.settle(ARM.tendon_lengths(controller.q_sys))
    for _ in range(60):
        look = replace(eyes.observe(state, BALL, rng), ball=None)
        command = controller.update(look)
        if command.mode is Mode.RELEASE:
            break
        state = plant.settle(CALIBRATED + command.tendon_change)
    assert command.mode is Mode.RELEASE
    assert not command.gripper_closed


@pytest.mark.parametrize(
    "blind",
    [
        lambda step: {"wrist": None, "direction": None},
        lambda step: {"wrist": np.full(3, np.nan)},
        lambda step: {"direction": np.array([np.inf, 0, 0])},
        lambda step: {"direction": np.zeros(3)},
        lambda step: {"wrist": np.array([5.0, 0.2 * step, 0.5])},
        lambda step: {"wrist": np.array([5.0, 0.01 * step, 0.5])},
    ],
    ids=["missing", "NaN", "infinite", "no direction", "jumping about", "five metres off"],
)
def test_without_a_pose_the_arm_holds_then_goes_home(blind):
    rules = SafetyRules(hold_limit=4)
    controller = HandoverController(parameters(safety=rules))

    def spoil(look, step):
        return look if step < 3 else replace(look, **blind(step))

    commands = run(controller, 120, spoil)
    held = commands[3:7]
    assert {command.mode for command in held} == {Mode.HOLD}
    for command in held:
        np.testing.assert_array_equal(command.tendon_change, commands[2].tendon_change)
    assert commands[7].mode is Mode.RETREAT
    assert commands[-1].mode is Mode.STOPPED
    assert "held for 4 steps" in commands[-1].reason
    np.testing.assert_allclose(commands[-1].q_sys, ARM.home)
    assert all(within_limits(command.q_sys) for command in commands)


def test_a_ball_out_of_sight_is_approached_for_a_while():
    def spoil(look, step):
        return replace(look, ball=None) if step >= 2 else look

    modes = [command.mode for command in run(HandoverController(parameters()), 10, spoil)]
    assert modes[2:7] == [Mode.APPROACH] * 5
    assert modes[7] is Mode.HOLD


def test_nothing_moves_before_the_ball_has_been_seen():
    commands = run(HandoverController(parameters()), 3, lambda look, step: replace(look, ball=None))
    assert {command.mode for command in commands} == {Mode.HOLD}
    np.testing.assert_allclose(commands[-1].tendon_change, 0, atol=1e-15)


def test_frozen_cameras_are_noticed():
    kept = []

    def spoil(look, step):
        kept.append(look)
        return kept[min(step, 3)]

    commands = run(HandoverController(parameters()), 12, spoil)
    assert commands[5].reason == "the cameras are frozen"
    assert commands[11].mode is Mode.HOLD


def test_a_ball_that_jumps_is_believed_after_a_few_looks():
    aside = np.array([0.0, 0.25, 0.0])
    commands = run(
        HandoverController(parameters()),
        8,
        lambda look, step: replace(look, ball=look.ball + aside * (step >= 2)),
    )
    assert np.linalg.norm(commands[3].ball - BALL) < 0.01
    assert np.linalg.norm(commands[7].ball - BALL) > 0.2


def test_a_ball_the_cameras_disagree_on_is_not_believed():
    def spoil(look, step):
        return replace(look, ball=look.ball + 0.05, disagreement=0.03 if step else 0.0)

    commands = run(HandoverController(parameters()), 4, spoil)
    np.testing.assert_allclose(commands[3].ball, commands[0].ball)


def test_a_ball_out_of_reach_ends_at_home():
    rules = SafetyRules(patience=15)
    commands = run(HandoverController(parameters(safety=rules)), 200, ball=np.array([0.8, 0.0, 0.6]))
    assert commands[-1].mode is Mode.STOPPED
    assert "no progress" in commands[-1].reason
    assert all(within_limits(command.q_sys) for command in commands)


def test_commands_stay_within_the_motors_range():
    motors = TendonMotors(shortest=(-0.01,) * 9, longest=(0.01,) * 9)
    commands = run(HandoverController(parameters(motors=motors)), 30)
    assert max(np.abs(command.tendon_change).max() for command in commands) <= 0.01


def test_softened_weights_fall_with_the_bends_above():
    weights = softened_weights([0, 0, 0.1, 0.6, 0.8, 0.2, 0, 0, 0.2], np.ones(9), 0.5)
    np.testing.assert_allclose(weights, np.repeat([1, 1 / 1.5, 1 / 1.5], 3))


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: SafetyRules(hold_limit=0), "hold_limit"),
        (lambda: SafetyRules(retreat_share=1.5), "retreat_share"),
        (lambda: HandoverParameters(pose_bound=0), "pose_bound"),
        (lambda: HandoverParameters(stop_threshold=np.nan), "stop_threshold"),
        (lambda: HandoverParameters(grasp_offset=-0.1), "grasp_offset"),
        (lambda: HandoverParameters(pose_weights=(1.0,)), "pose_weights"),
    ],
)
def test_bad_parameters_are_named(build, message):
    with pytest.raises(ValueError, match=message):
        build()

"""Algorithm 1 follows a hand, and no fault of the tracker makes the arm jump, change mode or break."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.controllers import GestureSteering
from soro_lib.controllers.gesture_steering import SteeringSettings, replay
from soro_lib.controllers.gestures import Gesture
from soro_lib.controllers.hand_mapping import PalmMapping
from soro_lib.controllers.obstacles import Sphere, smallest_clearance
from soro_lib.controllers.steering_step import Step, StepWeights
from soro_lib.papers.gesture_steering.experiments import robustness
from soro_lib.papers.gesture_steering.experiments.robustness import (
    FAULTS,
    mode_changes,
    run_with_fault,
    tip_speeds,
)
from soro_lib.project import ROOT
from soro_lib.robots import CableDrivenArm, PneumaticArm
from soro_lib.robots.cable_driven_kernels import generic_kinematics
from soro_lib.sensing import load_hand_recording
from soro_lib.sensing.hand_tracking import HandSample, hand_samples

REAL = ROOT.parent / "shared" / "recordings"
ARM = CableDrivenArm()
PERIOD = 0.0087
FLAT = HandSample(0.0, 1, (0.03, 0.2, 0.02), (0.0, -1.0, 0.0), (True,) * 5)
VECTORS = {
    Gesture.PALM: (True,) * 5,
    Gesture.FIST: (False,) * 5,
    Gesture.V_SIGN: (False, True, True, False, False),
    Gesture.THUMBS_UP: (True, False, False, False, False),
}


def held(steering, sample, duration, start):
    """Hold one hand still; return the last result and the time after."""
    for index in range(round(duration / PERIOD)):
        result = steering.update(replace(sample, time=start + index * PERIOD))
    return result, start + round(duration / PERIOD) * PERIOD


def check_sound(results, settings=None):
    """Check what must hold whatever the tracker sends."""
    settings = settings or SteeringSettings()
    for result in results:
        assert np.isfinite(result.actuation).all()
        assert (result.actuation >= ARM.lower).all()
        assert (result.actuation <= ARM.upper).all()
        assert np.isfinite(result.tip).all()
        assert bool(result.reason) != result.converged
    assert (tip_speeds(results) <= settings.tip_speed * (1 + 1e-6)).all()
    for first, second in pairwise(results):
        if second.time > first.time:
            most = settings.cable_rate * min(second.time - first.time, settings.longest_interval)
            assert np.abs(second.actuation[1:] - first.actuation[1:]).max() <= most + 1e-9


# --- the algorithm ------------------------------------------------------------------------------------------


def test_algorithm_1_follows_a_hand():
    steering = GestureSteering(ARM)
    result, _ = held(steering, replace(FLAT, normal=(0.2, -math.sqrt(0.96), 0.0)), 3.0, 0.0)
    np.testing.assert_allclose(result.goal.position, (0.006, -0.004, 0.110))
    np.testing.assert_allclose(result.tip, result.goal.position, atol=1e-5)
    np.testing.assert_allclose(result.direction, (0.2, 0.0, math.sqrt(0.96)), atol=1e-4)
    np.testing.assert_allclose(result.tip, ARM.tip(result.actuation), atol=1e-12)
    assert result.converged
    assert result.position_error < 1e-5


def test_v_sign_keeps_only_the_height():
    sample = replace(FLAT, normal=(0.3, -math.sqrt(0.91), 0.0), fingers=VECTORS[Gesture.V_SIGN])
    result, _ = held(GestureSteering(ARM), sample, 3.0, 0.0)
    assert result.mode is Gesture.V_SIGN
    np.testing.assert_allclose(result.tip, (0, 0, 0.11), atol=1e-5)
    np.testing.assert_allclose(result.direction[0], 0.3, atol=1e-3)


def test_thumbs_up_is_straight():
    sample = replace(FLAT, normal=(0.3, -math.sqrt(0.91), 0.0), fingers=VECTORS[Gesture.THUMBS_UP])
    result, _ = held(GestureSteering(ARM), sample, 3.0, 0.0)
    np.testing.assert_allclose(result.tip, (0, 0, 0.11), atol=1e-5)
    np.testing.assert_allclose(result.direction, (0, 0, 1), atol=1e-4)


def test_fist_locks_the_middle_and_moves_the_tip():
    steering = GestureSteering(ARM)
    before, time = held(steering, FLAT, 3.0, 0.0)
    fist = replace(FLAT, fingers=VECTORS[Gesture.FIST])
    result, time = held(steering, fist, 0.5, time)
    assert result.mode is Gesture.FIST
    moved, _ = held(steering, replace(fist, palm=(0.06, 0.2, -0.02)), 3.0, time)
    assert np.linalg.norm(moved.mid - before.mid) < 2e-3
    assert np.linalg.norm(moved.tip - before.tip) > 5e-3


def test_nothing_happens_before_the_first_hand():
    steering = GestureSteering(ARM)
    results = [steering.update(HandSample(index * PERIOD)) for index in range(50)]
    np.testing.assert_allclose([result.tip for result in results], [results[0].tip] * 50, atol=1e-9)
    assert {result.reason for result in results} == {"no hand"}


def test_last_valid_command_is_held():
    steering = GestureSteering(ARM)
    before, time = held(steering, FLAT, 3.0, 0.0)
    outside, time = held(steering, replace(FLAT, palm=(0.0, 0.05, 0.0)), 1.0, time)
    lost, _ = held(steering, HandSample(0.0), 1.0, time)
    for result in (outside, lost):
        np.testing.assert_allclose(result.actuation, before.actuation, atol=1e-6)
        assert not result.converged


def test_direction_filter_acts_behind_the_gesture():
    """A change to thumbs-up is a ramp of the direction, not a step."""
    steering = GestureSteering(ARM)
    tilted = replace(FLAT, normal=(0.4, -math.sqrt(0.84), 0.0))
    result, time = held(steering, tilted, 3.0, 0.0)
    turns = []
    for index in range(80):
        before = result.target_direction
        result = steering.update(
            replace(tilted, time=time + index * PERIOD, fingers=VECTORS[Gesture.THUMBS_UP])
        )
        turns.append(np.degrees(np.arccos(np.clip(before @ result.target_direction, -1, 1))))
    assert result.mode is Gesture.THUMBS_UP
    assert max(turns) < 4.0
    assert sum(turns) > 20.0


def test_solver_failure_keeps_the_command(monkeypatch):
    steering = GestureSteering(ARM)
    before, time = held(steering, FLAT, 1.0, 0.0)
    failed = Step(np.zeros(7), False, "daqp stopped with flag -4")
    monkeypatch.setattr("soro_lib.controllers.gesture_steering.solve", lambda problem: failed)
    after = steering.update(replace(FLAT, time=time, palm=(0.05, 0.2, 0.0)))
    assert not after.converged
    assert after.reason == "daqp stopped with flag -4"
    np.testing.assert_array_equal(after.actuation, before.actuation)


def test_unreachable_goal_is_reported_as_an_error_not_hidden():
    far = SteeringSettings(mapping=PalmMapping(scale_x=0.9))
    result, _ = held(GestureSteering(ARM, far), replace(FLAT, palm=(0.14, 0.2, 0.0)), 5.0, 0.0)
    assert result.position_error > 5e-3
    assert np.isfinite(result.actuation).all()


def test_hard_clearance_is_kept():
    ball = Sphere((0.0, 0.0, 0.120), 0.010)
    settings = SteeringSettings(
        mapping=PalmMapping(offset=0.165), obstacles=(ball,), margin=1e-3, iterations=2, weights=StepWeights()
    )
    start = np.array([0.0, *[-0.3] * 6])
    steering = GestureSteering(ARM, settings, start)
    assert smallest_clearance(ARM, steering.actuation, ball) > 0
    rng = np.random.default_rng(0)
    time, smallest = 0.0, np.inf
    for _ in range(12):
        palm = tuple(rng.uniform((-0.12, 0.12, -0.12), (0.12, 0.39, 0.12)))
        for _ in range(30):
            time += 0.03
            result = steering.update(replace(FLAT, time=time, palm=palm))
            smallest = min(smallest, float(smallest_clearance(ARM, result.actuation, ball)))
    assert smallest > 0.0


def test_another_arm_can_be_steered():
    """A controller takes any robot: the generic kinematics drive the same algorithm."""
    slow = GestureSteering(ARM)
    slow._kinematics = generic_kinematics(ARM)
    fast = GestureSteering(ARM)
    for index in range(200):
        sample = replace(FLAT, time=index * PERIOD)
        first, second = slow.update(sample), fast.update(sample)
    np.testing.assert_allclose(first.actuation, second.actuation, atol=1e-9)


def test_a_pneumatic_arm_follows_a_hand_too():
    arm = PneumaticArm()
    height = arm.tip(arm.home)[2]
    mapping = PalmMapping(offset=height + 0.02, scale_z=-0.1, scale_x=0.1, scale_y=-0.1)
    settings = SteeringSettings(mapping=mapping, weights=StepWeights(direction=0.0))
    result, _ = held(GestureSteering(arm, settings), FLAT, 4.0, 0.0)
    np.testing.assert_allclose(result.tip, result.goal.position, atol=1e-3)


# --- robustness ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sound_samples():
    return robustness.sound_hand(np.random.default_rng(7), 12.0)


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_never_break_the_arm(sound_samples, fault):
    check_sound(run_with_fault(sound_samples, fault))


@pytest.mark.parametrize(
    "fault", ["gesture flicker, 60 ms", "unknown gesture, 1 s", "palm flip, 30 ms", "loss of 1 s"]
)
def test_faults_never_change_the_mode(sound_samples, fault):
    assert mode_changes(run_with_fault(sound_samples, fault)) == 0


def test_every_fault_is_recovered_from(sound_samples):
    table = robustness.robustness_table(sound_samples).set_index("fault")
    assert (table["recovery_ms"] < 1000.0).all()
    assert table["finite"].all()
    for fault in ("gesture flicker, 60 ms", "palm flip, 30 ms", "repeated time stamps", "second hand, 30 ms"):
        assert table.loc[fault, "deviation_mm"] < (2.0 if fault.startswith("second") else 0.5)


values = st.one_of(st.floats(-0.5, 0.5), st.sampled_from([math.nan, math.inf, -math.inf, 1e9]))
samples = st.builds(
    HandSample,
    time=st.one_of(st.floats(0, 5), st.just(math.nan)),
    hand_id=st.one_of(st.none(), st.integers(1, 3)),
    palm=st.tuples(values, values, values),
    normal=st.tuples(values, values, values),
    fingers=st.tuples(*[st.booleans()] * 5),
    velocity=st.tuples(values, values, values),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(samples, max_size=25))
def test_any_stream_whatever_gives_valid_commands(stream):
    steering = GestureSteering(ARM)
    steering.update(FLAT)
    for sample in stream:
        result = steering.update(sample)
        assert np.isfinite(result.actuation).all()
        assert (result.actuation >= ARM.lower).all()
        assert (result.actuation <= ARM.upper).all()


@settings(max_examples=40, deadline=None)
@given(st.lists(samples, max_size=25), st.lists(st.floats(1e-4, 0.3), min_size=25, max_size=25))
def test_any_stream_whatever_keeps_the_tip_within_its_speed(stream, intervals):
    steering = GestureSteering(ARM)
    times = np.cumsum(intervals)
    timed = [replace(sample, time=float(time)) for sample, time in zip(stream, times)]
    check_sound([steering.update(sample) for sample in (FLAT, *timed)])


@pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings are not here")
@pytest.mark.parametrize("path", sorted(REAL.glob("*.csv")), ids=lambda path: path.stem)
@pytest.mark.parametrize(
    "fault", ["none", "loss of 55 ms", "palm flip, 30 ms", "NaN palm, 0.2 s", "clock jumps back"]
)
def test_real_recordings_never_break_the_arm(path, fault):
    results = run_with_fault(list(hand_samples(load_hand_recording(path))), fault)
    check_sound(results)
    assert mode_changes(results) <= 4


@pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings are not here")
def test_open_and_fist_are_recognised_in_a_real_recording():
    table = load_hand_recording(REAL / "lmc04_open_fist.csv")
    modes = [result.mode for result in replay(GestureSteering(ARM), list(hand_samples(table)))]
    changes = [mode for index, mode in enumerate(modes) if index == 0 or mode is not modes[index - 1]]
    assert changes == [
        Gesture.PALM,
        Gesture.FIST,
        Gesture.PALM,
        Gesture.FIST,
        Gesture.PALM,
    ]


@pytest.mark.parametrize(
    "bad", [{"tip_speed": 0.0}, {"iterations": 0}, {"minimum_tension": 2.0}, {"turn_rate": math.nan}]
)
def test_bad_settings_are_named(bad):
    with pytest.raises(ValueError, match=rf"SteeringSettings\.{next(iter(bad))}"):
        SteeringSettings(**bad)


def test_bad_start_is_refused():
    with pytest.raises(ValueError, match="finite"):
        GestureSteering(ARM, actuation=[math.nan] * 7)

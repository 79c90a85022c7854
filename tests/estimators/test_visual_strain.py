"""The online estimator under everything that can go wrong: it never returns a broken pose."""

import numpy as np
import pytest

from soro_lib.estimators.extreme_learning_machine import ExtremeLearningMachine
from soro_lib.estimators.visual_strain import VisualStrainEstimator, VisualStrainSettings
from soro_lib.papers.visual_strain_fusion.world.motion import glue_fibre, spiral

STEPS = 1200


@pytest.fixture(scope="module")
def recording():
    """Spiral with noisy shifts and camera poses."""
    rng = np.random.default_rng(1)
    motion = spiral(STEPS)
    shifts = glue_fibre(rng).shift(motion.configuration, motion.elongations, rng)
    camera = motion.pose.copy()
    camera[:, :3] += rng.normal(0.0, 4e-4, (STEPS, 3))
    return motion, shifts, camera


def make_estimator(**settings):
    network = ExtremeLearningMachine(np.random.default_rng(2), hidden=60)
    return VisualStrainEstimator(network, VisualStrainSettings(initial_samples=200, **settings))


def is_sound(pose):
    return np.isfinite(pose).all() and np.isclose(np.linalg.norm(pose[3:]), 1.0)


def run(recording, change=lambda step, time, shift, camera, error: (time, shift, camera, error), **settings):
    """Feed a recording through `change`; return the estimates, all of which must be sound."""
    motion, shifts, camera = recording
    estimator = make_estimator(**settings)
    estimates = []
    for step in range(STEPS):
        sample = change(step, motion.time[step], shifts[step].copy(), camera[step].copy(), 1.0)
        estimates.append(estimator.update(*sample))
        assert is_sound(estimates[-1].pose), step
    return estimates


def error_of(recording, estimates, chosen):
    truth = recording[0].pose[chosen, :3]
    return np.linalg.norm(np.array([e.pose[:3] for e in estimates])[chosen] - truth, axis=1)


def test_camera_stands_alone_until_the_first_solution(recording):
    estimates = run(recording)
    assert all(np.isnan(e.fibre_pose).all() for e in estimates[:200])
    assert np.isfinite(estimates[200].fibre_pose).all()
    assert all(np.array_equal(e.pose[:3], e.camera_pose[:3]) for e in estimates[:200])


def test_ten_seconds_without_camera_are_bridged(recording):
    dark = slice(600, 800)

    def cover(step, time, shift, camera, error):
        return time, shift, None if dark.start <= step < dark.stop else camera, error

    estimates = run(recording, cover)
    bridged = error_of(recording, estimates, dark)
    held = np.linalg.norm(estimates[dark.start].camera_pose[:3] - recording[0].pose[dark, :3], axis=1)
    assert bridged.mean() < 0.25 * held.mean()
    assert not any(e.learned for e in estimates[dark])


@pytest.mark.parametrize("mask", [0.0, 1.137e-12])
def test_missing_gratings_never_reach_the_pose(recording, mask):
    def tear(step, time, shift, camera, error):
        if step % 7 == 0:
            shift[step % 17] = np.nan
        return time, shift, camera, error

    estimates = run(recording, tear, grating_noise=mask)
    assert error_of(recording, estimates, slice(300, STEPS)).max() < 5e-3


@pytest.mark.parametrize("fault", ["constant", "jumping"])
def test_broken_grating_in_the_dark_is_set_aside(recording, fault):
    """The mask keeps a constant or jumping grating from the pose while the camera cannot help."""
    dark = slice(700, 800)

    def tear(step, time, shift, camera, error):
        if step >= dark.start:
            shift[9] = 0.0 if fault == "constant" else 9e-11 * (step % 2)
        return time, shift, None if dark.start <= step < dark.stop else camera, error

    bare = error_of(recording, run(recording, tear), dark)
    masked = error_of(recording, run(recording, tear, grating_noise=1.137e-12), dark)
    assert masked.max() <= 1.1 * bare.max()
    assert masked.max() < 4e-3


def test_time_stamps_out_of_order_are_refused_and_said(recording):
    def shuffle(step, time, shift, camera, error):
        return time - 1.0 if step % 10 == 9 else time, shift, camera, error

    estimates = run(recording, shuffle)
    assert all("does not follow" in e.note for e in estimates[9::10])
    assert not any(e.note for e in estimates[8::10])


def test_nan_time_stamp_is_refused(recording):
    estimator = make_estimator()
    assert "does not follow" in estimator.update(np.nan, recording[1][0], recording[2][0], 1.0).note


def test_quaternion_sign_flips_change_nothing(recording):
    def flip(step, time, shift, camera, error):
        camera[3:] *= -1.0 if step % 3 else 1.0
        return time, shift, camera, error

    plain, flipped = run(recording), run(recording, flip)
    assert np.allclose([e.pose[:3] for e in plain], [e.pose[:3] for e in flipped], atol=1e-9)


@pytest.mark.parametrize("camera", [None, np.full(7, np.nan), np.zeros(7)])
def test_camera_that_never_gives_a_pose(recording, camera):
    motion, shifts, _ = recording
    estimator = make_estimator()
    for step in range(300):
        estimate = estimator.update(motion.time[step], shifts[step], camera, 1.0)
        assert is_sound(estimate.pose)
        assert not estimate.learned


def test_bad_frames_are_not_learned(recording):
    estimates = run(recording, lambda step, time, shift, camera, error: (time, shift, camera, 1.5))
    assert not any(e.learned for e in estimates)


def test_wrong_shapes_are_named():
    with pytest.raises(ValueError, match=r"shift must have shape \(17,\), got \(3,\)"):
        make_estimator().update(0.0, np.zeros(3), None, 1.0)
    with pytest.raises(ValueError, match=r"camera_pose must have shape \(7,\), got \(6,\)"):
        make_estimator().update(0.0, np.zeros(17), np.zeros(6), 1.0)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"lower": 3.0}, "lower"),
        ({"initial_samples": 0}, "initial_samples"),
        ({"agreement": np.nan}, "agreement"),
    ],
)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        VisualStrainSettings(**settings)

"""The whole eye: what it sees, and what it refuses to believe; and the one that draws its errors."""

import numpy as np
import pytest

from soro_lib.papers.soft_handover.world.observer import (
    NO_NOISE,
    NoisyObserver,
    RenderedObserver,
    VisionNoise,
    calibrate_on_box,
    load_vision_noise,
)
from soro_lib.papers.soft_handover.world.scene import SIDE_CAMERA, STEREO, Extras, HandoverScene
from soro_lib.robots import HelixArm
from soro_lib.sensing.handover_vision import ESTIMATORS, HandoverVision
from soro_lib.sensing.stereo_vision import CalibratedCamera

SCENE = HandoverScene()
BALL = np.array([-0.10, 0.06, 0.76])
EXACT = [CalibratedCamera(view.camera, view.pose) for view in STEREO]


def state(bend=-0.3):
    q = SCENE.arm.home.copy()
    q[[3, 4, 6]] = bend, 0.2, 0.2
    return q


def look(vision=None, rng=0, **options):
    observer = RenderedObserver(vision or HandoverVision(EXACT, "joint"), **options)
    return observer.observe(state(), BALL, np.random.default_rng(rng)), observer


def gripper_error(seen):
    truth = SCENE.arm.tip_points(state())
    return np.linalg.norm(seen.wrist + 0.1 * seen.direction - truth[3:])


@pytest.mark.parametrize(("estimator", "bound"), [("thesis", 0.025), ("gated", 0.010), ("joint", 0.003)])
def test_arm_and_ball_are_seen_where_they_are(estimator, bound):
    seen, observer = look(HandoverVision(EXACT, estimator))
    assert gripper_error(seen) < bound
    assert np.linalg.norm(seen.ball - BALL) < 0.003
    assert np.linalg.norm(seen.direction) == pytest.approx(1)
    assert seen.disagreement < 0.003
    assert seen.status == ""
    assert observer.images[0].shape == (720, 1280, 3)


def test_looks_repeat_with_their_seed_and_forget_on_reset():
    observer = RenderedObserver(HandoverVision(EXACT, "gated"))
    first = observer.observe(state(), BALL, np.random.default_rng(4))
    observer.reset()
    again = observer.observe(state(), BALL, np.random.default_rng(4))
    assert np.array_equal(first.wrist, again.wrist)
    assert np.array_equal(first.ball, again.ball)


def test_tracking_follows_a_moving_arm_and_finds_a_lost_one():
    observer = RenderedObserver(HandoverVision(EXACT, "joint"))
    rng = np.random.default_rng(1)
    for bend in (-0.5, -0.4, -0.3, 0.6):
        seen = observer.observe(state(bend), BALL, rng)
        assert np.linalg.norm(seen.wrist - SCENE.arm.tip_points(state(bend))[:3]) < 0.003


def test_a_hidden_ring_is_not_guessed_while_the_ball_stays_known():
    seen, _ = look(extras=Extras(hidden_markers=frozenset(range(10))))
    assert seen.wrist is None
    assert seen.direction is None
    assert "marker" in seen.status
    assert np.linalg.norm(seen.ball - BALL) < 0.003


def test_half_a_ring_is_enough():
    seen, _ = look(extras=Extras(hidden_markers=frozenset((1, 3, 5, 7, 9))))
    assert gripper_error(seen) < 0.005


def test_without_a_ball_there_is_none():
    observer = RenderedObserver(HandoverVision(EXACT, "joint"))
    seen = observer.observe(state(), np.array([0.0, 3.0, 0.7]), np.random.default_rng(0))
    assert seen.ball is None
    assert seen.wrist is not None


def test_a_second_green_ball_misleads_the_largest_piece_and_not_the_tracked_ball():
    other = Extras(second_ball=(0.22, 0.20, 0.62))
    for estimator, misled in (("thesis", True), ("joint", False)):
        observer = RenderedObserver(HandoverVision(EXACT, estimator))
        rng = np.random.default_rng(2)
        observer.observe(state(), BALL, rng)
        observer.extras = other
        seen = observer.observe(state(-0.25), BALL, rng)
        assert (np.linalg.norm(seen.ball - BALL) > 0.1) == misled


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_swapped_cameras_are_noticed(estimator):
    seen, _ = look(HandoverVision(EXACT, estimator), spoil=lambda number, images: images[::-1])
    assert seen.wrist is None
    assert seen.ball is None
    assert "swapped" in seen.status


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (None, "no image"),
        (np.empty((0, 0, 3), np.uint8), "no image"),
        (np.full((720, 1280, 3), np.nan), "float64"),
        (np.zeros((480, 640, 3), np.uint8), "480"),
        (np.zeros((720, 1280), np.uint8), r"\(720, 1280\)"),
    ],
)
def test_a_useless_picture_is_named_and_the_arm_is_known_from_the_other_camera(picture, message):
    seen, _ = look(spoil=lambda number, images: [picture, images[1]])
    assert seen.ball is None
    assert gripper_error(seen) < 0.010
    assert seen.status.startswith("camera 1")
    assert message.strip("\\").replace("\\", "") in seen.status


def test_a_frozen_camera_is_left_out():
    frozen = []

    def freeze(number, images):
        frozen.append(images[0])
        return [frozen[0], images[1]]

    observer = RenderedObserver(HandoverVision(EXACT, "joint"), spoil=freeze)
    rng = np.random.default_rng(3)
    assert observer.observe(state(), BALL, rng).status == ""
    seen = observer.observe(state(-0.4), BALL, rng)
    assert seen.status == "camera 1: frozen"
    assert seen.ball is None
    assert np.linalg.norm(seen.wrist - SCENE.arm.tip_points(state(-0.4))[:3]) < 0.010


def test_with_three_cameras_the_ball_survives_the_loss_of_one():
    views = (*STEREO, SIDE_CAMERA)
    cameras = [CalibratedCamera(view.camera, view.pose) for view in views]
    vision = HandoverVision(cameras, "joint")
    seen, _ = look(vision, views=views, spoil=lambda number, images: [None, *images[1:]])
    assert np.linalg.norm(seen.ball - BALL) < 0.004
    assert gripper_error(seen) < 0.004


def test_a_wrong_calibration_shows_in_the_rays():
    rng = np.random.default_rng(5)
    moved = calibrate_on_box(STEREO, rng, selection_deviation=0.0)
    moved[0].pose[:3, 3] += [0.0, 0.0, 0.03]
    seen, _ = look(HandoverVision(moved, "thesis"))
    assert seen.disagreement > 0.015
    strict, _ = look(HandoverVision(moved, "joint"))
    assert strict.ball is None


def test_impossible_systems_are_refused():
    with pytest.raises(ValueError, match="estimator"):
        HandoverVision(EXACT, "best")
    with pytest.raises(ValueError, match="two cameras"):
        HandoverVision(EXACT[:1])
    with pytest.raises(ValueError, match="as many images"):
        HandoverVision(EXACT).look([None])


# --- errors from a noise budget ---

ARM = HelixArm()
NEAR_BALL = np.array([0.15, 0.0, 0.64])


def test_perfect_sight_is_the_truth():
    look = NoisyObserver(NO_NOISE).observe(ARM.home, NEAR_BALL, np.random.default_rng(0))
    np.testing.assert_allclose(look.wrist, [0, 0, 0.6], atol=1e-12)
    np.testing.assert_allclose(look.direction, [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(look.ball, NEAR_BALL)


def test_jitter_changes_from_look_to_look_and_bias_stays_while_the_arm_stands_still():
    rng = np.random.default_rng(1)
    noise = VisionNoise(0.002, 0.005, 0, 0, 0, 0)
    means, deviations = [], []
    for _ in range(150):
        observer = NoisyObserver(noise)
        looks = np.array([observer.observe(ARM.home, NEAR_BALL, rng).wrist for _ in range(30)])
        means.append(looks.mean(axis=0) - [0, 0, 0.6])
        deviations.append(looks.std(axis=0, ddof=1))
    assert np.mean(deviations) == pytest.approx(0.002, rel=0.05)
    assert np.std(means) == pytest.approx(0.005, rel=0.15)


def test_bias_is_another_one_after_a_long_way():
    rng = np.random.default_rng(2)
    far = ARM.home + np.tile([0.7, 0.0, 0.0], 3)
    products = []
    for _ in range(200):
        observer = NoisyObserver(VisionNoise(0, 0.005, 0, 0, 0, 0))
        first = observer.observe(ARM.home, NEAR_BALL, rng).wrist - ARM.tip_points(ARM.home)[:3]
        second = observer.observe(far, NEAR_BALL, rng).wrist - ARM.tip_points(far)[:3]
        products.append(first @ second)
    assert abs(np.mean(products)) < 0.3 * 3 * 0.005**2


@pytest.mark.parametrize("name", ["thesis", "gated", "joint", "three cameras"])
def test_every_estimator_has_a_budget(name):
    assert load_vision_noise(name).ball_jitter > 0


def test_unknown_estimator_is_named():
    with pytest.raises(KeyError, match="it has"):
        load_vision_noise("nobody")


def test_bad_budget_is_named():
    with pytest.raises(ValueError, match="ball_jitter"):
        VisionNoise(0, 0, 0, 0, -1, 0)

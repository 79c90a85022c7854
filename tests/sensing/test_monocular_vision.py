"""The tracker on rendered films: it finds the truth, knows when it is lost, and comes back."""

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import metric_pose, start_tracker
from soro_lib.papers.visual_strain_fusion.world.motion import move
from soro_lib.papers.visual_strain_fusion.world.scene import ENDOSCOPE, BrickScene, ViewConditions, photograph
from soro_lib.sensing.feature_matching import Features, match_descriptors, match_near
from soro_lib.sensing.monocular_vision import MonocularTracker, TrackerSettings, fit_similarity

HELD_OUT = BrickScene(4)
"""A room in which no setting was chosen."""


def noise(rng):
    return rng.standard_normal((ENDOSCOPE.height, ENDOSCOPE.width), dtype=np.float32)


@pytest.fixture(scope="module")
def held_out_sweep():
    return start_tracker(HELD_OUT, np.random.default_rng(1))


@pytest.fixture(params=["swept for all tests", pytest.param("held out", marks=pytest.mark.soak)])
def flight(request):
    """The scene, a tracker after its sweep there, and its similarity."""
    if request.param == "held out":
        tracker, similarity = request.getfixturevalue("held_out_sweep")
        detector = tracker._detector
        return HELD_OUT, copy.deepcopy(tracker, {id(detector): detector}), similarity
    sweep = request.getfixturevalue("sweep")
    return sweep.scene, sweep.copy(), sweep.similarity


def film(steps=40, bending=0.35):
    out = np.linspace(0, 1, steps)[:, None]
    return move(bending * out * np.array([[0.7, 0.7]]))


def fly(scene, tracker, similarity, poses, conditions, rng):
    frames = [
        tracker.track(photograph(scene, pose, conditions(k), noise(rng))) for k, pose in enumerate(poses)
    ]
    seen = np.array([metric_pose(frame.pose, similarity)[:3] for frame in frames])
    return frames, 1e3 * np.linalg.norm(seen - poses[:, :3], axis=1)


def test_the_tip_is_found_to_a_millimetre(flight):
    motion = film()
    frames, error = fly(*flight, motion.pose, lambda k: ViewConditions(), np.random.default_rng(2))
    assert all(frame.tracked for frame in frames)
    assert error.mean() < 0.8
    assert error.max() < 2.0
    assert all(frame.features == 600 and frame.inliers > 50 for frame in frames)
    assert all(0.3 < frame.inlier_error < 1.6 for frame in frames)


def test_the_orientation_is_found_to_a_degree(flight):
    scene, track, similarity = flight
    motion = film(20)
    rng = np.random.default_rng(3)
    for pose in motion.pose:
        frame = track.track(photograph(scene, pose, ViewConditions(), noise(rng)))
    seen = metric_pose(frame.pose, similarity)
    assert np.linalg.norm(seen[3:]) == pytest.approx(1)
    turned = Rotation.from_quat(seen[3:]) * Rotation.from_quat(motion.pose[-1, 3:]).inv()
    assert np.degrees(turned.magnitude()) < 1.5


def test_the_stated_spread_is_of_the_size_of_the_jitter(flight):
    scene, track, similarity = flight
    rng = np.random.default_rng(4)
    pose = film(2).pose[0]
    frames = [track.track(photograph(scene, pose, ViewConditions(), noise(rng))) for _ in range(12)]
    places = np.array([similarity[1] * frame.pose[:3, 3] for frame in frames[2:]])
    jitter = np.sqrt(places.var(axis=0, ddof=1).sum())
    stated = similarity[1] * np.mean([frame.position_spread for frame in frames[2:]])
    assert 0.2 * stated < jitter < 5 * stated


@pytest.mark.parametrize("conditions", [ViewConditions(covered=True), ViewConditions(light=0.0), None])
def test_a_lost_camera_holds_its_last_pose_and_comes_back(flight, conditions):
    scene, track, similarity = flight
    rng = np.random.default_rng(5)
    motion = film(40, 0.25)
    for pose in motion.pose[:5]:
        held = track.track(photograph(scene, pose, ViewConditions(), noise(rng)))
    for pose in motion.pose[5:12]:
        image = None if conditions is None else photograph(scene, pose, conditions, noise(rng))
        lost = track.track(image)
        assert not lost.tracked
        assert lost.inlier_error == lost.match_error == lost.position_spread == np.inf
        np.testing.assert_array_equal(lost.pose, held.pose)
    back = [track.track(photograph(scene, motion.pose[30], ViewConditions(), noise(rng))) for _ in range(5)]
    assert back[-1].tracked
    error = 1e3 * np.linalg.norm(metric_pose(back[-1].pose, similarity)[:3] - motion.pose[30, :3])
    assert error < 2.0


def test_relocalisation_needs_no_idea_of_where_the_camera_is(flight):
    scene, track, similarity = flight
    rng = np.random.default_rng(6)
    track._pose = track._pose @ np.diag([-1.0, -1.0, 1.0, 1.0])
    track._lost = track.settings.relocalise_every
    pose = film(2, 0.2).pose[1]
    frame = track.track(photograph(scene, pose, ViewConditions(), noise(rng)))
    assert frame.tracked
    assert 1e3 * np.linalg.norm(metric_pose(frame.pose, similarity)[:3] - pose[:3]) < 2.0


def test_ten_seconds_without_a_camera_change_nothing_in_the_map(flight):
    _, track, _ = flight
    before = track.map.positions.copy()
    pose = track._pose.copy()
    for _ in range(200):
        frame = track.track(None)
    assert not frame.tracked
    np.testing.assert_array_equal(frame.pose, pose)
    np.testing.assert_array_equal(track.map.positions, before)


def test_a_hand_takes_features_but_not_the_pose(flight):
    hand = ViewConditions(hand=(0.1, 0.2, 0.5))
    frames, error = fly(*flight, film(12, 0.1).pose, lambda k: hand, np.random.default_rng(7))
    clear, _ = fly(*flight, film(2, 0.1).pose, lambda k: ViewConditions(), np.random.default_rng(7))
    assert all(frame.tracked for frame in frames)
    assert np.mean([frame.inliers for frame in frames]) < 0.8 * clear[-1].inliers
    assert error.max() < 3.0


def test_without_movement_there_is_no_map():
    tracker = MonocularTracker(ENDOSCOPE)
    rng = np.random.default_rng(8)
    pose = film(2).pose[0]
    for _ in range(4):
        frame = tracker.track(photograph(HELD_OUT, pose, ViewConditions(), noise(rng)))
    assert not frame.tracked
    assert not tracker.initialised
    assert frame.features == 600


def test_pure_black_from_the_start_is_waited_out():
    tracker = MonocularTracker(ENDOSCOPE)
    black = np.zeros((ENDOSCOPE.height, ENDOSCOPE.width), np.uint8)
    for image in (black, None, black):
        frame = tracker.track(image)
        assert not frame.tracked
        np.testing.assert_array_equal(frame.pose, np.eye(4))


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((480, 639), np.uint8),
        np.zeros((480, 640), np.float32),
        np.zeros((480, 640, 4), np.uint8),
        np.zeros((0, 0), np.uint8),
        "image",
    ],
)
def test_images_of_the_wrong_size_or_type_are_refused(image):
    with pytest.raises(ValueError, match="image must be uint8"):
        MonocularTracker(ENDOSCOPE).track(image)


def test_settings_check_themselves():
    with pytest.raises(ValueError, match=r"ratio must be a finite number above 0, got 0.0"):
        TrackerSettings(ratio=0.0)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.01, 100))
def test_similarity_is_recovered_from_any_cloud(seed, scale):
    rng = np.random.default_rng(seed)
    measured = rng.normal(size=(8, 3))
    rotation, translation = Rotation.random(rng=rng), rng.normal(size=3)
    found = fit_similarity(measured, scale * rotation.apply(measured) + translation)
    np.testing.assert_allclose(found[0], rotation.as_matrix(), atol=1e-7)
    assert found[1] == pytest.approx(scale)
    np.testing.assert_allclose(found[2], translation, atol=1e-6 * scale)


def test_similarity_is_the_least_squares_fit():
    rng = np.random.default_rng(9)
    measured = rng.normal(size=(30, 3))
    reference = 1.7 * measured + rng.normal(0, 0.1, (30, 3))
    rotation, scale, translation = fit_similarity(measured, reference)

    def cost(turn, size, shift):
        return np.sum((size * measured @ (turn @ rotation).T + shift - reference) ** 2)

    best = cost(np.eye(3), scale, translation)
    for _ in range(50):
        turn = Rotation.from_rotvec(rng.normal(0, 0.02, 3)).as_matrix()
        assert cost(turn, scale * (1 + rng.normal(0, 0.02)), translation + rng.normal(0, 0.02, 3)) >= best


def test_similarity_refuses_what_it_cannot_fit():
    line = np.outer(np.arange(5.0), [1, 2, 3])
    with pytest.raises(ValueError, match="line"):
        fit_similarity(line, line)
    with pytest.raises(ValueError, match=r"measured must have shape \(n >= 3, 3\), got \(2, 3\)"):
        fit_similarity(line[:2], line[:2])


def test_matching_stays_in_the_gate_and_uses_a_feature_once():
    rng = np.random.default_rng(10)
    descriptors = rng.integers(0, 256, (50, 32), dtype=np.uint8)
    pixels = rng.uniform(0, 400, (50, 2))
    image = Features(pixels, descriptors)
    point, feature = match_near(pixels + 3.0, descriptors, image, 10.0, 60, 0.9)
    np.testing.assert_array_equal(np.sort(point), np.arange(50))
    np.testing.assert_array_equal(point, feature)
    assert len(match_near(pixels + 30.0, descriptors, image, 10.0, 60, 0.9)[0]) < 3
    twice = np.vstack([descriptors, descriptors])
    point, feature = match_near(np.vstack([pixels, pixels]), twice, image, 10.0, 60, 0.9)
    assert len(np.unique(feature)) == len(feature) == 50
    none = Features(np.zeros((0, 2)), np.zeros((0, 32), np.uint8))
    assert len(match_near(pixels, descriptors, none, 10.0, 60, 0.9)[0]) == 0
    assert len(match_descriptors(none, image, 60)[0]) == 0


def matches_by_every_pair(expected, descriptors, image, gate, hamming, ratio):
    """The readable reference of `match_near`: the bits of every point against every feature."""
    apart = np.linalg.norm(expected[:, None] - image.pixels, axis=2)
    bits = np.bitwise_count(descriptors[:, None] ^ image.descriptors).sum(axis=2, dtype=int)
    bits[apart > gate] = 256
    best, rival = np.sort(bits, axis=1)[:, :2].T
    bits[(best >= hamming) | (best >= ratio * rival)] = 256
    matched = [(point, row.argmin()) for point, row in enumerate(bits) if row.min() < 256]
    of_feature = {}
    for point, feature in sorted(matched, key=lambda pair: bits[pair]):
        of_feature.setdefault(feature, point)
    return [(of_feature[feature], feature) for feature in sorted(of_feature)]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1.0, 500.0))
def test_matching_in_cells_is_matching_of_every_pair(seed, gate):
    """Few bits differ, so that rivals and ties are frequent; some points lie far outside of the features."""
    rng = np.random.default_rng(seed)
    words = rng.integers(0, 256, (6, 32), dtype=np.uint8)
    features, points = rng.integers(2, 80), rng.integers(1, 80)
    image = Features(rng.uniform(-20, 300, (features, 2)), words[rng.integers(0, 6, features)].copy())
    image.descriptors[:, :4] ^= rng.integers(0, 256, (features, 4), dtype=np.uint8)
    descriptors, expected = words[rng.integers(0, 6, points)], rng.uniform(-200, 500, (points, 2))
    arguments = expected, descriptors, image, gate, 60, 0.9
    pairs = list(zip(*(indices.tolist() for indices in match_near(*arguments))))
    assert pairs == matches_by_every_pair(*arguments)

"""From pixels to places: calibration, rays, circles, markers, each against exact geometry."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.papers.soft_handover.world.scene import (
    BRIO,
    SIDE_CAMERA,
    STEREO,
    WEBCAM,
    Extras,
    HandoverScene,
    photograph,
)
from soro_lib.sensing import triangulate
from soro_lib.sensing.camera import transform_points
from soro_lib.sensing.marker_pose import (
    average_pose,
    consensus_pose,
    joint_pose,
    viewing_cosines,
    wrist_candidates,
)
from soro_lib.sensing.marker_ring import MarkerRing
from soro_lib.sensing.stereo_vision import (
    BallDetector,
    CalibratedCamera,
    CalibrationError,
    MarkerDetector,
    around,
    box_corners,
    calibrate,
    ray_gap,
)

CAMERAS = [CalibratedCamera(view.camera, view.pose) for view in STEREO]
coordinate = st.floats(-1.0, 1.0)
points = st.tuples(coordinate, coordinate, coordinate).map(np.array)


@pytest.mark.parametrize("camera", CAMERAS)
def test_calibration_finds_the_camera_from_exact_corners(camera):
    found = calibrate(BRIO, box_corners(), camera.project(box_corners()))
    np.testing.assert_allclose(found.pose, camera.pose, atol=1e-6)
    assert found.reprojection < 1e-4


def test_calibration_error_grows_with_the_selection_error():
    rng = np.random.default_rng(1)
    exact = CAMERAS[0].project(box_corners())

    def miss(deviation):
        poses = [
            calibrate(BRIO, box_corners(), exact + deviation * rng.standard_normal((6, 2))) for _ in range(20)
        ]
        return np.median([np.linalg.norm(p.pose[:3, 3] - CAMERAS[0].pose[:3, 3]) for p in poses])

    assert miss(0.1) < miss(1.0) < 0.05


def test_calibration_survives_a_bad_linear_start():
    rng = np.random.default_rng(0)
    exact = CalibratedCamera(SIDE_CAMERA.camera, SIDE_CAMERA.pose).project(box_corners())
    astray = 0
    for _ in range(1000):
        selected = exact + 0.5 * rng.standard_normal((6, 2))
        _, rotation, translation = cv2.solvePnP(box_corners(), selected, BRIO.matrix, BRIO.coefficients)
        seen, _ = cv2.projectPoints(box_corners(), rotation, translation, BRIO.matrix, BRIO.coefficients)
        if np.abs(seen[:, 0] - selected).max() > 10:
            astray += 1
            assert calibrate(BRIO, box_corners(), selected).reprojection < 2
    assert astray > 0, "OpenCV's own start never fails: the second one is not needed any more"


@pytest.mark.parametrize(
    ("corners", "pixels", "message"),
    [
        (box_corners()[:5], np.zeros((5, 2)), r"corners must have shape \(n >= 6, 3\), got \(5, 3\)"),
        (box_corners(), np.zeros((5, 2)), r"pixels must have shape \(6, 2\), got \(5, 2\)"),
        (box_corners(), np.full((6, 2), np.nan), "finite"),
        (box_corners(), CAMERAS[0].project(box_corners())[[1, 0, 2, 3, 5, 4]], "order"),
        (box_corners(), CAMERAS[0].project(box_corners())[::-1], "order|front"),
    ],
)
def test_calibration_refuses_what_does_not_fit(corners, pixels, message):
    with pytest.raises(CalibrationError, match=message):
        calibrate(BRIO, corners, pixels)


@given(points, points, points)
def test_rays_through_a_point_meet_there(point, first, second):
    directions = np.array([point - first, point - second])
    if min(np.linalg.norm(directions, axis=1)) < 1e-2 or np.linalg.norm(np.cross(*directions)) < 1e-2:
        return
    np.testing.assert_allclose(triangulate([first, second], directions), point, atol=1e-6)
    assert ray_gap([first, second], directions) < 1e-6


def test_skew_rays_meet_in_the_middle_of_their_shortest_line_as_brute_force_says():
    origins = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]])
    directions = np.array([[1.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    np.testing.assert_allclose(triangulate(origins, directions), [0, 0, 0.1], atol=1e-12)
    assert ray_gap(origins, directions) == pytest.approx(0.2)
    rng = np.random.default_rng(0)
    origins, directions = rng.standard_normal((3, 3)), rng.standard_normal((3, 3))
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def cost(point):
        return np.sum(np.cross(unit, point - origins) ** 2)

    best = triangulate(origins, directions)
    assert all(cost(best) <= cost(best + 1e-3 * rng.standard_normal(3)) for _ in range(50))


def test_triangulation_broadcasts_and_agrees_with_opencv():
    rng = np.random.default_rng(3)
    world = rng.uniform([-0.2, -0.2, 0.5], [0.2, 0.2, 0.8], (40, 3))
    rays = [camera.rays(camera.project(world)) for camera in CAMERAS]
    origins = np.stack([np.broadcast_to(origin, world.shape) for origin, _ in rays], axis=1)
    found = triangulate(origins, np.stack([direction for _, direction in rays], axis=1))
    np.testing.assert_allclose(found, world, atol=1e-6)
    matrices = [np.linalg.inv(camera.pose)[:3] for camera in CAMERAS]
    flat = [c.camera.rays(c.project(world))[:, :2].T for c in CAMERAS]
    opencv = cv2.triangulatePoints(*matrices, *flat)
    np.testing.assert_allclose(found, (opencv[:3] / opencv[3]).T, atol=1e-5)


@pytest.mark.parametrize(
    ("origins", "directions", "message"),
    [
        (np.zeros((2, 3)), [[1, 0, 0], [-2, 0, 0]], "parallel"),
        (np.zeros((2, 3)), [[1, 0, 0], [0, 0, 0]], "zero"),
        (np.full((2, 3), np.nan), [[1, 0, 0], [0, 1, 0]], "finite"),
        (np.zeros((1, 3)), [[1, 0, 0]], "shape"),
        (np.zeros((2, 2)), [[1, 0], [0, 1]], "shape"),
    ],
)
def test_triangulation_names_what_is_wrong(origins, directions, message):
    with pytest.raises(ValueError, match=message):
        triangulate(origins, directions)


@pytest.fixture(scope="module")
def view_of_ball():
    scene = HandoverScene()
    ball = np.array([-0.08, 0.06, 0.74])
    rng = np.random.default_rng(5)
    return ball, [photograph(scene.items(scene.arm.home, ball), view, WEBCAM, rng) for view in STEREO]


@pytest.mark.parametrize("join", [False, True])
def test_an_unhidden_ball_is_located_to_two_millimetres(view_of_ball, join):
    ball, images = view_of_ball
    sights = [BallDetector(join_pieces=join).detect(image)[0] for image in images]
    rays = [camera.rays([sight.centre]) for camera, sight in zip(CAMERAS, sights)]
    found = triangulate([origin for origin, _ in rays], [direction[0] for _, direction in rays])
    assert np.linalg.norm(found - ball) < 0.002
    assert all(sight.fill > 0.85 for sight in sights)


def test_coarse_and_windowed_search_find_the_same_circle(view_of_ball):
    _, images = view_of_ball
    whole = BallDetector().detect(images[0])[0]
    window = BallDetector().detect(images[0], around(whole.centre, 90, images[0].shape))[0]
    everything = BallDetector().detect(images[0], around((640, 360), 1280, images[0].shape))[0]
    assert np.abs(np.subtract(whole.centre, window.centre)).max() < 0.05
    assert np.abs(np.subtract(whole.centre, everything.centre)).max() < 0.05


def test_two_pieces_of_one_ball_are_joined_and_two_balls_are_not():
    image = np.full((200, 400, 3), 150, np.uint8)
    cv2.circle(image, (100, 100), 30, (60, 175, 50), -1)
    cv2.rectangle(image, (92, 0), (108, 200), (60, 60, 60), -1)
    cv2.circle(image, (300, 100), 26, (60, 175, 50), -1)
    window = around((200, 100), 400, image.shape)
    pieces = BallDetector().detect(image, window)
    joined = BallDetector(join_pieces=True).detect(image, window)
    assert len(pieces) == 3
    assert len(joined) == 2
    split = min(joined, key=lambda sight: abs(sight.centre[0] - 100))
    assert split.centre == pytest.approx((100, 100), abs=1.0)
    assert split.fill < 0.85


@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_empty_picture_shows_nothing(level):
    image = np.full((720, 1280, 3), level, np.uint8)
    assert BallDetector().detect(image) == []
    assert MarkerDetector().detect(image) == {}


def test_markers_in_a_window_have_the_same_corners(view_of_ball):
    _, images = view_of_ball
    whole = MarkerDetector().detect(images[0])
    middle = np.concatenate(list(whole.values())).mean(axis=0)
    window = MarkerDetector().detect(images[0], around(tuple(middle), 110, images[0].shape))
    assert len(set(whole) & set(window)) >= 2
    for number in set(whole) & set(window):
        assert np.abs(whole[number] - window[number]).max() < 0.3


def exact_markers(pose, numbers_by_camera):
    ring = MarkerRing()
    return [
        (camera, {n: camera.project(transform_points(pose, ring.marker_corners[n])) for n in numbers})
        for camera, numbers in zip(CAMERAS, numbers_by_camera)
    ]


@pytest.fixture
def wrist_pose():
    state = HandoverScene().arm.home.copy()
    state[[3, 4, 6, 7]] = -0.4, 0.3, 0.2, -0.1
    return HandoverScene().wrist(state)


def candidates_and_cosines(sights):
    ring = MarkerRing()
    candidates = [wrist_candidates(markers, camera, ring) for camera, markers in sights]
    cosines = [viewing_cosines(c, markers, camera, ring) for c, (camera, markers) in zip(candidates, sights)]
    return np.concatenate(candidates), np.concatenate(cosines)


def test_all_estimators_find_the_wrist_from_exact_corners(wrist_pose):
    sights = exact_markers(wrist_pose, [(2, 3, 4), (1, 2, 3)])
    candidates, cosines = candidates_and_cosines(sights)
    estimates = [
        average_pose(candidates),
        consensus_pose(candidates, cosines, 0.1),
        joint_pose(candidates[0, 0], sights, MarkerRing()),
    ]
    for estimate in estimates:
        np.testing.assert_allclose(estimate.wrist, wrist_pose[:3, 3], atol=1e-5)
        np.testing.assert_allclose(estimate.direction, wrist_pose[:3, 2], atol=1e-4)


def test_a_flipped_marker_bends_the_average_and_not_the_consensus(wrist_pose):
    candidates, cosines = candidates_and_cosines(exact_markers(wrist_pose, [(1, 2, 3, 4), (1, 2, 3)]))
    candidates[0], cosines[0] = candidates[0, ::-1], cosines[0, ::-1]
    truth = wrist_pose[:3, 3]
    assert np.linalg.norm(average_pose(candidates).wrist - truth) > 0.002
    assert np.linalg.norm(consensus_pose(candidates, cosines, 0.1).wrist - truth) < 1e-4


def test_one_marker_is_decided_by_where_the_arm_was(wrist_pose):
    candidates, cosines = candidates_and_cosines(exact_markers(wrist_pose, [(2,), ()])[:1])
    candidates, cosines = candidates[:, ::-1], cosines[:, ::-1]
    wrist, direction = wrist_pose[:3, 3], wrist_pose[:3, 2]
    expected = np.concatenate([wrist, wrist + 0.1 * direction])
    found = consensus_pose(candidates, cosines, 0.1, expected)
    np.testing.assert_allclose(found.wrist, wrist, atol=1e-4)


def test_joint_fit_is_the_least_squares_optimum_and_claims_its_spread(wrist_pose):
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    ring = MarkerRing()
    rng = np.random.default_rng(2)
    misses, claims = [], []
    for _ in range(40):
        sights = exact_markers(wrist_pose, [(2, 3, 4), (1, 2, 3)])
        noisy = [(c, {n: p + 0.15 * rng.standard_normal((4, 2)) for n, p in m.items()}) for c, m in sights]
        start = wrist_pose.copy()
        start[:3, 3] += 0.01
        found = joint_pose(start, noisy, ring, iterations=20)
        misses.append(found.wrist - wrist_pose[:3, 3])
        claims.append(found.wrist_deviation)

    def residual(step):
        pose = found.pose.copy()
        pose[:3, 3] += step[:3]
        pose[:3, :3] = Rotation.from_rotvec(step[3:]).as_matrix() @ pose[:3, :3]
        pixels = [
            (c.camera.rays(c.project(transform_points(pose, ring.marker_corners[n]))) - c.camera.rays(p))[
                :, :2
            ]
            for c, m in noisy
            for n, p in m.items()
        ]
        return 907.0 * np.concatenate(pixels).ravel()

    # The Huber weights leave the plain optimum by little, since the corners have no outliers.
    best = least_squares(residual, np.zeros(6), x_scale=[0.001] * 3 + [0.01] * 3)
    assert np.abs(best.x[:3]).max() < 2e-4
    assert np.sqrt(np.mean(np.square(misses))) == pytest.approx(np.mean(claims), rel=0.35)


def test_a_covered_half_of_the_ring_still_gives_the_wrist():
    scene = HandoverScene()
    extras = Extras(hidden_markers=frozenset(range(0, 10, 2)))
    rng = np.random.default_rng(6)
    items = scene.items(scene.arm.home, [-0.1, 0.1, 0.75], extras)
    sights = [
        (camera, MarkerDetector().detect(photograph(items, view, WEBCAM, rng)))
        for camera, view in zip(CAMERAS, STEREO)
    ]
    candidates, cosines = candidates_and_cosines([s for s in sights if s[1]])
    start = consensus_pose(candidates, cosines, 0.1)
    found = joint_pose(start.pose, sights, scene.ring)
    assert np.linalg.norm(found.wrist - [0, 0, 0.6]) < 0.003

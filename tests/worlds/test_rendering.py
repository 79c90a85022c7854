"""The camera and the painter, against OpenCV's own projection, exact geometry and counted photons."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from soro_lib.sensing.camera import Camera, clip_half_space, invert_pose, look_at, transform_points
from soro_lib.worlds.rendering import (
    Photometry,
    Polygon,
    TexturedQuad,
    expose,
    motion_kernel,
    render,
)
from soro_lib.worlds.round_bodies import Ball

PINHOLE = Camera(320, 240, 260.0)
DISTORTING = Camera(320, 240, 260.0, principal_point=(162.0, 118.0), distortion=(0.06, -0.10, 0.001, -0.002))
FLOOR = np.array([[-0.3, 0.3, 0], [0.3, 0.3, 0], [0.3, -0.3, 0], [-0.3, -0.3, 0]])


def checkerboard(cells: int, size: int) -> np.ndarray:
    pattern = (np.indices((cells, cells)).sum(axis=0) % 2 * 200 + 30).astype(np.uint8)
    return cv2.resize(pattern, (cells * size, cells * size), interpolation=cv2.INTER_NEAREST)


def quiet(gain: float = 1.0) -> Photometry:
    return Photometry(gain, read_noise=0, shot_noise=0)


@pytest.mark.parametrize("camera", [PINHOLE, DISTORTING])
def test_projection_is_opencv_s_and_rays_undo_it(camera):
    points = np.random.default_rng(1).uniform([-0.2, -0.2, 0.4], [0.2, 0.2, 1.0], (50, 3))
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, camera.coefficients)[0]
    pixels = camera.project(points)
    np.testing.assert_allclose(pixels, expected[:, 0], atol=1e-9)
    np.testing.assert_allclose(camera.rays(pixels), points / points[:, 2:], atol=1e-5)


@pytest.mark.parametrize("camera", [PINHOLE, DISTORTING])
def test_corners_of_a_rendered_board_lie_where_the_camera_projects_them(camera):
    pose = look_at([0.15, -0.25, 0.5], [0.0, 0.0, 0.0])
    board = TexturedQuad(FLOOR, checkerboard(8, 60), supersampling=3)
    scene = board.split(12, 12) if camera.distortion else [board]
    image = render(camera, pose, scene, background=130)
    inner = np.array([[x, y, 0] for y in np.arange(-2, 3) for x in np.arange(-2, 3)]) * 0.075
    expected = camera.project(transform_points(invert_pose(pose), inner))
    start = np.ascontiguousarray(expected, dtype=np.float32)
    found = cv2.cornerSubPix(image, start, (3, 3), (-1, -1), (cv2.TERM_CRITERIA_EPS, 40, 1e-4))
    assert np.abs(found - expected).max() < 0.2
    assert np.abs((found - expected).mean(axis=0)).max() < 0.06


def test_aruco_marker_is_found_at_its_pose_and_size():
    marker = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 7, 120)
    texture = cv2.copyMakeBorder(marker, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)
    page = 0.1 * 200 / 120
    corners = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * page / 2
    pose = look_at([0.1, -0.2, 0.35], [0, 0, 0])
    image = render(PINHOLE, pose, [TexturedQuad(corners, texture, supersampling=3)], background=90)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), parameters)
    found, ids, _ = detector.detectMarkers(image)
    assert ids.ravel().tolist() == [7]
    square = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * 0.05
    expected = PINHOLE.project(transform_points(invert_pose(pose), square))
    assert np.abs(found[0][0] - expected).max() < 0.8


def test_supersampling_keeps_areas_to_a_thousandth():
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 0.0523 + [0.013, 0.007, 1.0]
    image = render(
        PINHOLE, np.eye(4), [TexturedQuad(square, np.full((2, 2), 250, np.uint8), supersampling=8)]
    )
    assert image.sum(dtype=float) / 250 == pytest.approx((2 * 0.0523 * 260) ** 2, rel=0.003)


def test_a_quad_is_invisible_from_behind_and_a_polygon_is_not():
    quad = TexturedQuad(FLOOR, np.full((4, 4), 200, np.uint8))
    above, below = look_at([0, 0.01, 0.5], [0, 0, 0]), look_at([0, 0.01, -0.5], [0, 0, 0])
    assert render(PINHOLE, above, [quad]).max() == 200
    assert render(PINHOLE, below, [quad]).max() == 0
    assert render(PINHOLE, below, [Polygon(FLOOR, 200)]).max() == 200


def test_the_near_thing_hides_the_far_one_and_layers_come_first():
    near, far = Ball(np.array([0, 0, 0.5]), 0.05, 250), Ball(np.array([0, 0, 0.9]), 0.2, 100)
    assert render(PINHOLE, np.eye(4), [near, far])[120, 160] == 250
    assert render(PINHOLE, np.eye(4), [far, near])[120, 160] == 250
    covering = Ball(np.array([0, 0, 0.9]), 0.2, 100, layer=1)
    assert render(PINHOLE, np.eye(4), [near, covering])[120, 160] == 100


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_any_view_of_a_room_is_painted_without_holes(numbers):
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    texture = np.full((64, 64), 255, np.uint8)
    room = [TexturedQuad(corners[list(order)], texture) for face in faces for order in (face, face[::-1])]
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(np.pi * np.array(numbers[:3])).as_matrix()
    pose[:3, 3] = 0.7 * np.array(numbers[3:])
    assert (render(PINHOLE, pose, room) == 0).mean() < 1e-3


def test_clipping_keeps_what_is_in_front():
    triangle = np.array([[0, 0, 1.0], [1, 0, -1.0], [0, 1, 1.0]])
    clipped = clip_half_space(triangle, (0, 0, 1), 0.5)
    assert len(clipped) == 4
    assert clipped[:, 2].min() == pytest.approx(0.5)
    assert len(clip_half_space(triangle - [0, 0, 5], (0, 0, 1), 0.5)) == 0


def test_distortion_does_not_fold_the_far_side_into_the_image():
    far_aside = Polygon(np.array([[5.0, 0, 0.5], [6, 0, 0.5], [6, 1, 0.5], [5, 1, 0.5]]), 255)
    assert render(DISTORTING, np.eye(4), [far_aside]).max() == 0
    assert 1.0 < DISTORTING.reach < 1.5
    assert PINHOLE.reach == np.inf


def test_look_at_is_a_rotation_that_centres_its_target():
    pose = look_at([0.3, -0.2, 0.6], [0.05, 0.1, 0.0])
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    middle = PINHOLE.project(transform_points(invert_pose(pose), [[0.05, 0.1, 0.0]]))[0]
    np.testing.assert_allclose(middle, [159.5, 119.5])
    assert pose[2, 1] < 0


def test_noise_has_the_variance_of_the_sensor_model():
    rng = np.random.default_rng(3)
    for level in (40, 120, 200):
        image = np.full((240, 320), level, np.uint8)
        seen = expose(image, Photometry(0.9, 3.0, 0.15), rng.standard_normal(image.shape, dtype=np.float32))
        assert seen.mean() == pytest.approx(0.9 * level, abs=0.1)
        assert seen.var() == pytest.approx(9 + 0.15 * 0.9 * level + 1 / 12, rel=0.03)


def test_darkness_leaves_only_the_positive_half_of_the_read_noise():
    image = np.full((100, 100), 180, np.uint8)
    noise = np.random.default_rng(4).standard_normal(image.shape, dtype=np.float32)
    dark = expose(image, Photometry(gain=0.0, read_noise=2.0), noise)
    assert dark.max() < 12
    assert (dark == 0).mean() > 0.5


def test_motion_blurs_along_the_motion_only_and_keeps_the_light():
    image = np.zeros((41, 41), np.uint8)
    image[20, 20] = 250
    seen = expose(image, Photometry(1, 0, 0, motion=(9, 0)), np.zeros(image.shape, np.float32))
    assert np.count_nonzero(seen.sum(axis=1)) == 1
    assert np.count_nonzero(seen.sum(axis=0)) in (9, 10)
    for motion in ((9.0, 0.0), (3.0, -7.0), (0.5, 0.2)):
        assert motion_kernel(*motion).sum() == pytest.approx(1)


def test_expose_without_noise_is_the_image_in_colour_too():
    image = np.random.default_rng(5).integers(0, 255, (20, 30, 3), dtype=np.uint8)
    np.testing.assert_array_equal(expose(image, quiet(), np.zeros(image.shape, np.float32)), image)
    assert expose(image, quiet(2.0), np.zeros(image.shape, np.float32)).max() == 255


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Camera(0, 10, 5.0), "Camera.width"),
        (lambda: Camera(10, 10, float("nan")), "Camera.focal_length"),
        (lambda: Camera(10, 10, 5.0, distortion=(0.1,)), "distortion"),
        (lambda: TexturedQuad(FLOOR[:3], np.zeros((2, 2), np.uint8)), "corners"),
        (lambda: TexturedQuad(FLOOR * np.nan, np.zeros((2, 2), np.uint8)), "corners"),
        (lambda: TexturedQuad(FLOOR * [[1], [2], [1], [1]], np.zeros((2, 2), np.uint8)), "parallelogram"),
        (lambda: TexturedQuad(FLOOR, np.zeros((2, 2))), "uint8"),
        (lambda: Photometry(gain=-1), "Photometry.gain"),
        (lambda: Photometry(motion=(np.nan, 0)), "Photometry.motion"),
        (lambda: render(PINHOLE, np.eye(3), []), "camera_in_world"),
        (lambda: render(PINHOLE, np.eye(4), [], np.zeros((5, 5), np.uint8)), "background"),
        (lambda: expose(np.zeros((4, 4), np.uint8), quiet(), np.zeros((3, 4), np.float32)), "noise"),
        (lambda: look_at([0, 0, 1], [0, 0, 0]), "look_at"),
    ],
)
def test_bad_input_is_named(build, message):
    with pytest.raises(ValueError, match=message):
        build()

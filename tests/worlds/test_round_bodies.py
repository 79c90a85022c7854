"""Balls and tubes: exact outlines, and compiled code that says what NumPy and OpenCV say."""

from dataclasses import replace

import numpy as np
import pytest

from soro_lib.papers.soft_handover.world.scene import BRIO, SIDE_CAMERA, STEREO
from soro_lib.sensing.camera import NEAR, Camera, invert_pose, transform_points
from soro_lib.worlds.rendering import render
from soro_lib.worlds.round_bodies import (
    STRIPS,
    Ball,
    Tube,
    ball_samples,
    distorted,
    tube_strips,
    undistorted,
)

PINHOLE = Camera(320, 240, 260.0)
DISTORTING = Camera(320, 240, 260.0, principal_point=(162.0, 118.0), distortion=(0.06, -0.10, 0.001, -0.002))
BARREL = replace(BRIO, distortion=(-0.3, 0.12, 0.002, -0.001, -0.02))
CAMERAS = [PINHOLE, DISTORTING, BRIO, BARREL]


@pytest.mark.parametrize("camera", CAMERAS)
def test_compiled_projection_is_the_camera_s(camera):
    rays = np.column_stack([np.random.default_rng(1).uniform(-0.6, 0.6, (200, 2)), np.ones(200)])
    pixels = [distorted(x, y, camera.numbers) for x, y, _ in rays]
    np.testing.assert_allclose(pixels, camera.project(rays), atol=1e-9)
    flat = [undistorted(column, row, camera.numbers) for column, row in pixels]
    np.testing.assert_allclose(flat, camera.rays(pixels)[:, :2], atol=1e-12)


@pytest.mark.parametrize("camera", [PINHOLE, DISTORTING])
def test_sphere_has_the_outline_of_its_tangent_cone(camera):
    centre, radius = np.array([0.12, -0.05, 0.5]), 0.05
    image = render(camera, np.eye(4), [Ball(centre, radius, 255, supersampling=4)])
    rays = camera.rays(np.indices((240, 320))[::-1].reshape(2, -1).T.astype(float))
    cosine = rays @ centre / np.linalg.norm(rays, axis=1) / np.linalg.norm(centre)
    inside = (cosine > np.cos(np.arcsin(radius / np.linalg.norm(centre)))).reshape(240, 320)
    assert (image > 127).sum() == pytest.approx(inside.sum(), rel=0.01)
    assert ((image > 127) != inside).sum() < 0.02 * inside.sum()


def test_sphere_is_brightest_toward_the_lamp():
    image = render(PINHOLE, np.eye(4), [Ball(np.array([0, 0, 0.5]), 0.1, 200, (0, -1, 0), ambient=0.2)])
    assert image[85, 160] > image[120, 160] >= image[155, 160] == pytest.approx(40, abs=1)


def numpy_ball(camera, region, supersampling, centre, ball, light):
    """Return picture and mask of a ball by the rays of all samples."""
    y, x = ((np.arange(start, end) + 0.5) / supersampling - 0.5 for start, end in region)
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    along = rays @ centre
    discriminant = along**2 - (centre @ centre - ball.radius**2)
    hit = discriminant >= 0
    normals = (rays * (along - np.sqrt(np.where(hit, discriminant, 0)))[:, None] - centre) / ball.radius
    brightness = ball.ambient + (1 - ball.ambient) * np.maximum(normals @ light, 0)
    picture = np.clip(np.multiply.outer(brightness, ball.color), 0, 255).astype(np.uint8)
    shape = len(y), len(x)
    return picture.reshape(*shape, 3), np.where(hit, 255, 0).astype(np.uint8).reshape(shape)


@pytest.mark.parametrize("camera", CAMERAS)
def test_compiled_ball_is_that_of_the_rays_to_the_byte(camera):
    rng = np.random.default_rng(2)
    for _ in range(10):
        centre = rng.uniform([-0.2, -0.15, 0.4], [0.2, 0.15, 0.9])
        ball = Ball(centre, rng.uniform(0.01, 0.05), tuple(rng.integers(256, size=3).tolist()), ambient=0.5)
        light = rng.normal(size=3)
        light /= np.linalg.norm(light)
        middle = 2 * camera.project(centre)[0].astype(int)
        (top, left), size = (middle[::-1] - 60).tolist(), (110, 130)
        picture, mask = ball_samples(
            (top, left), size, 2, camera.numbers, tuple(centre), ball.radius, tuple(light), ball.ambient,
            np.array(ball.color, dtype=float),
        )  # fmt: skip
        region = (top, top + size[0]), (left, left + size[1])
        expected_picture, expected_mask = numpy_ball(camera, region, 2, centre, ball, light)
        np.testing.assert_array_equal(mask, expected_mask)
        np.testing.assert_array_equal(picture, expected_picture)


def test_a_tube_has_the_width_of_a_cylinder():
    view = STEREO[0]
    middle = transform_points(view.pose, [[0.0, 0.0, 0.6]])[0]
    tube = Tube(middle + np.outer([-0.05, 0.0, 0.05], [0, 0, 1.0]), 0.03, ((0, 0, 0),))
    image = render(
        replace(BRIO, distortion=(), principal_point=None), view.pose, [tube], background=(255,) * 3
    )
    width = (image[360, :, 0] < 128).sum()
    assert width == pytest.approx(2 * 0.03 * 907 / 0.6, rel=0.02)


def numpy_strips(points, radius, camera, world_in_camera):
    """Return the corners of a tube's strips by arrays, and whether the camera sees all of them."""
    seen = transform_points(world_in_camera, points)
    across = np.cross(np.gradient(seen, axis=0), seen)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    edges = seen[:, None] + np.multiply.outer(radius, STRIPS)[..., None] * across[:, None]
    pixels = camera.project(edges).reshape(len(points), len(STRIPS), 2)
    corners = np.round(16 * np.clip(pixels, -2000, 4000)).astype(np.int32)
    strips = np.stack([corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]], axis=2)
    return strips.reshape(-1, 4, 2), camera.sees(edges.reshape(-1, 3))


@pytest.mark.parametrize("view", [*STEREO, SIDE_CAMERA])
@pytest.mark.parametrize("distortion", [(), BRIO.distortion, BARREL.distortion])
def test_compiled_outline_of_a_tube_is_that_of_arrays(view, distortion):
    camera, world_in_camera = replace(view.camera, distortion=distortion), invert_pose(view.pose)
    rng = np.random.default_rng(3)
    left_out = 0
    for count in rng.integers(2, 10, 100):
        points = rng.uniform([-0.5, -0.4, 0.2], [0.5, 0.6, 1.0]) + rng.normal(0, 0.1, (count, 3))
        radius = rng.uniform(0.005, 0.05, count)
        strips = tube_strips(points, radius, STRIPS, world_in_camera, camera.numbers, NEAR, camera.reach)
        expected, whole = numpy_strips(points, radius, camera, world_in_camera)
        np.testing.assert_array_equal(strips, expected if whole else np.empty((0, 4, 2)))
        left_out += not whole
    assert left_out < 100


def test_the_slices_of_a_tube_take_its_colours_in_turn():
    points = np.column_stack([np.zeros(5), np.linspace(-0.1, 0.1, 5), np.full(5, 0.6)])
    image = render(PINHOLE, np.eye(4), [Tube(points, 0.03, ((200, 0, 0), (0, 0, 200)))], background=(0, 0, 0))
    middles = PINHOLE.project((points[:-1] + points[1:]) / 2).astype(int)
    assert [image[row, column].argmax() for column, row in middles] == [0, 2, 0, 2]

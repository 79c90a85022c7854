"""Distances between a soft arm and spheres, with their derivatives; the S and O of Lai et al., Eq. (29)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.arcs import backbone, chain_transform_and_jacobian
from soro_lib.checks import check_fields
from soro_lib.controllers.steering_step import Clearance
from soro_lib.robots.base import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sphere:
    """A spherical obstacle.

    Parameters
    ----------
    centre : tuple of 3 floats
        In the frame {W} [m].
    radius : float
        [m].
    """

    centre: tuple[float, float, float]
    radius: float

    def __post_init__(self) -> None:
        check_fields(self, "centre", shape=(3,))
        check_fields(self, "radius", above=0)


def clearances(
    robot: Robot, actuation: ArrayLike, obstacles: Sequence[Sphere], points_per_piece: int = 40
) -> list[Clearance]:
    """Return, for every obstacle and every soft piece of the arm, its nearest point, nearest first.

    Parameters
    ----------
    robot : Robot
        Must offer ``outer_radius`` [m] besides the usual.
    actuation : array_like (n,)
        Configuration of the arm.
    obstacles : sequence of Sphere
        What to stay clear of.
    points_per_piece : int
        Points on each arc that are looked at.
    """
    pieces, slope = robot.configuration(actuation), robot.configuration_jacobian(actuation)
    body = float(getattr(robot, "outer_radius", 0.0))
    points = backbone(pieces, points_per_piece)[1:].reshape(len(pieces), points_per_piece, 3)
    found = []
    for obstacle in obstacles:
        distance = np.linalg.norm(points - np.array(obstacle.centre), axis=-1)
        for piece in range(1, len(pieces)):  # piece 0 is the slide, behind the base
            share = (int(np.argmin(distance[piece])) + 1) / points_per_piece
            found.append(_clearance(pieces, slope, piece, share, obstacle, body))
    return sorted(found, key=lambda item: item.distance - item.contact)


def smallest_clearance(
    robot: Robot, actuations: ArrayLike, obstacle: Sphere, points_per_piece: int = 100
) -> Array:
    """Return the gap [m] between arm and obstacle, negative in collision, for actuations (..., n)."""
    pieces = robot.configuration(actuations)
    points = backbone(pieces, points_per_piece)[..., points_per_piece:, :]  # from the base on
    distance = np.linalg.norm(points - np.array(obstacle.centre), axis=-1).min(axis=-1)
    return distance - obstacle.radius - float(getattr(robot, "outer_radius", 0.0))


def _clearance(
    pieces: Array, slope: Array, piece: int, share: float, obstacle: Sphere, body: float
) -> Clearance:
    """Return distance and gradient of the point at ``share`` of one piece: an arc cut short is an arc."""
    part = pieces[: piece + 1].copy()
    part[piece] *= share
    part_slope = slope[: 3 * (piece + 1)].copy()
    part_slope[3 * piece :] *= share
    pose, jacobian = chain_transform_and_jacobian(part)
    offset = pose[:3, 3] - np.array(obstacle.centre)
    distance = float(np.linalg.norm(offset))
    gradient = offset / max(distance, 1e-9) @ jacobian[:3] @ part_slope
    return Clearance(distance, gradient, obstacle.radius + body)

"""Distances between a soft arm and spheres, with their derivatives; the S and O of Lai et al., Eq. (29)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.arcs import chain_jacobian, chain_transform
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
        if len(self.centre) != 3 or not all(map(math.isfinite, self.centre)):
            raise ValueError(f"Sphere.centre = {self.centre}, must be 3 finite numbers")
        if not 0 < self.radius < math.inf:
            raise ValueError(f"Sphere.radius = {self.radius}, must be > 0 and finite")


def clearances(
    robot: Robot, actuation: ArrayLike, obstacles: Sequence[Sphere], points_per_piece: int = 10
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
    found = []
    for piece in range(1, len(pieces)):  # piece 0 is the slide, behind the base
        points = robot_points(pieces, piece, points_per_piece)
        for obstacle in obstacles:
            distance = np.linalg.norm(points - np.array(obstacle.centre), axis=1)
            share = (int(np.argmin(distance)) + 1) / points_per_piece
            found.append(_clearance(pieces, slope, piece, share, obstacle, body))
    return sorted(found, key=lambda item: item.distance - item.contact)


def robot_points(pieces: Array, piece: int, count: int) -> Array:
    """Return points (count, 3) [m] along one piece of a chain, its end last."""
    chains = np.repeat(pieces[None, : piece + 1], count, axis=0)
    chains[:, piece] *= (np.arange(1, count + 1) / count)[:, None]
    return chain_transform(chains)[:, :3, 3]


def _clearance(
    pieces: Array, slope: Array, piece: int, share: float, obstacle: Sphere, body: float
) -> Clearance:
    """Return distance and gradient of the point at ``share`` of one piece: an arc cut short is an arc."""
    part = pieces[: piece + 1].copy()
    part[piece] *= share
    part_slope = slope[: 3 * (piece + 1)].copy()
    part_slope[3 * piece :] *= share
    offset = chain_transform(part)[:3, 3] - np.array(obstacle.centre)
    distance = float(np.linalg.norm(offset))
    gradient = offset / max(distance, 1e-9) @ chain_jacobian(part)[:3] @ part_slope
    return Clearance(distance, gradient, obstacle.radius + body)

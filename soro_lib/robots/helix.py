"""The three-segment tendon-driven arm "Helix" of Vervloet, Sections 2.1 and 3.1, with its gripper.

Two frames are in use. ``arm_base`` has z along the hanging arm, downward: all kinematics are written in it.
``origin`` has z upward: the camera system and the text of Section 4 use it. They differ by a half turn about
x.
"""

import warnings
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from soro_lib.arcs import chain_transform, chain_transform_and_jacobian, routing_matrix
from soro_lib.checks import check_fields, finite, number
from soro_lib.robots.base import (
    LIMIT_TOLERANCE,
    ActuationError,
    ActuationWarning,
    ClippedActuation,
    FloatArray,
    Robot,
    report_clipping,
)

TENDON_ANGLES = 2.0 * np.pi / 3.0 * np.arange(3)
"""Directions of the three tendons of a segment about z [rad], before the segment's own offset."""

ORIGIN_FROM_ARM_BASE = np.diag([1.0, -1.0, -1.0])
"""Rotation from arm_base (z down) to origin (z up), and back: it is its own inverse."""


@dataclass(frozen=True)
class HelixArm(Robot):
    """Three tendon-driven segments and a gripper, hanging down.

    The actuation is the state q = (dx1, dy1, l1, dx2, dy2, l2, dx3, dy3, l3) of Eq. (7), which the tendons
    impose through the map :meth:`tendon_lengths`. Frame: arm_base, z down. The tip of `forward` is the wrist,
    the end of the third segment; the gripper point lies `gripper_length` further along its z axis.

    Parameters
    ----------
    rest_lengths : tuple of 3 float
        Lengths of the calibrated segments [m] (Vervloet, Section 3.1).
    maximum_bends : tuple of 3 float
        Largest bending angle of each segment [rad] (Eq. (11)).
    minimum_lengths, maximum_lengths : tuple of 3 float
        Limits of the segment lengths [m] (Eq. (11)).
    gripper_length : float
        Distance from wrist to gripper point [m] (Eq. (13), erratum: the norm, not its square).
    tendon_radius : float
        Distance of the tendons from the backbone [m]; not printed, 0.03 is supported by the public
        description of the arm. It cancels wherever all tendons are taut.
    tendon_offsets : tuple of 3 float
        Rotation of the tendons of each segment about z [rad]; not printed.
    pulley_radius : float
        Radius of the motor pulleys [m]; public software of the arm.
    motor_orientations : tuple of 9 int
        Turning sense of each motor, +1 or -1; public software of the arm.

    Raises
    ------
    ValueError
        If a parameter is out of range; the message names it and its bound.

    Examples
    --------
    >>> arm = HelixArm()
    >>> arm.tip_points(arm.home).round(3)
    array([0. , 0. , 0.6, 0. , 0. , 0.7])
    """

    rest_lengths: tuple[float, float, float] = (0.12, 0.24, 0.24)
    maximum_bends: tuple[float, float, float] = (np.pi / 4.0, np.pi / 2.0, np.pi / 2.0)
    minimum_lengths: tuple[float, float, float] = (0.08, 0.16, 0.16)
    maximum_lengths: tuple[float, float, float] = (0.14, 0.26, 0.26)
    gripper_length: float = 0.10
    tendon_radius: float = 0.03
    tendon_offsets: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pulley_radius: float = 0.010
    motor_orientations: tuple[int, ...] = (1, 1, 1, 1, 1, 1, -1, -1, -1)
    actuator_names: tuple[str, ...] = field(
        default=tuple(
            f"{part}{i} [{unit}]"
            for i in (1, 2, 3)
            for part, unit in zip(("dx", "dy", "l"), ("rad", "rad", "m"))
        ),
        init=False,
        repr=False,
    )

    def __post_init__(self) -> None:
        check_fields(self, "tendon_radius", "pulley_radius", "gripper_length", above=0)
        check_fields(self, "maximum_bends", "minimum_lengths", shape=(3,), above=0)
        check_fields(self, "rest_lengths", "maximum_lengths", "tendon_offsets", shape=(3,))
        bounds = zip(self.minimum_lengths, self.rest_lengths, self.maximum_lengths)
        for i, (low, rest, high) in enumerate(bounds):
            number(f"HelixArm.rest_lengths[{i}]", rest, at_least=low, at_most=high)
        if len(self.motor_orientations) != 9 or not set(self.motor_orientations) <= {-1, 1}:
            raise ValueError(f"motor_orientations must be nine of -1 and +1, got {self.motor_orientations!r}")

    @cached_property
    def lower(self) -> FloatArray:
        """Lower limits of q; each bend is limited by its magnitude too, see `bends_and_lengths`."""
        return _as_state(-np.asarray(self.maximum_bends), self.minimum_lengths)

    @cached_property
    def upper(self) -> FloatArray:
        """Upper limits of q; each bend is limited by its magnitude too, see `bends_and_lengths`."""
        return _as_state(self.maximum_bends, self.maximum_lengths)

    @cached_property
    def home(self) -> FloatArray:
        """The calibrated state: straight, at rest length (Vervloet, X_0 of Section 3.1)."""
        return _as_state(np.zeros(3), self.rest_lengths)

    def check(self, actuation: ArrayLike) -> FloatArray:
        """Return q as an array: Vervloet, Eqs. (10)-(11).

        Raises
        ------
        ActuationError
            If q is malformed, not finite, or an entry leaves `lower` to `upper`.

        Warns
        -----
        ActuationWarning
            If the bend hypot(dx, dy) of a segment exceeds its limit although dx and dy respect theirs.
        """
        q = super().check(actuation)
        bends = self.bends_and_lengths(q)[..., ::2]
        too_far = bends > np.asarray(self.maximum_bends) * (1.0 + LIMIT_TOLERANCE)
        if too_far.any():
            index = tuple(np.argwhere(too_far)[0])
            segment = int(index[-1])
            warnings.warn(
                f"the bend hypot(dx, dy) of segment {segment + 1} is {bends[index]:.6g} rad, "
                f"above its limit {self.maximum_bends[segment]:.6g}",
                ActuationWarning,
                stacklevel=3,
            )
        return q

    def clip(self, actuation: ArrayLike) -> ClippedActuation:
        """Return the nearest q within the limits, bends shrunk in their own plane, and the report."""
        q = finite("actuation", actuation, (..., 9), ActuationError)
        bends = self.bends_and_lengths(q)[..., ::2]
        maximum = np.asarray(self.maximum_bends)
        shrink = np.divide(maximum, bends, out=np.ones_like(bends), where=bends > maximum)
        clipped = q.reshape(*q.shape[:-1], 3, 3).copy()
        clipped[..., :2] *= shrink[..., np.newaxis]
        clipped[..., 2] = np.clip(clipped[..., 2], self.minimum_lengths, self.maximum_lengths)
        return report_clipping(q, clipped.reshape(q.shape))

    def configuration(self, actuation: ArrayLike) -> FloatArray:
        """Return the three segments of q, shape (..., 3, 3) of (dx, dy, length): Vervloet, Eq. (7)."""
        q = self.check(actuation)
        return q.reshape(*q.shape[:-1], 3, 3)

    def configuration_jacobian(self, actuation: ArrayLike) -> FloatArray:
        """Return the identity, shape (..., 9, 9): the actuation is the configuration."""
        return np.broadcast_to(np.eye(9), (*self.check(actuation).shape[:-1], 9, 9))

    def bends_and_lengths(self, q: ArrayLike) -> FloatArray:
        """Return (d1, l1, d2, l2, d3, l3), shape (..., 6), with d = hypot(dx, dy): Vervloet, Eqs. (8)-(9)."""
        segments = self._segments(q)
        pairs = np.stack([np.hypot(segments[..., 0], segments[..., 1]), segments[..., 2]], axis=-1)
        return pairs.reshape(*pairs.shape[:-2], 6)

    def tip_points(self, q: ArrayLike) -> FloatArray:
        """Return the wrist and the gripper point, shape (..., 6) [m]: the pose vector X of Vervloet.

        Any finite state is accepted, also one outside the limits: estimates of the state (Section 3.4) are
        not commands and need not respect them.
        """
        return self._points(chain_transform(self._segments(q)))

    def tip_points_jacobian(self, q: ArrayLike) -> FloatArray:
        """Return dX/dq, shape (..., 6, 9); its rank is 5, since wrist and gripper keep their distance."""
        return self.tip_points_and_jacobian(q)[1]

    def tip_points_and_jacobian(self, q: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return `tip_points` and `tip_points_jacobian` from one pass along the arm."""
        wrist, jacobian = chain_transform_and_jacobian(self._segments(q))
        reach = self.gripper_length * wrist[..., :3, 2]
        swing = np.cross(jacobian[..., 3:, :], reach[..., np.newaxis], axis=-2)
        rows = np.concatenate([jacobian[..., :3, :], jacobian[..., :3, :] + swing], axis=-2)
        return self._points(wrist), rows

    def tendon_lengths(self, q: ArrayLike) -> FloatArray:
        """Return the nine tendon lengths g(q) [m], shape (..., 9), three per segment from base to tip.

        The thesis calls g nonlinear and does not print it; for tendons that keep their place in every
        cross-section it is linear (`soro_lib.arcs.routing_matrix`). Bowden cables decouple the segments.
        """
        lengths = np.einsum("ijk,...ik->...ij", self._routing, self._segments(q))
        return lengths.reshape(*lengths.shape[:-2], 9)

    def state_from_tendons(self, lengths: ArrayLike) -> FloatArray:
        """Return the state q, shape (..., 9), of nine tendon lengths [m]: the inverse of `tendon_lengths`."""
        strands = self._segments(lengths, "lengths")
        segments = np.einsum("ijk,...ik->...ij", self._inverse_routing, strands)
        return segments.reshape(*segments.shape[:-2], 9)

    def motor_angles(self, lengths: ArrayLike) -> FloatArray:
        """Return the motor angles [rad] from calibration, shape (..., 9), of nine tendon lengths [m]."""
        strands = finite("lengths", lengths, (..., 9), ActuationError)
        change = strands - self.tendon_lengths(self.home)
        return np.asarray(self.motor_orientations) * change / self.pulley_radius

    def tendons_from_motors(self, angles: ArrayLike) -> FloatArray:
        """Return the tendon lengths [m], shape (..., 9), of nine motor angles [rad] from calibration."""
        turned = finite("angles", angles, (..., 9), ActuationError)
        return (
            self.tendon_lengths(self.home) + np.asarray(self.motor_orientations) * turned * self.pulley_radius
        )

    def _points(self, wrist: FloatArray) -> FloatArray:
        position, pointing = wrist[..., :3, 3], wrist[..., :3, 2]
        return np.concatenate([position, position + self.gripper_length * pointing], axis=-1)

    @cached_property
    def _inverse_routing(self) -> FloatArray:
        """Inverses (3, 3, 3) of the routing, by cofactors: the same bits on every processor."""
        a, b, c = np.moveaxis(self._routing, -1, 0)
        rows = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)
        return rows / np.sum(a * rows[..., 0, :], axis=-1)[..., None, None]

    @cached_property
    def _routing(self) -> FloatArray:
        return np.stack([routing_matrix(self.tendon_radius, TENDON_ANGLES + b) for b in self.tendon_offsets])

    @staticmethod
    def _segments(values: ArrayLike, name: str = "q") -> FloatArray:
        array = finite(name, values, (..., 9), ActuationError)
        return array.reshape(*array.shape[:-1], 3, 3)


def origin_from_arm_base(points: ArrayLike) -> FloatArray:
    """Return points or directions, shape (..., 3), of arm_base (z down) in origin (z up); its own inverse."""
    return np.asarray(points, dtype=float) @ ORIGIN_FROM_ARM_BASE


def _as_state(bends: ArrayLike, lengths: ArrayLike) -> FloatArray:
    return np.stack([bends, bends, lengths], axis=-1).ravel().astype(float)

"""A simulated prototype of the cable-driven arm: the arm as it was built, mounted, pulled and measured.

It differs from the model for stated physical reasons only, each drawn once per session from a declared range.
No error is added to make a figure. Two actuations are offered: cables pulled with a commanded force, and
cables wound to a commanded length.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from soro_lib.arcs import chain_transform
from soro_lib.robots.cable_driven import CABLE_ANGLES, CableDrivenArm

Array = NDArray[np.float64]

_AROUND = np.column_stack([np.cos(CABLE_ANGLES), np.sin(CABLE_ANGLES)])


@dataclass(frozen=True)
class PrototypeRanges:
    """How far a prototype may be from its model; fixed before the first run.

    Parameters
    ----------
    bending_rigidity, axial_rigidity : tuple of 2 floats
        Range of the factor on EI and EA [-]: the widths of Lai et al., Table I, declared as a prior. There
        they are the change of one segment under load, not an uncertainty; no other width is printed.
    cable_radius_sd : float
        Position of the printed cable holes [m]; a twentieth of a millimetre for PolyJet parts of this size.
    friction : tuple of 2 floats
        Coefficient of the cables in their channels [-]; tension is lost as exp(-friction * bend).
    tension_zero_sd : float
        Error of the force that a cable has at rest [N]; two grams, taken up by hand.
    length_zero_sd : float
        Error of a cable's length at rest [m], for the length-controlled plant.
    base_offset_sd : float
        Registration of the base in the camera frame, per horizontal axis [m]; the camera's depth resolution.
    base_lean_sd : float
        Tilt of the mounted arm, per axis [rad].
    camera_sd : float
        Noise of a measured point across the line of sight [m].
    depth_resolution : float
        Step of the depth measurement, along Y [m] (Table II, footnote).
    """

    bending_rigidity: tuple[float, float] = (1.0, 5.5790 / 5.0211)
    axial_rigidity: tuple[float, float] = (1.0, 0.9907 / 0.8550)
    cable_radius_sd: float = 0.05e-3
    friction: tuple[float, float] = (0.05, 0.15)
    tension_zero_sd: float = 0.02
    length_zero_sd: float = 0.1e-3
    base_offset_sd: float = 1e-3
    base_lean_sd: float = 0.01
    camera_sd: float = 0.5e-3
    depth_resolution: float = 1e-3

    def __post_init__(self) -> None:
        for item in fields(self):
            value = np.asarray(getattr(self, item.name), dtype=float)
            if not np.isfinite(value).all() or (value < 0).any():
                raise ValueError(f"PrototypeRanges.{item.name} = {value}, must be finite and >= 0")
            if value.ndim and value[0] > value[1]:
                raise ValueError(f"PrototypeRanges.{item.name} = {tuple(value)}, must be (low, high)")

    def only(self, *names: str) -> "PrototypeRanges":
        """Return the same ranges with every cause but the named ones switched off."""
        off: dict[str, Any] = dict.fromkeys((item.name for item in fields(self)), 0.0)
        off |= {"bending_rigidity": (1.0, 1.0), "axial_rigidity": (1.0, 1.0), "friction": (0.0, 0.0)}
        return PrototypeRanges(**{**off, **{name: getattr(self, name) for name in names}})


@dataclass(frozen=True, eq=False)
class Prototype:
    """One prototype per session, for many sessions at once.

    Attributes
    ----------
    arm : CableDrivenArm
        The model it was built after.
    bending_rigidity, axial_rigidity : ndarray (n,)
        EI [N m^2] and EA [N].
    cable_radius : ndarray (n, 6)
        Distance of each cable from the axis [m].
    friction : ndarray (n,)
        Coefficient of friction [-].
    tension_zero : ndarray (n, 6)
        Error of the cable forces [N].
    length_zero : ndarray (n, 6)
        Error of the cable lengths [m].
    base_offset : ndarray (n, 3)
        Registration error of the base [m].
    base_lean : ndarray (n, 3)
        Rotation vector of the mounted arm [rad].
    camera_sd, depth_resolution : float
        Of the measurement [m].
    """

    arm: CableDrivenArm
    bending_rigidity: Array
    axial_rigidity: Array
    cable_radius: Array
    friction: Array
    tension_zero: Array
    length_zero: Array
    base_offset: Array
    base_lean: Array
    camera_sd: float
    depth_resolution: float

    @property
    def sessions(self) -> int:
        """Number of sessions n."""
        return len(self.friction)

    def configuration(self, actuation: ArrayLike, by_length: bool = False, branch: float = 1.0) -> Array:
        """Return the true pieces (n, 3, 3) of (dx, dy, length) under a command (7,) of the model's actuation.

        Parameters
        ----------
        actuation : array_like (7,)
            Slide [m] and six cable commands (minus the tension in N).
        by_length : bool
            Wind the cables to the lengths that the model predicts, instead of pulling with the forces.
        branch : float
            +1 when the cables were last pulled, -1 when they were last released: the sign of friction.
        """
        command = self.arm.check(actuation)
        if by_length:
            return self._pieces(command[0], self._tension_from_length(command))
        return self._pieces(command[0], self._tension_from_force(command, branch))

    def points(
        self, actuation: ArrayLike, by_length: bool = False, branch: float = 1.0
    ) -> tuple[Array, Array]:
        """Return where base, mid and tip truly are in the camera's frame {W}, and where the tip points.

        Returns
        -------
        points : ndarray (n, 3, 3)
            Positions of {B}, {M}, {T} [m].
        direction : ndarray (n, 3)
            Unit pointing direction of the tip.
        """
        pieces = self.configuration(actuation, by_length, branch)
        lean = Rotation.from_rotvec(self.base_lean).as_matrix()
        poses = [chain_transform(pieces[:, :count]) for count in (1, 2, 3)]
        at_rest = np.array([0.0, 0.0, float(np.asarray(actuation)[0])])
        relative = np.stack([pose[:, :3, 3] for pose in poses], axis=1) - at_rest
        points = at_rest + np.einsum("nij,npj->npi", lean, relative) + self.base_offset[:, None]
        return points, np.einsum("nij,nj->ni", lean, poses[2][:, :3, 2])

    def measured(self, points: Array, rng: np.random.Generator) -> Array:
        """Return points (n, ..., 3) [m] as the depth camera sees them: with noise, and Y in steps."""
        seen = points + self.camera_sd * rng.standard_normal(points.shape)
        if self.depth_resolution > 0:
            seen[..., 1] = np.round(seen[..., 1] / self.depth_resolution) * self.depth_resolution
        return seen

    # --- from command to tension -----------------------------------------------------------------------

    def _tension_from_force(self, command: Array, branch: float) -> Array:
        """Return tensions (n, 6) [N] behind friction; the bend that causes it is the model's."""
        pulled = np.maximum(-command[1:] + self.tension_zero, 0.0)
        bend = np.linalg.norm(self.arm.segments(command)[:, :2], axis=1)
        wrapped = np.repeat([bend[0], bend[0] + bend[1]], 3)
        return pulled * np.exp(-branch * self.friction[:, None] * wrapped)

    def _tension_from_length(self, command: Array) -> Array:
        """Return tensions (n, 6) [N] that make every cable as long as wound, or slack.

        Solves ``0 <= tension``, ``0 <= wound - path``, one of them zero, by a semismooth Newton method on
        the minimum of both. The cables do not stretch and their friction is neglected: it moves no length.
        """
        nominal = drawn_prototype(self.arm, None)
        wound = nominal._cable_lengths(-command[None, 1:]) + self.length_zero
        tension = np.tile(np.maximum(-command[1:], 1e-3), (self.sessions, 1))
        scale = 300.0  # N/m, the stiffness a cable feels: makes both terms newtons
        for _ in range(30):
            path = self._cable_lengths(tension)
            gap = scale * (wound - path)
            residual = np.minimum(tension, gap)
            if np.abs(residual).max() < 1e-10:
                break
            slope = np.tile(np.eye(6), (self.sessions, 1, 1))
            for cable in range(6):
                nudged = tension.copy()
                nudged[:, cable] += 1e-6
                column = -scale * (self._cable_lengths(nudged) - path) / 1e-6
                slope[:, :, cable] = np.where(gap < tension, column, slope[:, :, cable])
            tension = np.maximum(tension - np.linalg.solve(slope, residual[..., None])[..., 0], 0.0)
        return tension

    def _cable_lengths(self, tension: Array) -> Array:
        """Return the path lengths (n, 6) [m] of the cables through the bent segments."""
        proximal, distal = self._pieces(0.0, tension)[:, 1], self._pieces(0.0, tension)[:, 2]
        bend1, bend2 = proximal[:, :2] @ _AROUND.T, distal[:, :2] @ _AROUND.T
        first = proximal[:, 2:] - self.cable_radius[:, :3] * bend1
        passing = proximal[:, 2:] - self.arm.coupling_sign * self.cable_radius[:, 3:] * bend1
        return np.hstack([first, passing + distal[:, 2:] - self.cable_radius[:, 3:] * bend2])

    def _pieces(self, slide: float, tension: Array) -> Array:
        """Return pieces (n, 3, 3) under cable tensions (n, 6): the model with this prototype's values."""
        torque = tension * self.cable_radius
        moment1, moment2 = torque[:, :3] @ _AROUND, torque[:, 3:] @ _AROUND
        load1, load2 = tension.sum(axis=1), tension[:, 3:].sum(axis=1)
        stiffness = self.axial_rigidity / self.arm.segment_length
        length1, length2 = (self.arm.segment_length - load / stiffness for load in (load1, load2))
        pieces = np.zeros((len(tension), 3, 3))
        pieces[:, 0, 2] = slide
        bend1 = (moment1 + self.arm.coupling_sign * moment2) * (length1 / self.bending_rigidity)[:, None]
        pieces[:, 1] = np.column_stack([bend1, length1])
        pieces[:, 2] = np.column_stack([moment2 * (length2 / self.bending_rigidity)[:, None], length2])
        return pieces


def drawn_prototype(
    arm: CableDrivenArm,
    rng: np.random.Generator | None,
    sessions: int = 1,
    ranges: PrototypeRanges | None = None,
) -> Prototype:
    """Draw one prototype per session.

    Parameters
    ----------
    arm : CableDrivenArm
        The model; caps are not simulated.
    rng : Generator or None
        Source of the draws; None gives the perfect prototype.
    sessions : int
        How many [-].
    ranges : PrototypeRanges, optional
        How far each may be from the model.
    """
    if rng is None:
        ranges, rng = PrototypeRanges().only(), np.random.default_rng(0)
    ranges = ranges or PrototypeRanges()
    if arm.cap_length:
        raise ValueError(f"the prototype has no caps, got cap_length = {arm.cap_length} m")
    if sessions < 1:
        raise ValueError(f"sessions = {sessions}, must be >= 1")

    def normal(sd: float, width: int) -> Array:
        return sd * rng.standard_normal((sessions, width))

    lean, offset = np.zeros((2, sessions, 3))
    bending = arm.bending_rigidity * rng.uniform(*ranges.bending_rigidity, sessions)
    axial = arm.axial_rigidity * rng.uniform(*ranges.axial_rigidity, sessions)
    radius = arm.cable_radius + normal(ranges.cable_radius_sd, 6)
    friction = rng.uniform(*ranges.friction, sessions)
    tension_zero, length_zero = normal(ranges.tension_zero_sd, 6), normal(ranges.length_zero_sd, 6)
    offset[:, :2], lean[:, :2] = normal(ranges.base_offset_sd, 2), normal(ranges.base_lean_sd, 2)
    return Prototype(
        arm, bending, axial, radius, friction, tension_zero, length_zero, offset, lean,
        ranges.camera_sd, ranges.depth_resolution,
    )  # fmt: skip


def pointing_angle(tip: ArrayLike, marker: ArrayLike) -> Array:
    """Return the angle [rad] of the line from tip to marker from vertical; Lai et al., Section V.

    Parameters
    ----------
    tip, marker : array_like (..., 3)
        Measured positions [m].
    """
    offset = np.asarray(marker, dtype=float) - np.asarray(tip, dtype=float)
    return np.arctan2(np.hypot(offset[..., 0], offset[..., 1]), np.abs(offset[..., 2]))

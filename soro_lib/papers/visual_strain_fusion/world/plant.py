"""The three-chamber arm as it might really behave: a simulated plant for the controllers of Wang et al.

The controller believes in a linear map from stepper to chamber and in a constant curvature. The plant does
not: its steppers lose the fraction of a step, its chambers have a dead band, hardly contract under suction
and stretch nonlinearly, its transmission has play, and its backbone bends unevenly under the tip's weight.
Leading axes of commands and parameters broadcast, so a batch of plants runs as one.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.arcs import chain_transform
from soro_lib.robots.pneumatic import PneumaticArm

Array = NDArray[np.float64]

REFERENCE_STRETCH = 0.005
"""Stretch at which the gain of a chamber is stated, whatever its exponent [m]."""


def _check_fields(parameters: Any, **bounds: tuple[float, float]) -> None:
    for name, (low, high) in bounds.items():
        value = np.asarray(getattr(parameters, name), dtype=float)
        if not (np.isfinite(value).all() and (value >= low).all() and (value <= high).all()):
            raise ValueError(f"{name} must be finite and in [{low}, {high}], got {value}")


@dataclass(frozen=True)
class ChamberParameters:
    """Steppers, transmission and chambers; each field is a float or an array that broadcasts to a batch.

    Attributes
    ----------
    gain : float
        Elongation per commanded elongation at a stretch of 5 mm [-].
    resolution : float
        Smallest increment that a stepper executes; the rest of a command is lost [m]. 0 for none lost.
    play : float
        Width of the backlash of the transmission [m].
    dead_band : float
        Commanded elongation that a chamber swallows before it stretches [m].
    softness : float
        Width of the transition out of the dead band [m].
    exponent : float
        Power of the stretch curve; 1 is linear [-].
    suction : float
        Contraction per commanded contraction; below 1 because silicone resists it [-].
    """

    gain: Any = 1.0
    resolution: Any = 0.0
    play: Any = 0.0
    dead_band: Any = 0.0
    softness: Any = 0.0
    exponent: Any = 1.0
    suction: Any = 1.0

    def __post_init__(self) -> None:
        """Check the values; the error names the field and its bounds."""
        length = (0.0, 1e-2)
        _check_fields(self, gain=(1e-3, 1e3), exponent=(0.1, 10.0), suction=(0.0, 10.0))
        _check_fields(self, resolution=length, play=length, dead_band=length, softness=length)

    def stretch(self, displacement: ArrayLike) -> Array:
        """Elongation of a chamber for a displacement of its piston past the play, zero at zero [m]."""
        displacement = np.asarray(displacement, dtype=float)
        pushed = _soft_positive(displacement - self.dead_band, self.softness)
        rest = _soft_positive(-np.asarray(self.dead_band, dtype=float), self.softness)
        reference = REFERENCE_STRETCH
        curve = reference * ((pushed / reference) ** self.exponent - (rest / reference) ** self.exponent)
        return self.gain * curve + self.suction * np.minimum(displacement, 0.0)


def _soft_positive(value: ArrayLike, softness: ArrayLike) -> Array:
    """Positive part of a value with a rounded corner of the given width."""
    width = np.maximum(softness, 1e-12)
    return width * np.logaddexp(0.0, np.asarray(value, dtype=float) / width)


@dataclass(frozen=True)
class BackboneParameters:
    """How unevenly the backbone bends; all zero is constant curvature.

    Attributes
    ----------
    taper : float
        Relative change of curvature from base to tip [-].
    threefold : float
        Stiffness ripple over the bending direction, three times around for three chambers [-].
    tip_weight : float
        Curvature that the hanging tip weight takes back per lever arm [1/m^2].
    segments : int
        Number of arcs that the backbone is integrated with.
    """

    taper: float = 0.25
    threefold: float = 0.06
    tip_weight: float = 22.0
    segments: int = 18

    def __post_init__(self) -> None:
        """Check the values; the error names the field and its bounds."""
        _check_fields(self, taper=(-1.0, 1.0), threefold=(-0.5, 0.5))
        _check_fields(self, tip_weight=(0.0, 200.0), segments=(1, 1000))

    def shape(self, bending: ArrayLike, length: ArrayLike, contact: ArrayLike | None = None) -> Array:
        """Arcs of the backbone for a constant-curvature bending angle.

        Parameters
        ----------
        bending : array_like (..., 2)
            Bending angle that the chambers ask for [rad].
        length : array_like (...)
            Length of the backbone [m].
        contact : array_like (..., n, 2), optional
            Extra curvature by contact forces, as from `contact_curvature` [1/m].

        Returns
        -------
        ndarray (..., n, 3)
            Arcs ``(dx, dy, length)`` from base to tip.
        """
        bending, length = np.asarray(bending, dtype=float), np.asarray(length, dtype=float)[..., None]
        angle = np.sqrt(np.sum(bending**2, axis=-1))
        direction = np.arctan2(bending[..., 1], bending[..., 0])
        ripple = np.cos(3.0 * direction)
        direction = direction + 0.6 * self.threefold * np.sin(3.0 * direction)
        heading = np.stack([np.cos(direction), np.sin(direction)], axis=-1)[..., None, :]
        station = (np.arange(self.segments) + 0.5) / self.segments
        even = (angle * (1.0 + self.threefold * ripple))[..., None] / length
        active = even * (1.0 + self.taper * (station - 0.5))
        lever = length * (_offset(angle[..., None]) - station * _offset(angle[..., None] * station))
        curvature = (active - self.tip_weight * lever)[..., None] * heading
        if contact is not None:
            curvature = curvature + np.asarray(contact, dtype=float)
        step = np.broadcast_to(length / self.segments, curvature.shape[:-1])
        return np.concatenate([curvature * step[..., None], step[..., None]], axis=-1)

    def contact_curvature(self, force: ArrayLike, station: ArrayLike) -> Array:
        """Curvature by a lateral force at one station: its moment falls linearly to zero there.

        Parameters
        ----------
        force : array_like (..., 2)
            Force over bending stiffness, per length of the arm [1/m].
        station : array_like (...)
            Where it acts, 0 at the base, 1 at the cap [-].

        Returns
        -------
        ndarray (..., n, 2)
            Extra curvature [1/m].
        """
        stations = (np.arange(self.segments) + 0.5) / self.segments
        lever = np.maximum(np.asarray(station, dtype=float)[..., None] - stations, 0.0)
        return np.asarray(force, dtype=float)[..., None, :] * lever[..., None]


def _offset(angle: Array) -> Array:
    """Sideways offset of the end of an arc per length, ``(1 - cos angle) / angle``, odd and smooth."""
    half = 0.5 * angle
    return np.sin(half) * np.sinc(half / np.pi)


@dataclass(frozen=True)
class Wall:
    """A smooth rod beside the arm that lets it bend only so far to one side; friction is left out.

    Attributes
    ----------
    direction : float
        Side of the rod, from x toward y [rad].
    limit : float
        Largest bending angle toward it [rad].
    """

    direction: float
    limit: float

    def stop(self, bending: Array) -> Array:
        """Bending angles ``(..., 2)`` after the rod took away what goes beyond it [rad]."""
        normal = np.array([np.cos(self.direction), np.sin(self.direction)])
        beyond = np.maximum(bending @ normal - self.limit, 0.0)
        return np.asarray(bending - beyond[..., None] * normal, dtype=np.float64)


class PneumaticPlant:
    """A batch of simulated three-chamber arms with the state of their steppers and their play.

    Parameters
    ----------
    arm : PneumaticArm
        Geometry.
    chambers : ChamberParameters
        Steppers, transmission, chambers.
    backbone : BackboneParameters or None
        How the backbone bends; None for constant curvature.
    batch : tuple of int
        Leading shape of the batch.
    wall : Wall or None
        A rod beside the arm.

    Notes
    -----
    The plant starts at rest: at the arm's home lengths, in the middle of its play.
    """

    def __init__(
        self,
        arm: PneumaticArm,
        chambers: ChamberParameters,
        backbone: BackboneParameters | None = None,
        batch: tuple[int, ...] = (),
        wall: Wall | None = None,
    ) -> None:
        self.arm, self.chambers, self.backbone, self.wall = arm, chambers, backbone, wall
        self._home = np.asarray(arm.home, dtype=float)
        self.motors = np.broadcast_to(self._home, (*batch, 3)).copy()
        self._piston = np.zeros((*batch, 3))

    def drive(self, lengths: ArrayLike) -> Array:
        """Send chamber lengths to the steppers; return the lengths that they executed, ``(..., 3)`` [m].

        Parameters
        ----------
        lengths : array_like (..., 3)
            Commanded chamber lengths [m].

        Raises
        ------
        ActuationError
            If a command is not finite or outside the arm's limits; the plant has not moved then.
        """
        increment = self.arm.check(lengths) - self.motors
        resolution = np.asarray(self.chambers.resolution, dtype=float)
        whole = np.trunc(increment / np.where(resolution > 0.0, resolution, 1.0)) * resolution
        self.motors = self.motors + np.where(resolution > 0.0, whole, increment)
        command = self.motors - self._home
        half_play = 0.5 * np.asarray(self.chambers.play, dtype=float)
        self._piston = np.clip(self._piston, command - half_play, command + half_play)
        return self.motors

    @property
    def lengths(self) -> Array:
        """True chamber lengths, ``(..., 3)``, which stop at the limits of the arm [m]."""
        lengths = self._home + self.chambers.stretch(self._piston)
        return np.clip(lengths, self.arm.lower, self.arm.upper)

    @property
    def configuration(self) -> Array:
        """Arcs of the true backbone, ``(..., n, 3)``."""
        arcs = self.arm.configuration(self.lengths)
        if self.wall is not None:
            arcs[..., :2] = self.wall.stop(arcs[..., :2])
        if self.backbone is None:
            return arcs
        return self.backbone.shape(arcs[..., 0, :2], arcs[..., 0, 2])

    @property
    def tip(self) -> Array:
        """True tip position in the base frame, ``(..., 3)`` [m]."""
        return chain_transform(self.configuration)[..., :3, 3]

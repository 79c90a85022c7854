"""The two-segment cable-driven arm on a slide: compressible curvature model of Lai et al., Section II.

Pulling a cable both bends and shortens its segment, and the distal cables load the proximal segment too.
Written with moment vectors instead of the paper's angles, nothing is singular at the straight arm: the
bending angle of a segment is the vector ``(dx, dy) = moment * length / EI``.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from soro_lib.arcs import chain_jacobian, chain_transform
from soro_lib.checks import check_fields, one_of
from soro_lib.robots.base import FloatArray, Robot

CABLE_ANGLES = 2.0 * np.pi / 3.0 * np.arange(3)
"""Directions of the three cables of a segment about z [rad]."""


@dataclass(frozen=True)
class CableDrivenArm(Robot):
    """Two soft segments with three cables each, on a linear slide.

    The actuation is (slide [m], q11, q12, q13, q21, q22, q23): three proximal, then three distal cable
    commands in the paper's range -2 to 0, read as minus the tension in N. The base frame is the paper's world
    frame {W}: the slide moves along +z, the straight arm points along +z.

    Parameters
    ----------
    young_modulus : float
        Young's modulus of the body [Pa] (Lai et al., Table I).
    outer_radius, inner_radius : float
        Radii of the annular body [m]. Not printed in the paper; taken from the authors' public program.
    cable_radius : float
        Distance r of the cables from the axis [m]; same source.
    segment_length : float
        Length L of an unloaded segment [m] (Table I).
    coupling_sign : int
        Sign of the distal moment in the proximal segment, ``cos(zeta)`` of Eqs. (1)-(2): -1 for the printed
        installation angle zeta = pi, +1 for what virtual work gives for straight cables.
    cap_length : float
        Length of the rigid cap after each soft segment [m].
    slide_length : float
        Stroke of the slide [m] (60 mm below Eq. (26)).
    maximum_tension : float
        Largest cable tension [N] (2, below Eq. (26)).

    Raises
    ------
    ValueError
        If a parameter is out of range; the message names it and its bound.

    Examples
    --------
    >>> arm = CableDrivenArm()
    >>> arm.tip([0.05, 0, 0, 0, 0, 0, 0]).round(3)
    array([0.  , 0.  , 0.15])
    """

    young_modulus: float = 0.8e6
    outer_radius: float = 4.5e-3
    inner_radius: float = 1.8e-3
    cable_radius: float = 3.15e-3
    segment_length: float = 0.05
    coupling_sign: int = -1
    cap_length: float = 0.0
    slide_length: float = 0.06
    maximum_tension: float = 2.0
    actuator_names: tuple[str, ...] = field(
        default=("slide [m]", *(f"cable {k}{i} [-N]" for k in (1, 2) for i in (1, 2, 3))),
        init=False,
        repr=False,
    )

    def __post_init__(self) -> None:
        sizes = ("young_modulus", "outer_radius", "cable_radius", "segment_length", "slide_length")
        check_fields(self, *sizes, "maximum_tension", above=0)
        check_fields(self, "inner_radius", at_least=0, below=self.outer_radius)
        check_fields(self, "cap_length", at_least=0)
        one_of("CableDrivenArm.coupling_sign", self.coupling_sign, (-1, 1))
        compression = 6.0 * self.maximum_tension / self.axial_stiffness
        if compression >= self.segment_length:
            raise ValueError(
                f"maximum_tension {self.maximum_tension} N on six cables shortens the proximal segment by "
                f"{compression:.4g} m, not less than segment_length {self.segment_length} m"
            )

    @property
    def axial_rigidity(self) -> float:
        """EA of the annular cross-section [N]."""
        return self.young_modulus * np.pi * (self.outer_radius**2 - self.inner_radius**2)

    @property
    def bending_rigidity(self) -> float:
        """EI of the annular cross-section [N m^2]."""
        return self.young_modulus * np.pi / 4.0 * (self.outer_radius**4 - self.inner_radius**4)

    @property
    def axial_stiffness(self) -> float:
        """K_a = EA / L of an unloaded segment [N/m] (Lai et al., Table I)."""
        return self.axial_rigidity / self.segment_length

    def bending_stiffness(self, length: ArrayLike) -> FloatArray:
        """K_T = EI / length [N m/rad] of a segment compressed to `length` [m] (Lai et al., Table I)."""
        return self.bending_rigidity / np.asarray(length, dtype=float)

    @cached_property
    def lower(self) -> FloatArray:
        """Lower limits: slide [m], then six cable commands (Lai et al., below Eq. (26))."""
        return np.array([0.0] + 6 * [-self.maximum_tension])

    @cached_property
    def upper(self) -> FloatArray:
        """Upper limits: slide [m], then six cable commands (Lai et al., below Eq. (26))."""
        return np.array([self.slide_length] + 6 * [0.0])

    @cached_property
    def home(self) -> FloatArray:
        """Straight and unloaded; the slide at 50 mm where its stroke allows (Table II, configuration 0)."""
        return np.array([min(0.05, self.slide_length)] + 6 * [0.0])

    def segments(self, actuation: ArrayLike) -> FloatArray:
        """Return the two soft segments, shape (..., 2, 3) of (dx, dy, length), proximal first.

        Lai et al., Eqs. (1)-(3) as one vector equation (errata GS-1 and GS-2): the moments of the cables add
        as vectors, and each segment bends by ``moment * length / EI``.
        """
        forces, moments = self._loads(self.check(actuation))
        lengths = self.segment_length - forces / self.axial_stiffness
        bends = moments * lengths[..., np.newaxis] / self.bending_rigidity
        return np.concatenate([bends, lengths[..., np.newaxis]], axis=-1)

    def configuration(self, actuation: ArrayLike) -> FloatArray:
        """Return slide, proximal segment, cap, distal segment, cap as pieces (dx, dy, length).

        Rigid pieces are straight arcs, so that the whole arm is one chain. Without caps there are three
        pieces, with caps five: shape (..., 3 or 5, 3).
        """
        soft = self.segments(actuation)
        pieces = np.zeros((*soft.shape[:-2], 5 if self.cap_length else 3, 3))
        pieces[..., 0, 2] = np.asarray(actuation, dtype=float)[..., 0]
        pieces[..., self._soft_pieces, :] = soft
        if self.cap_length:
            pieces[..., (2, 4), 2] = self.cap_length
        return pieces

    def configuration_jacobian(self, actuation: ArrayLike) -> FloatArray:
        """Return d configuration / d actuation, shape (..., 9 or 15, 7)."""
        forces, moments = self._loads(self.check(actuation))
        lengths = self.segment_length - forces / self.axial_stiffness
        force_slope, moment_slope = self.load_slopes
        length_slope = -force_slope / self.axial_stiffness
        soft = np.zeros((*forces.shape, 3, 7))
        soft[..., :2, :] = (
            moment_slope * lengths[..., np.newaxis, np.newaxis]
            + moments[..., np.newaxis] * length_slope[:, np.newaxis, :]
        ) / self.bending_rigidity
        soft[..., 2, :] = length_slope
        pieces = np.zeros((*forces.shape[:-1], 5 if self.cap_length else 3, 3, 7))
        pieces[..., 0, 2, 0] = 1.0
        pieces[..., self._soft_pieces, :, :] = soft
        return pieces.reshape(*forces.shape[:-1], -1, 7)

    def mid_point(self, actuation: ArrayLike) -> FloatArray:
        """Return the end of the proximal segment and its cap [m], shape (..., 3): frame {M} of the paper."""
        return chain_transform(self.configuration(actuation)[..., : self._mid_pieces, :])[..., :3, 3]

    def mid_jacobian(self, actuation: ArrayLike) -> FloatArray:
        """Return the Jacobian of {M}, shape (..., 6, 7): the linear rows are J_M of Lai et al., Eq. (27)."""
        count = self._mid_pieces
        pieces = self.configuration(actuation)[..., :count, :]
        return chain_jacobian(pieces) @ self.configuration_jacobian(actuation)[..., : 3 * count, :]

    @cached_property
    def load_slopes(self) -> tuple[FloatArray, FloatArray]:
        """Axial forces (2, 7) and moment vectors (2, 2, 7) per unit of actuation; rows: proximal, distal.

        The sums in Lai et al., Eqs. (1)-(3); the compiled kinematics take them from here.
        """
        tension = -np.eye(7)[1:].reshape(2, 3, 7)
        directions = self.cable_radius * np.stack([np.cos(CABLE_ANGLES), np.sin(CABLE_ANGLES)])
        own_force, own_moment = tension.sum(axis=1), directions @ tension
        force = np.stack([own_force[0] + own_force[1], own_force[1]])
        moment = np.stack([own_moment[0] + self.coupling_sign * own_moment[1], own_moment[1]])
        return force, moment

    def _loads(self, actuation: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return axial forces (..., 2) [N] and moment vectors (..., 2, 2) [N m] of the two segments."""
        force_slope, moment_slope = self.load_slopes
        return actuation @ force_slope.T, np.tensordot(actuation, moment_slope, axes=(-1, -1))

    @property
    def _soft_pieces(self) -> tuple[int, int]:
        return (1, 3) if self.cap_length else (1, 2)

    @property
    def _mid_pieces(self) -> int:
        return 3 if self.cap_length else 2

"""Two simulated Helix arms that sag, and the gripper.

The thesis has the device; the simulation needs a plant whose true shape is not the commanded one. Two are
offered, so that a claim can be checked on both:

- plant K, :class:`AngleLossPlant`: the segments realise part of the commanded bending angle; smooth and
simple.
- plant E, :class:`ElasticPlant`: the shape of least energy under gravity, with tendons that stretch and only
pull.

Both take tendon lengths (m, nine) and return the true state q (9,). A hand may hold the gripper like a
spring.
"""

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import not_negative, positive
from soro_lib.robots.helix import HelixArm
from soro_lib.robots.helix_kernels import (
    cholesky,
    cholesky_solve,
    depth_moment,
    dot,
    largest,
    multiply,
    outer_gram,
    tip_points_and_jacobian,
)

Array = NDArray[np.float64]

GRAVITY = 9.81
"""Acceleration of free fall [m/s^2]."""

LUMPS = 3
"""Equal masses that stand for each segment's weight."""

LONGEST_NEWTON_STEP = 0.15
"""Longest Newton step, in rad and 0.1 m; longer ones jump to folded shapes."""

EQUILIBRIUM_TOLERANCE = 1e-8
"""Newton step below which the shape is at rest, in rad and 0.1 m."""

ENERGY_ROUNDING = 1e-12
"""Increase of the energy that may be rounding [J]."""


@dataclass(frozen=True)
class HoldingHand:
    """A hand that holds wrist and gripper like a spring each.

    Attributes
    ----------
    points : ndarray, shape (6,)
        Where the hand wants wrist and gripper [m], frame `arm_base`.
    stiffness : float
        Of the grip, at each of the two points [N/m].
    """

    points: Array
    stiffness: float = 200.0


class HelixPlant(Protocol):
    """What a simulated arm offers to a study."""

    def settle(self, tendon_lengths: ArrayLike, hand: HoldingHand | None = None) -> Array:
        """Return the true state q (9,) at rest under the commanded tendon lengths (9,) [m]."""

    def carry(self, mass: float) -> None:
        """Hang a mass [kg] into the gripper."""

    def reset(self) -> None:
        """Forget where the arm is and what it carries."""


@dataclass(frozen=True)
class Stiffness:
    """How an arm resists bending and stretching.

    Attributes
    ----------
    bending : float
        ``EI`` [N m^2].
    axial : float
        ``EA`` [N].
    """

    bending: float = 0.040
    axial: float = 80.0

    def __post_init__(self) -> None:
        positive("bending", self.bending)
        positive("axial", self.axial)

    def diagonal(self, arm: HelixArm) -> Array:
        """Return the stiffness of each coordinate of q (9,): Nm/rad for angles, N/m for lengths."""
        lengths = np.asarray(arm.rest_lengths)
        bending = self.bending / lengths
        return np.stack([bending, bending, self.axial / lengths], axis=-1).ravel()


@dataclass
class AngleLossPlant:
    """Plant K: every segment realises a fixed share of its commanded bending angle, and its length in full.

    Gravity straightens a hanging arm; that is all this plant knows of it. The shares have no printed value:
    `soro_lib.papers.soft_handover.calibration` fits them to three numbers of the thesis.

    Parameters
    ----------
    realised : tuple of 3 float
        Share of the bending angle that segments 1 to 3 realise, in (0, 1].
    arm : HelixArm
    stiffness : Stiffness
        Against the pull of a hand.
    """

    realised: tuple[float, float, float]
    arm: HelixArm = field(default_factory=HelixArm)
    stiffness: Stiffness = field(default_factory=Stiffness)

    def __post_init__(self) -> None:
        if len(self.realised) != 3 or not all(0 < share <= 1 for share in self.realised):
            raise ValueError(f"realised must be three shares in (0, 1], got {self.realised}")
        self._shares = np.stack([self.realised, self.realised, np.ones(3)], axis=-1).ravel()

    def reset(self) -> None:
        """Forget nothing: this plant has no memory."""

    def carry(self, mass: float) -> None:
        """Take a mass [kg] without any effect: this plant knows no weight."""

    def settle(self, tendon_lengths: ArrayLike, hand: HoldingHand | None = None) -> Array:
        """Return the true state q (9,) at rest under the commanded tendon lengths (9,) [m].

        A hand moves it to the least energy of arm and grip.
        """
        free = self._shares * self.arm.state_from_tendons(tendon_lengths)
        if hand is None:
            return free
        stiffness = self.stiffness.diagonal(self.arm)
        return held_state(free, stiffness, hand.points, hand.stiffness, self.arm.gripper_length)


@njit(cache=True)
def held_state(free: Array, stiffness: Array, held: Array, grip: float, gripper_length: float) -> Array:
    """Return the state of least ``(q - free)' K (q - free) + grip |f(q) - held|^2``, by Gauss-Newton."""
    q = free.copy()
    for _ in range(50):
        gradient, hessian = stiffness * (q - free), np.diag(stiffness)
        add_grip(gradient, hessian, q, held, grip, gripper_length)
        step = cholesky_solve(cholesky(hessian), gradient)
        longest = largest(step)
        q -= min(1.0, LONGEST_NEWTON_STEP / longest) * step
        if longest < EQUILIBRIUM_TOLERANCE:
            break
    return q


@njit(cache=True)
def add_grip(
    gradient: Array, hessian: Array, q: Array, held: Array, grip: float, gripper_length: float
) -> None:
    """Add the slopes of ``grip |f(q) - held|^2 / 2`` to a gradient (9,) and a Hessian (9, 9), in place."""
    points, jacobian = tip_points_and_jacobian(q, gripper_length)
    gradient += grip * multiply(jacobian.T, points - held)
    hessian += grip * outer_gram(jacobian.T)


@dataclass
class ElasticPlant:
    """Plant E: the shape of least energy of an elastic arm under gravity whose tendons stretch and only pull.

    Energy: gravity of three lumps per segment and of the gripper, bending ``EI D^2 / (2 L0)``, axial
    ``EA (l - f L0)^2 / (2 L0)`` with a free length f L0 above the rest length (so the tendons are
    pretensioned), and ``k max(0, g(q) - l)^2 / 2`` for every tendon of commanded length l. A slack tendon
    does nothing; that is the mechanism the thesis names (Section 3.3.1). The values are a choice, not
    measurements of the device.

    Parameters
    ----------
    arm : HelixArm
    stiffness : Stiffness
    tendon_stiffness : float
        Of each tendon with its Bowden cable [N/m].
    free_length : float
        Length of an unloaded segment over its calibrated length [-].
    linear_density : float
        Mass of the arm [kg/m].
    gripper_mass, gripper_mass_distance : float
        Gripper as a lump [kg] past the wrist [m].
    """

    arm: HelixArm = field(default_factory=HelixArm)
    stiffness: Stiffness = field(default_factory=Stiffness)
    tendon_stiffness: float = 2000.0
    free_length: float = 1.20
    linear_density: float = 0.35
    gripper_mass: float = 0.25
    gripper_mass_distance: float = 0.05

    def __post_init__(self) -> None:
        for name in ("tendon_stiffness", "free_length", "linear_density"):
            positive(name, getattr(self, name))
        for name in ("gripper_mass", "gripper_mass_distance"):
            not_negative(name, getattr(self, name))
        self._tendon_map = np.ascontiguousarray(self.arm.tendon_lengths(np.eye(9)).T)
        self.reset()

    def reset(self) -> None:
        """Start the next search from the calibrated state."""
        self._state = self.arm.home.copy()
        self._payload = 0.0

    def carry(self, mass: float) -> None:
        """Hang a mass [kg] into the gripper, where its own mass is."""
        self._payload = mass

    def settle(self, tendon_lengths: ArrayLike, hand: HoldingHand | None = None) -> Array:
        """Return the true state q (9,) at rest under the commanded tendon lengths (9,) [m].

        The search starts from the last state, as the arm does.

        Raises
        ------
        RuntimeError
            If the search for the equilibrium does not come to rest.
        """
        lengths = np.asarray(self.arm.rest_lengths)
        arm = LoadedArm(
            tendons=np.asarray(tendon_lengths, dtype=float),
            tendon_map=self._tendon_map,
            tendon_stiffness=self.tendon_stiffness,
            stiffness=self.stiffness.diagonal(self.arm),
            free=np.stack([np.zeros(3), np.zeros(3), self.free_length * lengths], axis=-1).ravel(),
            masses=self.linear_density * lengths,
            tip_mass=self.gripper_mass + self._payload,
            tip_distance=self.gripper_mass_distance,
            held=hand.points if hand else np.zeros(6),
            grip=hand.stiffness if hand else 0.0,
            gripper_length=self.arm.gripper_length,
        )
        state, at_rest = equilibrium(self._state, arm)
        if not at_rest:
            raise RuntimeError("the elastic arm found no equilibrium for these tendon lengths")
        self._state = state
        return state.copy()


class LoadedArm(NamedTuple):
    """What the energy of plant E depends on besides its state; arrays in SI units, see `ElasticPlant`."""

    tendons: Array
    tendon_map: Array
    tendon_stiffness: float
    stiffness: Array
    free: Array
    masses: Array
    tip_mass: float
    tip_distance: float
    held: Array
    grip: float
    gripper_length: float


SCALE = np.array([1.0, 1.0, 0.1] * 3)
"""What the search counts each coordinate of q in: radians and 0.1 m."""


@njit(cache=True)
def equilibrium(q: Array, arm: LoadedArm) -> tuple[Array, bool]:
    """Return the state of least energy near q and whether the search came to rest (damped Newton)."""
    energy = potential_energy(q, arm)
    for _ in range(1000):
        step = newton_step(q, arm)
        length = np.sqrt(dot(step, step))
        if length < EQUILIBRIUM_TOLERANCE:
            return q, True
        share = min(1.0, LONGEST_NEWTON_STEP / length)
        moved = stepped(q, share, step)
        new_energy = potential_energy(moved, arm)
        while new_energy > energy + ENERGY_ROUNDING and share * length > EQUILIBRIUM_TOLERANCE:
            share /= 2
            moved = stepped(q, share, step)
            new_energy = potential_energy(moved, arm)
        q = moved
        energy = new_energy
    return q, length < 1e3 * EQUILIBRIUM_TOLERANCE


@njit(cache=True)
def newton_step(q: Array, arm: LoadedArm) -> Array:
    """Return the downhill Newton step (9,), in units of `SCALE`; damped where the energy is not convex."""
    gradient, hessian = energy_slopes(q, arm)
    steepest = 0.0
    for i in range(9):
        gradient[i] *= -SCALE[i]
        for j in range(9):
            hessian[i, j] *= SCALE[i] * SCALE[j]
        steepest = max(steepest, abs(hessian[i, i]))
    shift = 0.0
    factor = cholesky(hessian)
    while np.isnan(factor[0, 0]):
        shift = max(2 * shift, 1e-3 * steepest)
        damped = hessian.copy()
        for i in range(9):
            damped[i, i] += shift
        factor = cholesky(damped)
    return cholesky_solve(factor, gradient)


@njit(cache=True)
def stepped(q: Array, share: float, step: Array) -> Array:
    """Return the state (9,) after a share of a step in units of `SCALE`."""
    moved = np.empty(9)
    for i in range(9):
        moved[i] = q[i] + share * SCALE[i] * step[i]
    return moved


@njit(cache=True)
def potential_energy(q: Array, arm: LoadedArm) -> float:
    """Return the energy [J] of gravity, bending, stretching, tendons and holding hand."""
    lengths = multiply(arm.tendon_map, q)
    elastic, pulled = 0.0, 0.0
    for i in range(9):
        strain, stretch = q[i] - arm.free[i], max(lengths[i] - arm.tendons[i], 0.0)
        elastic += arm.stiffness[i] * (strain * strain)
        pulled += stretch * stretch
    moment, _ = depth_moment(q, arm.masses, LUMPS, arm.tip_mass, arm.tip_distance)
    energy = 0.5 * elastic - GRAVITY * moment
    energy += 0.5 * arm.tendon_stiffness * pulled
    if arm.grip > 0:
        points, _ = tip_points_and_jacobian(q, arm.gripper_length)
        for k in range(6):
            points[k] -= arm.held[k]
        energy += 0.5 * arm.grip * dot(points, points)
    return energy


@njit(cache=True)
def energy_slopes(q: Array, arm: LoadedArm) -> tuple[Array, Array]:
    """Return gradient (9,) and Hessian (9, 9) of `potential_energy`; gravity's curvature by differences."""
    lengths = multiply(arm.tendon_map, q)
    _, fall = depth_moment(q, arm.masses, LUMPS, arm.tip_mass, arm.tip_distance)
    gradient, hessian = np.empty(9), np.zeros((9, 9))
    for i in range(9):
        gradient[i] = arm.stiffness[i] * (q[i] - arm.free[i])
        hessian[i, i] = arm.stiffness[i]
    for k in range(9):
        stretch = lengths[k] - arm.tendons[k]
        if stretch > 0:
            for i in range(9):
                gradient[i] += arm.tendon_stiffness * stretch * arm.tendon_map[k, i]
                for j in range(9):
                    hessian[i, j] += arm.tendon_stiffness * (arm.tendon_map[k, i] * arm.tendon_map[k, j])
    nudge = 1e-7
    for j in range(9):
        nudged = q.copy()
        nudged[j] += nudge
        _, ahead = depth_moment(nudged, arm.masses, LUMPS, arm.tip_mass, arm.tip_distance)
        gradient[j] -= GRAVITY * fall[j]
        for i in range(9):
            hessian[i, j] -= GRAVITY * (ahead[i] - fall[i]) / nudge
    if arm.grip > 0:
        add_grip(gradient, hessian, q, arm.held, arm.grip, arm.gripper_length)
    for i in range(9):
        for j in range(i):
            hessian[i, j] = hessian[j, i] = 0.5 * (hessian[i, j] + hessian[j, i])
    return gradient, hessian


@dataclass
class LaggingPlant:
    """A plant that needs time: each step it covers the share ``1 - exp(-timestep / time_constant)`` of its
    way.

    Parameters
    ----------
    plant : HelixPlant
        Where the arm would come to rest.
    timestep, time_constant : float
        Of the loop and of the arm [s].
    """

    plant: HelixPlant
    timestep: float
    time_constant: float

    def __post_init__(self) -> None:
        positive("timestep", self.timestep)
        positive("time_constant", self.time_constant)
        self._state: Array | None = None

    def reset(self) -> None:
        """Forget where the arm is; the next call finds it at rest."""
        self.plant.reset()
        self._state = None

    def carry(self, mass: float) -> None:
        """Hang a mass [kg] into the gripper."""
        self.plant.carry(mass)

    def settle(self, tendon_lengths: ArrayLike, hand: HoldingHand | None = None) -> Array:
        """Return the true state q (9,) one timestep later."""
        rest = self.plant.settle(tendon_lengths, hand)
        left = np.exp(-self.timestep / self.time_constant)
        self._state = rest if self._state is None else rest + left * (self._state - rest)
        return self._state.copy()


@dataclass(frozen=True)
class Gripper:
    """Three fingers that close on what lies between them.

    The thesis gives no opening; success is therefore also reported as a function of it.

    Attributes
    ----------
    opening : float
        Farthest that the centre of a ball may lie from the gripper's axis [m].
    reach : float
        Farthest that it may lie along the axis from the gripper point, to either side [m].
    """

    opening: float = 0.040
    reach: float = 0.040

    def __post_init__(self) -> None:
        positive("opening", self.opening)
        positive("reach", self.reach)

    def holds(self, points: ArrayLike, ball: ArrayLike) -> bool:
        """Return whether closing at the true wrist and gripper (6,) catches a ball centred at `ball` (3,)
        [m]."""
        wrist, tip = np.asarray(points, dtype=float).reshape(2, 3)
        axis = (tip - wrist) / np.linalg.norm(tip - wrist)
        offset = np.asarray(ball, dtype=float) - tip
        along = float(offset @ axis)
        return bool(abs(along) <= self.reach and np.linalg.norm(offset - along * axis) <= self.opening)

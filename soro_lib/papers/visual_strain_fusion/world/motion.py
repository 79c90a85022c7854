"""The predefined spiral of the sensing experiments (Wang et al., Secs. IV-B and IV-C)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from soro_lib import paths
from soro_lib.arcs import chain_transform
from soro_lib.papers.visual_strain_fusion.world.fibre import FibreGratings, bond_spread
from soro_lib.papers.visual_strain_fusion.world.plant import Array, BackboneParameters
from soro_lib.robots.pneumatic import PneumaticArm

PERIOD = 0.05
"""Step of control and learning [s]."""

ARM = PneumaticArm()


@dataclass(frozen=True)
class ArmMotion:
    """A motion of the arm, sampled.

    Attributes
    ----------
    time : ndarray (n,)
        Time [s].
    elongations : ndarray (n, 3)
        Elongations of the chambers [m].
    configuration : ndarray (n, m, 3)
        Arcs of the true backbone.
    pose : ndarray (n, 7)
        True tip pose relative to the tip at rest: position [m] and scalar-last quaternion.
    """

    time: Array
    elongations: Array
    configuration: Array
    pose: Array


def tip_pose(configuration: ArrayLike) -> Array:
    """Tip poses ``(..., 7)`` of a chain, relative to the tip of the arm at rest (Wang et al., Sec. II-A)."""
    transform = chain_transform(configuration)
    position = transform[..., :3, 3] - np.array([0.0, 0.0, ARM.rest_length])
    flat = Rotation.from_matrix(transform[..., :3, :3].reshape(-1, 3, 3)).as_quat(canonical=True)
    return np.concatenate([position, flat.reshape(*position.shape[:-1], 4)], axis=-1)


def spiral_bending(steps: int = 4000, turns: float = 4.743, largest: float = 0.96) -> Array:
    """Bending angles of the spiral, ``(steps, 2)`` [rad]: the radius grows with the square root of time.

    Parameters
    ----------
    steps : int
        Samples of 0.05 s, at least 2; the shape of the spiral does not depend on them.
    turns : float
        Turns of the whole spiral.
    largest : float
        Bending angle at its end [rad].
    """
    if steps < 2:
        raise ValueError(f"steps must be at least 2, got {steps}")
    return paths.spiral(np.arange(steps) / (steps - 1), largest, turns)


def move(
    bending: ArrayLike, backbone: BackboneParameters | None = None, contact: ArrayLike | None = None
) -> ArmMotion:
    """Let the arm follow bending angles with chambers that only inflate.

    Parameters
    ----------
    bending : array_like (n, 2)
        Bending angle asked of the chambers [rad].
    backbone : BackboneParameters, optional
        How the backbone bends.
    contact : array_like (n, m, 2), optional
        Extra curvature by contact [1/m].
    """
    bending = np.asarray(bending, dtype=float)
    length: Array = ARM.rest_length + ARM.chamber_distance * np.hypot(bending[:, 0], bending[:, 1])
    arcs = np.concatenate([bending, length[:, None]], axis=-1)[:, None, :]
    elongations = ARM.chamber_lengths(arcs) - ARM.home
    configuration = (backbone or BackboneParameters()).shape(bending, length, contact)
    time = np.asarray(PERIOD * np.arange(len(bending)), dtype=np.float64)
    return ArmMotion(time, elongations, configuration, tip_pose(configuration))


def spiral(steps: int = 4000, hold: tuple[int, int] = (0, 0)) -> ArmMotion:
    """Predefined spiral of Secs. IV-B and IV-C: 200 s, about 40 mm from the start at its end.

    With `hold`, the arm stands still from one step on for so many steps.
    """
    bending = spiral_bending(steps)
    pause = np.repeat(bending[hold[0] : hold[0] + 1], hold[1], axis=0)
    return move(np.concatenate([bending[: hold[0]], pause, bending[hold[0] :]]))


def glue_fibre(
    rng: np.random.Generator, spread: float = 0.45, largest_shift: float = 1.58e-10
) -> FibreGratings:
    """Glue a fibre to the arm, and scale its strain transfer to the shift range of the spiral.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws how well each grating is glued.
    spread : float
        Standard deviation of the logarithm of the bond gains [-]; 0 for equal bonds.
    largest_shift : float
        Largest shift on the whole spiral [m]; the paper's Appendix states 0.158 nm (calibration).
    """
    fibre = FibreGratings(bond_gain=bond_spread(rng, spread=spread))
    motion = spiral(400)
    reached = np.abs(fibre.shift(motion.configuration, motion.elongations)).max()
    return replace(fibre, transfer=fibre.transfer * largest_shift / reached)


def glued_shifts(motion: ArmMotion, rng: np.random.Generator) -> Array:
    """Noisy wavelength shifts ``(n, gratings)`` [m] of a motion by a fibre that is glued for it."""
    return glue_fibre(rng).shift(motion.configuration, motion.elongations, rng)

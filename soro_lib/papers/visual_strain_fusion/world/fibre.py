"""A single-core fibre with Bragg gratings, wound as a helix on the arm (Wang et al., Secs. II-C and IV-A)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import finite, not_negative, positive

Array = NDArray[np.float64]

SHIFT_PER_STRAIN = 0.78 * 1550e-9
"""Wavelength shift of a silica grating at 1550 nm per unit strain: 1.2 pm per microstrain [m]."""


@dataclass(frozen=True)
class FibreGratings:
    """Seventeen gratings on a helix, and the wavelength shifts that a shape of the arm gives them.

    Attributes
    ----------
    gratings : int
        Number of gratings.
    spacing : float
        Distance between gratings along the fibre [m].
    first : float
        Distance of the first grating from the base along the fibre [m].
    pitch : float
        Axial distance between turns [m].
    radius : float
        Radius of the helix [m].
    length : float
        Length of the arm at rest [m].
    transfer : float
        Strain of the glass per strain of the silicone: the soft skin slips past the stiff fibre [-].
    noise : float
        Standard deviation of one reading [m].
    ballooning : float
        Axial strain of the skin over an inflated chamber per elongation of it [1/m].
    bond_gain : ndarray (gratings,)
        How well each grating is glued, relative to the mean [-].

    Notes
    -----
    The winding is so flat (75 deg from the axis) that the fibre feels mostly the hoop strain, which in an
    incompressible skin is minus half the axial one: ``fibre = axial (cos^2 a - sin^2 a / 2)``.
    """

    gratings: int = 17
    spacing: float = 0.020
    first: float = 0.008
    pitch: float = 0.0165
    radius: float = 0.010
    length: float = 0.090
    transfer: float = 2.6e-3
    noise: float = 1.137e-12
    ballooning: float = 4.0
    bond_gain: Array = field(default_factory=lambda: np.ones(17))

    def __post_init__(self) -> None:
        """Check the values; the error names the field and its bound."""
        for name in ("gratings", "spacing", "pitch", "radius", "length", "transfer"):
            positive(name, getattr(self, name))
        for name in ("first", "noise", "ballooning"):
            not_negative(name, getattr(self, name))
        gain = finite("bond_gain", self.bond_gain, (self.gratings,), above=0)
        object.__setattr__(self, "bond_gain", gain)
        if self.height[-1] > self.length:
            raise ValueError(f"the last grating lies at {self.height[-1]:.4f} m, beyond length {self.length}")

    @property
    def turn(self) -> float:
        """Length of fibre per turn [m]."""
        return float(np.hypot(2.0 * np.pi * self.radius, self.pitch))

    @property
    def position(self) -> Array:
        """Place of each grating along the fibre, ``(gratings,)`` [m]."""
        return np.asarray(self.first + self.spacing * np.arange(self.gratings), dtype=np.float64)

    @property
    def height(self) -> Array:
        """Place of each grating along the arm at rest, ``(gratings,)`` [m]."""
        return self.position * self.pitch / self.turn

    @property
    def azimuth(self) -> Array:
        """Place of each grating around the arm, from x toward y, ``(gratings,)`` [rad]."""
        return 2.0 * np.pi * self.position / self.turn

    @property
    def strain_gain(self) -> float:
        """Strain along the fibre per axial strain of an incompressible skin [-]."""
        cosine = self.pitch / self.turn
        return cosine**2 - 0.5 * (1.0 - cosine**2)

    def axial_strain(self, configuration: ArrayLike, elongations: ArrayLike | None = None) -> Array:
        """Axial strain of the skin at the gratings.

        Parameters
        ----------
        configuration : array_like (..., n, 3)
            Arcs ``(dx, dy, length)`` of the backbone from base to tip.
        elongations : array_like (..., 3), optional
            Elongations of the three chambers, which balloon the skin above them [m].

        Returns
        -------
        ndarray (..., gratings)
            Stretch of the backbone, less on the inner side of the bend [-].

        Raises
        ------
        ValueError
            If the configuration is not finite or not ``(..., n, 3)``.
        """
        arcs = np.asarray(configuration, dtype=float)
        if arcs.ndim < 2 or arcs.shape[-1] != 3 or not np.isfinite(arcs).all():
            raise ValueError(f"configuration must be finite and (..., n, 3), got shape {arcs.shape}")
        segment = np.minimum((self.height / self.length * arcs.shape[-2]).astype(int), arcs.shape[-2] - 1)
        curvature = (arcs[..., :2] / arcs[..., 2:])[..., segment, :]
        stretch = arcs[..., 2].sum(axis=-1)[..., None] / self.length
        sideways = curvature[..., 0] * np.cos(self.azimuth) + curvature[..., 1] * np.sin(self.azimuth)
        strain = stretch * (1.0 - self.radius * sideways) - 1.0
        if elongations is not None:
            around = self.azimuth[:, None] - np.deg2rad([90.0, 210.0, 330.0])
            bump = np.exp(3.0 * (np.cos(around) - 1.0))
            strain = strain + self.ballooning * np.asarray(elongations, dtype=float) @ bump.T
        return strain

    def shift(
        self,
        configuration: ArrayLike,
        elongations: ArrayLike | None = None,
        rng: np.random.Generator | None = None,
    ) -> Array:
        """Wavelength shifts ``(..., gratings)`` [m]; noisy if a generator is given. Arguments as above."""
        strain = self.strain_gain * self.axial_strain(configuration, elongations)
        shift = SHIFT_PER_STRAIN * self.transfer * self.bond_gain * strain
        return shift if rng is None else shift + rng.normal(0.0, self.noise, shift.shape)


def bond_spread(rng: np.random.Generator, gratings: int = 17, spread: float = 0.45) -> Array:
    """Relative bond gains of hand-glued gratings: lognormal with mean 1, ``(gratings,)`` [-].

    Parameters
    ----------
    rng : numpy.random.Generator
    gratings : int
        Number of gratings.
    spread : float
        Standard deviation of the logarithm [-]; 0.45 gives the paper's ratio of mean to largest shift.
    """
    return np.exp(rng.normal(-0.5 * spread**2, spread, gratings))

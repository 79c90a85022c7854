"""The motors that pull the tendons of the Helix."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields, finite
from soro_lib.robots.helix import HelixArm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TendonMotors:
    """The nine motors: a range per tendon and the tick of their encoders (public software of the arm).

    Parameters
    ----------
    arm : HelixArm
        Its pulleys and motor orientations.
    shortest, longest : tuple of 9 float
        Range of the tendon change from calibration [m].
    ticks_per_turn : int
    """

    arm: HelixArm = field(default_factory=HelixArm)
    shortest: tuple[float, ...] = (-0.1,) * 3 + (-0.2,) * 6
    longest: tuple[float, ...] = (0.1,) * 9
    ticks_per_turn: int = 4096

    def __post_init__(self) -> None:
        check_fields(self, "shortest", "longest", shape=(9,))
        if not np.less(self.shortest, self.longest).all():
            raise ValueError(f"shortest must be below longest, got {self.shortest} and {self.longest}")
        check_fields(self, "ticks_per_turn", at_least=1)

    def clip(self, tendon_change: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
        """Return the change (9,) [m] within the motors' range, and which tendons were cut short.

        Raises
        ------
        ValueError
            If a change is not finite.
        """
        change = finite("tendon_change", tendon_change, (9,))
        clipped = np.clip(change, self.shortest, self.longest)
        return clipped, clipped != change

    def pull(self, tendon_change: ArrayLike) -> Array:
        """Return the tendon lengths (9,) [m] that the motors realise: within range, to the nearest encoder
        tick."""
        change, _ = self.clip(tendon_change)
        calibrated = self.arm.tendon_lengths(self.arm.home)
        tick = 2 * np.pi / self.ticks_per_turn
        angles = np.round(self.arm.motor_angles(calibrated + change) / tick) * tick
        return self.arm.tendons_from_motors(angles)

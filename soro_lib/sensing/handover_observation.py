"""What the cameras tell the handover controller, in frame `arm_base`, z down."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soro_lib.checks import numbers
from soro_lib.moved import old_names


@dataclass(frozen=True)
class HandoverObservation:
    """One look of the cameras at arm and ball.

    Attributes
    ----------
    wrist : ndarray, shape (3,), or None
        Middle of the marker ring [m]; None when no marker was found.
    direction : ndarray, shape (3,), or None
        Unit vector from wrist to gripper.
    ball : ndarray, shape (3,), or None
        Centre of the ball [m]; None when it was not found.
    wrist_deviation, direction_deviation, ball_deviation : float
        Standard deviation per component that the detection itself claims [m, -, m].
    disagreement : float
        Distance between the two cameras' rays to the ball [m].
    status : str
        "", or what went wrong.

    Raises
    ------
    ValueError
        If wrist, direction or ball does not have three components.
    """

    wrist: NDArray[np.float64] | None
    direction: NDArray[np.float64] | None
    ball: NDArray[np.float64] | None
    wrist_deviation: float = 0.007
    direction_deviation: float = 0.05
    ball_deviation: float = 0.002
    disagreement: float = 0.0
    status: str = ""

    def __post_init__(self) -> None:
        for name in ("wrist", "direction", "ball"):
            if getattr(self, name) is not None:
                numbers(name, getattr(self, name), (3,))


__getattr__ = old_names(__name__)

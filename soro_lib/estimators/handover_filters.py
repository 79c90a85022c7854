"""The three Kalman filters of the handover: ball, wrist, and direction from wrist to gripper.

Vervloet, Eqs. (14)-(15) with the values of Appendix A. The prediction repeats the last state; optionally it
adds a share of the movement that the controller has just commanded and grows its uncertainty with it.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from soro_lib.checks import check_fields
from soro_lib.poses import magnitude
from soro_lib.sensing.handover_observation import HandoverObservation


@dataclass(frozen=True)
class FilterNoise:
    """Variances of one filter; m^2 for ball and wrist, 1 for the direction (Erratum SH-19).

    Attributes
    ----------
    process : float
        ``Q``, added at every prediction.
    measurement : float or None
        ``R``; None takes the variance that the observation claims (suggested by Vervloet, Section 5.4.2).
    initial : float
        ``P_init``.
    expected_move : float
        Share of the commanded movement that the prediction adds.
    move_deviation : float
        Standard deviation of the movement as a share of it.
    """

    process: float
    measurement: float | None
    initial: float = 2000.0
    expected_move: float = 0.0
    move_deviation: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "process", "initial", above=0)
        if self.measurement is not None:
            check_fields(self, "measurement", above=0)
        check_fields(self, "expected_move", "move_deviation", at_least=0)


@dataclass(frozen=True)
class FilterParameters:
    """The noise of the three filters; the defaults are those of Vervloet, Appendix A."""

    ball: FilterNoise = field(default_factory=lambda: FilterNoise(0.1, 0.01))
    wrist: FilterNoise = field(default_factory=lambda: FilterNoise(0.01, 0.1))
    direction: FilterNoise = field(default_factory=lambda: FilterNoise(0.1, 0.01))


APPENDIX_A = FilterParameters()
"""The thesis's filters. Only Q/R matters; the wrist is smoothed over about three steps, the others hardly."""

MEASURED_NOISE = FilterParameters(
    ball=FilterNoise(0.001**2, None),
    wrist=FilterNoise(0.001**2, None, expected_move=0.4, move_deviation=0.2),
    direction=FilterNoise(0.02**2, None, expected_move=0.4, move_deviation=0.3),
)
"""Filters that take the measurement's own variance and expect the arm to move when it is told to."""


class PointFilter:
    """A Kalman filter of a point that is expected to stay (Vervloet, Eqs. (14)-(15)).

    Parameters
    ----------
    noise : FilterNoise
    start : array_like, shape (3,)
        First state; `FilterNoise.initial` says how little it is trusted.

    Attributes
    ----------
    state : ndarray, shape (3,)
        The filtered point.
    variance : float
        The variance ``P`` of each component.

    Notes
    -----
    ``F = H = I``, and ``P``, ``Q`` and ``R`` are multiples of the identity: the gain is one number for all
    three components. Equal to filterpy's filter with those matrices (tested).
    """

    def __init__(self, noise: FilterNoise, start: NDArray[np.float64]) -> None:
        self.noise = noise
        self.state = np.array(start, dtype=float)
        self.variance = noise.initial

    def predict(self, move: NDArray[np.float64]) -> None:
        """Expect the point to make a share of the commanded movement (3,): Eq. (14)."""
        noise = self.noise
        self.state = self.state + noise.expected_move * move
        self.variance += noise.process + noise.move_deviation**2 * magnitude(move) ** 2

    def update(self, measured: NDArray[np.float64], claimed_deviation: float) -> None:
        """Weigh in a measured point (3,): Eq. (15)."""
        variance = self.noise.measurement
        if variance is None:
            variance = max(claimed_deviation, 1e-6) ** 2
        gain = self.variance * (1.0 / (self.variance + variance))
        self.state = self.state + gain * (measured - self.state)
        # Joseph's form keeps P positive whatever the rounding of the gain.
        self.variance = (1.0 - gain) * self.variance * (1.0 - gain) + gain * variance * gain


class HandoverFilters:
    """Ball, wrist and direction, each with its own filter.

    Parameters
    ----------
    parameters : FilterParameters
    start_points : array_like, shape (6,)
        Wrist and gripper of the calibrated arm [m], the state before the first look.
    """

    def __init__(self, parameters: FilterParameters, start_points: NDArray[np.float64]) -> None:
        wrist, gripper = np.asarray(start_points, dtype=float).reshape(2, 3)
        self.gripper_length = magnitude(gripper - wrist)
        self.ball = PointFilter(parameters.ball, gripper)
        self.wrist = PointFilter(parameters.wrist, wrist)
        self.direction = PointFilter(parameters.direction, (gripper - wrist) / self.gripper_length)
        self.ball_seen = False

    def predict(self, points_move: NDArray[np.float64]) -> None:
        """Predict all three, given the commanded movement of wrist and gripper (6,) [m]."""
        self.ball.predict(np.zeros(3))
        self.wrist.predict(points_move[:3])
        self.direction.predict((points_move[3:] - points_move[:3]) / self.gripper_length)

    def update(self, observation: HandoverObservation) -> None:
        """Weigh in what was seen; what was not seen keeps its prediction."""
        if observation.wrist is not None and observation.direction is not None:
            self.wrist.update(observation.wrist, observation.wrist_deviation)
            self.direction.update(observation.direction, observation.direction_deviation)
        if observation.ball is not None:
            self.ball.update(observation.ball, observation.ball_deviation)
            self.ball_seen = True

    @property
    def points(self) -> NDArray[np.float64]:
        """``X_meas``: filtered wrist and gripper (6,) [m], a gripper length apart (Vervloet, Eqs. (12)-(13)).

        The filtered direction is normalised, without which X_meas would leave the reachable set (Erratum
        SH-8).
        """
        return points_from_direction(self.wrist.state, self.direction.state, self.gripper_length)

    @property
    def points_deviation(self) -> float:
        """Standard deviation of ``X_meas`` over all six components together [m]."""
        leverage = self.gripper_length**2 * self.direction.variance
        return float(np.sqrt(6 * self.wrist.variance + 3 * leverage))


def points_from_direction(
    wrist: NDArray[np.float64], direction: NDArray[np.float64], gripper_length: float
) -> NDArray[np.float64]:
    """Return wrist and gripper (6,) [m] from the wrist (3,) and a direction (3,) of any length (Eqs.
    (12)-(13))."""
    return np.concatenate([wrist, wrist + gripper_length * direction / magnitude(direction)])

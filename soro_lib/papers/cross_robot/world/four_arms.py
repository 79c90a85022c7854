"""The four arms side by side: what each looks like and a motion that shows how it bends."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.robots import CableDrivenArm, HelixArm, PneumaticArm, SoftGrowingArm
from soro_lib.robots.base import Robot

POINTS_PER_PIECE = 24
"""Points that a piece of an arm is drawn with [count]."""


@dataclass(frozen=True)
class Specimen:
    """One arm, ready to be shown.

    Attributes
    ----------
    name, source
        What it is called and the paper that it is from.
    robot
        The arm with the paper's parameters.
    radius
        Radius of its body [m].
    hangs
        Whether its z axis points down.
    rigid
        Which of its pieces do not bend: slides and pivots.
    start, end
        Two actuations; the way from one to the other shows how it moves.
    """

    name: str
    source: str
    robot: Robot
    radius: float
    hangs: bool
    rigid: tuple[int, ...]
    start: tuple[float, ...]
    end: tuple[float, ...]

    def pieces(self, actuation: ArrayLike) -> NDArray[np.float64]:
        """Return the centre lines of its pieces [m], base frame, shape (pieces, POINTS_PER_PIECE + 1, 3)."""
        points = self.robot.backbone(actuation, POINTS_PER_PIECE)
        first = np.arange(0, len(points) - 1, POINTS_PER_PIECE)
        lines: NDArray[np.float64] = points[first[:, np.newaxis] + np.arange(POINTS_PER_PIECE + 1)]
        return lines

    def sweep(self, count: int) -> NDArray[np.float64]:
        """Return actuations from `start` to `end`, evenly spaced, shape (count, n)."""
        return np.linspace(self.start, self.end, count)

    def reach(self) -> NDArray[np.float64]:
        """Return the corners of a box around the arm in 500 random actuations [m], shape (2, 3)."""
        limits = (self.robot.lower, self.robot.upper)
        actuations = np.random.default_rng(0).uniform(*limits, size=(500, len(limits[0])))
        points = self.robot.backbone(self.robot.clip(actuations).actuation, 8).reshape(-1, 3)
        return np.stack([points.min(axis=0), points.max(axis=0)])


def four_arms() -> tuple[Specimen, ...]:
    """Return the four arms of the workbook, in the order of its notebooks.

    The pneumatic arm keeps to chamber lengths that bend it by half a turn at most: its paper prints no
    limits.
    """
    return (
        Specimen(
            name="cable-driven",
            source="Lai et al.",
            robot=CableDrivenArm(),
            radius=4.5e-3,
            hangs=False,
            rigid=(0,),
            start=(0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            end=(0.05, -1.8, 0.0, 0.0, 0.0, -1.5, -1.5),
        ),
        Specimen(
            name="soft-growing",
            source="Stroppa et al.",
            robot=SoftGrowingArm(),
            radius=0.03,
            hangs=True,
            rigid=(0,),
            start=(-0.4, -0.1, 0.5),
            end=(0.5, 0.1, 0.8),
        ),
        Specimen(
            name="pneumatic",
            source="Wang et al.",
            robot=PneumaticArm(minimum_length=0.08, maximum_length=0.105),
            radius=9e-3,
            hangs=False,
            rigid=(),
            start=(0.09, 0.09, 0.09),
            end=(0.093, 0.081, 0.105),
        ),
        Specimen(
            name="helix",
            source="Vervloet",
            robot=HelixArm(),
            radius=0.035,
            hangs=True,
            rigid=(),
            start=(0.0, 0.0, 0.12, 0.0, 0.0, 0.24, 0.0, 0.0, 0.24),
            end=(-0.5, 0.1, 0.11, 1.3, -0.3, 0.23, 0.9, 0.8, 0.24),
        ),
    )

"""Experiment 2: a human leads the arm to the ball (Vervloet, Sections 3.5.2 and 4.3)."""

from dataclasses import dataclass

import numpy as np

from soro_lib.controllers.handover import goal_over
from soro_lib.papers.soft_handover.world.plant import Array, HoldingHand


@dataclass
class GuidingHand:
    """A hand that takes the gripper, leads it over the ball and then down, and holds it there.

    Attributes
    ----------
    first_step : int
        Step at which it takes hold; the thesis's human waits for the start of the system.
    speed : float
        Farthest that it leads the gripper in one step [m].
    offset : float
        Height over the ball that it aims for first [m].
    near : float
        Distance to that place at which it begins to go down [m].
    stiffness : float
        Of its grip [N/m].
    gripper_length : float
        Distance from wrist to gripper, which it keeps upright [m].
    """

    first_step: int = 2
    speed: float = 0.06
    offset: float = 0.05
    near: float = 0.03
    stiffness: float = 200.0
    gripper_length: float = 0.10

    def __call__(self, step: int, gripper: Array, ball: Array) -> HoldingHand | None:
        """Return the pull of the hand, given step, true gripper (3,) and ball (3,) [m]."""
        if step < self.first_step:
            self._over = True
            return None
        place = goal_over(ball, self.offset if self._over else 0.0, self.gripper_length)[3:]
        way = place - gripper
        distance = float(np.linalg.norm(way))
        if self._over and distance < self.near:
            self._over = False
        lead = gripper + way * min(1.0, self.speed / max(distance, 1e-9))
        return HoldingHand(goal_over(lead, 0.0, self.gripper_length), self.stiffness)

"""Experiment 2: the hand that leads the arm."""

import numpy as np
import pytest

from soro_lib.papers.soft_handover.experiments import (
    guidance,
)


def test_guiding_hand_waits_then_leads_over_the_ball_and_down():
    hand = guidance.GuidingHand(first_step=2, speed=0.05)
    ball = np.array([0.15, 0.0, 0.64])
    gripper = np.array([0.0, 0.0, 0.7])
    assert hand(0, gripper, ball) is None
    pull = hand(2, gripper, ball)
    assert np.linalg.norm(pull.points[3:] - gripper) == pytest.approx(0.05)
    over = hand(3, ball - [0, 0, 0.05], ball)
    assert over.points[5] == pytest.approx(ball[2] - 0.05)
    assert hand(4, ball - [0, 0, 0.05], ball).points[5] > ball[2] - 0.05 - 1e-9

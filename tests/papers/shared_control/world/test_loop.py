"""One period of the operator."""

from dataclasses import replace

import numpy as np

from soro_lib.papers.shared_control.world.loop import View, operator_start, operator_step, picture_buffer
from soro_lib.papers.shared_control.world.people import EXPERT

ZERO = (0.0, 0.0, 0.0)


STILL = replace(EXPERT, wander=0.0, tremor=0.0, motor_noise=0.0)


def test_an_operator_without_errors_steers_to_the_goal():
    perfect = replace(STILL, lateral_error=0.0, depth_error=0.0, look_noise=0.0, approach_height=0.0)
    start, goal = (0.0, 0.0, 0.1), (0.2, -0.1, 0.6)
    state, pictures = operator_start(start), picture_buffer(perfect, start)
    rng, tip = np.random.default_rng(1), np.array(start)
    for _ in range(1000):
        command = np.array(state.hand.position) * [10.0, 10.0, 15.0]
        tip = tip + 0.01 * (command - tip)
        view = View(tuple(tip.tolist()), tuple(command.tolist()), goal, ZERO, False, ZERO)
        state = operator_step(perfect, state, pictures, view, rng)
    assert np.linalg.norm(tip - goal) < perfect.tolerance

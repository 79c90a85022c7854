"""When the button is pressed."""

import pytest

from soro_lib.papers.shared_control.world.decision import DECIDED_NOTHING, decide
from soro_lib.papers.shared_control.world.people import EXPERT


def test_the_button_is_pressed_after_dwell_and_latency():
    decision, samples = DECIDED_NOTHING, 0
    while not decision.closed:
        decision = decide(EXPERT, decision, True, False, False)
        samples += 1
    assert samples == pytest.approx(100 * (0.4 + 0.25), abs=2)


def test_a_grasp_that_caught_nothing_is_given_up():
    decision = DECIDED_NOTHING
    closed = [(decision := decide(EXPERT, decision, True, False, False)).closed for _ in range(400)]
    first = closed.index(True)
    assert closed[first : first + 98] == [True] * 98
    assert not closed[first + 102]


def test_a_heeded_force_keeps_the_finger_off_the_button():
    decision = DECIDED_NOTHING
    for _ in range(300):
        decision = decide(EXPERT, decision, True, True, False)
    assert not decision.closed

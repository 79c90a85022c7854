"""Gestures: what they mean, and that a flicker means nothing."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.controllers.gestures import GESTURES, Gesture, GestureRule, gesture_count

PALM, FIST = (True,) * 5, (False,) * 5
V_SIGN, THUMB = (False, True, True, False, False), (True, False, False, False, False)


def run(rule, fingers, start, duration, step=0.009):
    """Show the rule the same fingers for some time; return its mode and the time after."""
    time = start
    while time < start + duration:
        mode = rule.update(time, fingers)
        time += step
    return mode, time


def test_only_four_vectors_mean_something():
    """Erratum GS-14: as printed any extended finger would be one of palm, V-sign or thumbs-up."""
    vectors = list(itertools.product((False, True), repeat=5))
    for vector in vectors:
        rule = GestureRule()
        mode, _ = run(rule, vector, 0.0, 1.0)
        assert mode is GESTURES.get(vector, Gesture.PALM)
    some_finger = [vector for vector in vectors if any(vector)]
    assert len(some_finger) == 31
    assert sum(vector in GESTURES for vector in some_finger) == 3


def test_five_fingers_form_32_gestures():
    """Erratum GS-15: the paper says 120, which is 5!."""
    assert gesture_count() == len(list(itertools.product((0, 1), repeat=5))) == 32 != 120


@pytest.mark.parametrize(("duration", "mode"), [(0.12, Gesture.PALM), (0.15, Gesture.V_SIGN)])
def test_a_mode_needs_its_hold(duration, mode):
    assert run(GestureRule(), V_SIGN, 0.0, duration)[0] is mode


def test_transit_through_a_wrong_vector_changes_nothing():
    rule = GestureRule()
    _, time = run(rule, PALM, 0.0, 0.5)
    for vector in ((False, True, True, True, True), (False, True, True, False, True), THUMB):
        mode, time = run(rule, vector, time, 0.08)
        assert mode is Gesture.PALM
    assert run(rule, FIST, time, 0.2)[0] is Gesture.FIST


def test_fist_and_thumbs_up_need_longer():
    rule = GestureRule()
    _, time = run(rule, FIST, 0.0, 0.3)
    mode, time = run(rule, THUMB, time, 0.2)
    assert mode is Gesture.FIST
    assert run(rule, THUMB, time, 0.1)[0] is Gesture.THUMBS_UP


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from(list(GESTURES)), min_size=1, max_size=200))
def test_flicker_of_single_frames_never_changes_the_mode(vectors):
    rule = GestureRule()
    for index, vector in enumerate(vectors):
        assert rule.update(0.018 * index, PALM) is Gesture.PALM
        assert rule.update(0.018 * index + 0.009, vector) is Gesture.PALM


def test_a_pause_starts_the_hold_anew():
    rule = GestureRule()
    run(rule, V_SIGN, 0.0, 0.1)
    assert rule.update(5.0, V_SIGN) is Gesture.PALM
    assert run(rule, V_SIGN, 5.009, 0.15)[0] is Gesture.V_SIGN


@pytest.mark.parametrize("step", [0.0087, 0.03, 0.09])
def test_hold_works_at_every_rate(step):
    rule = GestureRule()
    assert run(rule, FIST, 0.0, 0.1, step)[0] is Gesture.PALM
    assert run(rule, FIST, 0.1, 0.3, step)[0] is Gesture.FIST


@pytest.mark.parametrize("name", ["hold", "opposite_hold"])
def test_bad_holds_are_refused(name):
    with pytest.raises(ValueError, match=rf"GestureRule\.{name}"):
        GestureRule(**{name: -0.1})

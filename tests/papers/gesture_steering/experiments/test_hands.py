"""Hands: what filters and gestures make of the recordings."""

from soro_lib.papers.gesture_steering.experiments import hands
from soro_lib.papers.gesture_steering.recordings import load_recording


def test_timeline_knows_the_gestures():
    timeline = hands.timeline(load_recording("hover"))
    assert timeline["mode"].unique().tolist() == ["palm", "v_sign"]
    assert (timeline.loc[timeline["mode"] == "v_sign", "goal_x_mm"] == 0.0).all()


def test_filters_are_compared_against_a_smoother():
    table = hands.filter_comparison({"a4_palm": load_recording("a4_palm")}).set_index("filter")
    assert table.loc["R = 0.7 for all", "error_mm"] > 5 * table.loc["fixed noise", "error_mm"]
    assert abs(table.loc["fixed noise", "lag_ms"]) <= 3.0
    assert table.loc["fixed noise", "roughness"] < 1.0

"""The explorer bends the arm that its sliders describe, and never past the robot's limits."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.papers.cross_robot.explorer import DISPLAY_UNITS, ArmExplorer, explore
from soro_lib.papers.cross_robot.figures.four_arms import four_arms as draw_four_arms
from soro_lib.papers.cross_robot.world.four_arms import four_arms
from soro_lib.replication import frontend

ARMS = range(4)


@pytest.fixture
def explorer():
    return ArmExplorer()


def choose(explorer, index):
    explorer.choice.index = index
    return explorer.specimen.robot


@pytest.mark.parametrize("index", ARMS)
def test_sliders_span_the_robots_limits_in_display_units(explorer, index):
    robot = choose(explorer, index)
    assert len(explorer.sliders) == len(robot.home)
    for slider, name, low, high, home in zip(
        explorer.sliders, robot.actuator_names, robot.lower, robot.upper, robot.home, strict=True
    ):
        unit, factor = DISPLAY_UNITS[name.partition("[")[2].removesuffix("]")]
        assert slider.description.endswith(f"[{unit}]")
        assert [slider.min, slider.max] == pytest.approx([low * factor, high * factor])
        assert slider.value == pytest.approx(home * factor)
        steps = (slider.value - slider.min) / slider.step
        assert steps == pytest.approx(round(steps), abs=1e-6), "home lies on the slider's grid"


@pytest.mark.parametrize("index", ARMS)
def test_drawing_ends_at_the_robots_tip(explorer, index):
    robot = choose(explorer, index)
    explorer.sliders[0].value = 0.7 * explorer.sliders[0].max + 0.3 * explorer.sliders[0].min
    tip = robot.tip(explorer.actuation)
    scene = explorer.view.scene
    assert scene["tubes"][-1]["points"][-1] == pytest.approx(tip, abs=2e-6)
    assert np.array(scene["tip"])[:3, 3] == pytest.approx(tip, abs=2e-6)
    stated = [float(number) for number in scene["caption"].partition("(")[2].partition(")")[0].split(", ")]
    assert stated == pytest.approx(1e3 * tip, abs=0.06)


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(ARMS), st.lists(st.floats(0, 1), min_size=9, max_size=9))
def test_any_slider_position_draws_an_admissible_arm(index, shares):
    explorer = ArmExplorer()
    choose(explorer, index)
    for slider, share in zip(explorer.sliders, shares):
        slider.value = slider.min + share * (slider.max - slider.min)
    for tube in explorer.view.scene["tubes"]:
        assert np.isfinite(tube["points"]).all()
    pieces = [np.array(tube["points"]) for tube in explorer.view.scene["tubes"]]
    for before, after in pairwise(pieces):
        assert after[0] == pytest.approx(before[-1], abs=2e-6), "one piece begins where the last ended"


def test_bend_beyond_the_limit_is_limited_and_said(explorer):
    choose(explorer, 3)
    explorer.sliders[0].value = explorer.sliders[0].max
    assert explorer.message.value == ""
    explorer.sliders[1].value = explorer.sliders[1].max
    assert explorer.message.value == "limited by the arm: dx1, dy1"


@pytest.mark.parametrize("index", ARMS)
def test_home_button_brings_the_arm_back(explorer, index):
    choose(explorer, index)
    before = explorer.view.scene
    for slider in explorer.sliders:
        slider.value = slider.max
    assert explorer.view.scene != before
    explorer.home_button.click()
    assert explorer.view.scene == before


def test_without_a_reader_there_is_a_picture(monkeypatch):
    image = explore()
    assert image.data.startswith(b"\x89PNG")
    monkeypatch.setattr(frontend, "get_ipython", lambda: type("Shell", (), {"kernel": object()})())
    monkeypatch.delenv("SORO_OUTPUT", raising=False)
    assert isinstance(explore(), ArmExplorer)
    monkeypatch.setenv("SORO_OUTPUT", "somewhere")
    assert not isinstance(explore(), ArmExplorer)


@pytest.mark.parametrize("specimen", four_arms(), ids=lambda specimen: specimen.name)
def test_specimens_stay_within_limits_and_reach(specimen):
    sweep = specimen.sweep(7)
    specimen.robot.check(sweep)
    low, high = specimen.reach()
    assert (low < high).all()
    pieces = specimen.pieces(specimen.end)
    assert pieces[0, 0] == pytest.approx(np.zeros(3))
    assert pieces[-1, -1] == pytest.approx(specimen.robot.tip(specimen.end))
    assert set(specimen.rigid) < set(range(len(pieces)))


def test_figure_has_one_panel_per_arm_named_after_it():
    specimens = four_arms()
    figure = draw_four_arms(specimens, poses=2)
    assert [axes.get_title() for axes in figure.axes] == [specimen.name for specimen in specimens]
    assert [axes.zaxis_inverted() for axes in figure.axes] == [specimen.hangs for specimen in specimens]

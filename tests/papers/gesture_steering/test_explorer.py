"""The steering explorer: its controls are a hand, and the arm follows it through the real controller."""

import asyncio

import numpy as np
import pytest
from IPython.display import Image

from soro_lib.controllers.gestures import Gesture
from soro_lib.papers.gesture_steering.explorer import SteeringExplorer, explore


@pytest.fixture
def explorer():
    return SteeringExplorer()


def test_without_a_browser_a_picture_stands_in():
    picture = explore()
    assert isinstance(picture, Image)
    assert picture.data[:4] == b"\x89PNG"


def test_controls_are_a_hand(explorer):
    explorer.pad.x, explorer.pad.y = 0.5, -0.2
    explorer.height.value, explorer.roll.value = 250.0, 20.0
    hand = explorer.hand()
    np.testing.assert_allclose(hand.palm, (0.075, 0.25, 0.03))
    np.testing.assert_allclose(
        hand.normal, (np.sin(np.deg2rad(20)), -np.cos(np.deg2rad(20)), 0.0), atol=1e-12
    )


def test_the_arm_follows_the_pad(explorer):
    explorer.pad.x = 0.8
    result = explorer.advance(2.0)
    np.testing.assert_allclose(result.tip, (0.024, 0.0, 0.110), atol=1e-5)
    assert "24.0" in explorer.view.scene["caption"]


def test_a_button_is_a_gesture(explorer):
    explorer.pad.x = 0.8
    explorer.gesture.value = "v_sign"
    result = explorer.advance(2.0)
    assert result.mode is Gesture.V_SIGN
    np.testing.assert_allclose(result.tip[:2], 0.0, atol=1e-5)


def test_the_arm_settles_in_the_background():
    async def drag():
        explorer = SteeringExplorer()
        explorer.pad.x = 0.4
        await asyncio.wait_for(explorer._task, 20)
        return explorer

    explorer = asyncio.run(drag())
    np.testing.assert_allclose(explorer.steering.pose.tip[0], 0.012, atol=1e-4)

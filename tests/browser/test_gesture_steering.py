"""The steering explorer in JupyterLab: dragging the dot moves the arm, a button changes the gesture."""

import re

import pytest

pytestmark = pytest.mark.browser

ARM = "canvas.soro-view"
PAD = "canvas[aria-label='palm from above']"


def tip(page) -> tuple[float, ...]:
    """Return the tip position [mm] that the drawing states."""
    label = page.locator(ARM).get_attribute("aria-label")
    return tuple(float(number) for number in re.search(r"tip at (.*) mm", label)[1].split(", "))


def test_dragging_the_palm_moves_the_arm(open_notebook, tmp_path):
    page = open_notebook("steering_explorer.ipynb")
    pad = page.locator(PAD)
    pad.scroll_into_view_if_needed()
    box = pad.bounding_box()
    middle, right = box["x"] + box["width"] / 2, box["x"] + 0.9 * box["width"]
    height = box["y"] + box["height"] / 2
    page.mouse.move(middle, height)
    page.mouse.down()
    page.mouse.move(right, height, steps=8)
    page.mouse.up()
    page.wait_for_timeout(4000)
    x, y, z = tip(page)
    assert x == pytest.approx(24.0, abs=0.5)
    assert y == pytest.approx(0.0, abs=0.5)
    assert z == pytest.approx(110.0, abs=0.5)
    page.screenshot(path=tmp_path / "palm.png")

    page.get_by_role("button", name="V-sign").click()
    page.wait_for_timeout(4000)
    assert page.locator(ARM).get_attribute("aria-label").startswith("V-sign")
    assert tip(page)[0] == pytest.approx(0.0, abs=0.2)
    page.screenshot(path=tmp_path / "v_sign.png")

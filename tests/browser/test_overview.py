"""The overview opens in JupyterLab, and its arms bend when a slider is moved by keyboard."""

import re

import pytest

pytestmark = pytest.mark.browser

CANVAS = "canvas.soro-view"


def tip(page) -> tuple[float, ...]:
    """Return the tip position [mm] that the drawing states."""
    label = page.locator(CANVAS).get_attribute("aria-label")
    return tuple(float(number) for number in re.search(r"\((.*)\) mm", label)[1].split(", "))


def picture(page) -> str:
    """Return the pixels of the drawing."""
    return page.locator(CANVAS).evaluate("canvas => canvas.toDataURL()")


def test_slider_moved_by_keyboard_bends_the_arm(open_notebook, tmp_path):
    page = open_notebook("00_overview.ipynb")
    assert page.locator(".jp-RenderedText[data-mime-type*=stderr]").count() == 0
    canvas = page.locator(CANVAS)
    canvas.scroll_into_view_if_needed()
    page.get_by_role("button", name="helix").click()
    page.wait_for_function(
        f"document.querySelector('{CANVAS}').getAttribute('aria-label').startsWith('helix')"
    )
    before, pixels = tip(page), picture(page)
    assert before == (0.0, 0.0, 600.0)

    handle = page.get_by_role("slider").nth(3)
    handle.focus()
    for _ in range(40):
        handle.press("ArrowRight")
    page.wait_for_function(
        f"!document.querySelector('{CANVAS}').getAttribute('aria-label').includes('(0.0, 0.0, 600.0)')"
    )
    page.wait_for_timeout(500)
    x, y, z = tip(page)
    assert x > 100.0
    assert y == pytest.approx(0.0)
    assert z < 590.0
    assert picture(page) != pixels
    page.screenshot(path=tmp_path / "overview.png")  # for a look, where pytest keeps its folder


def test_dragging_turns_the_view_but_not_the_arm(open_notebook):
    page = open_notebook("00_overview.ipynb")
    canvas = page.locator(CANVAS)
    canvas.scroll_into_view_if_needed()
    before, pixels = tip(page), picture(page)
    box = canvas.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 120, y + 20, steps=6)
    page.mouse.up()
    page.wait_for_timeout(300)
    assert tip(page) == before
    assert picture(page) != pixels

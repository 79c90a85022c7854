"""The handover explorer in JupyterLab: the ball is dragged in a picture, and the arm runs to it."""

import pytest

pytestmark = pytest.mark.browser

PICTURE = "img[alt^='{side} camera']"


def status(page) -> str:
    """Return what the left picture says about the run."""
    return page.locator(PICTURE.format(side="left")).get_attribute("alt")


def test_the_ball_is_dragged_and_taken(open_notebook, tmp_path):
    page = open_notebook("handover_explorer.ipynb")
    picture = page.locator(PICTURE.format(side="left"))
    picture.scroll_into_view_if_needed()
    page.wait_for_timeout(1000)
    before = picture.get_attribute("src")
    box = picture.bounding_box()
    scale = box["width"] / 1280
    x, y = box["x"] + BALL[0] * scale, box["y"] + BALL[1] * scale
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60 * scale, y - 10 * scale, steps=6)
    page.mouse.up()
    page.wait_for_timeout(2000)
    assert picture.get_attribute("src") != before, "the picture shows the ball at its new place"
    page.screenshot(path=tmp_path / "dragged.png")

    page.locator("button.widget-toggle-button", has_text="run").click()
    for _ in range(60):
        page.wait_for_timeout(1000)
        if "closed" in status(page):
            break
    page.screenshot(path=tmp_path / "closed.png")
    assert "the ball is held" in status(page)


BALL = (621.0, 380.0)
"""Where the left camera sees the ball at first [px]; a drag may begin up to 90 px beside it."""

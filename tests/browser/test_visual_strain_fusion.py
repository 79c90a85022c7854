"""The fusion explorer in JupyterLab: the lens is covered, the tracker is lost, and the fibre takes over."""

import re

import pytest

pytestmark = pytest.mark.browser


def test_covering_the_lens_loses_the_camera_and_not_the_fusion(open_notebook, tmp_path):
    page = open_notebook("fusion_explorer.ipynb")
    message = page.locator(".widget-html", has_text="weight of the fibre").first
    message.wait_for(timeout=60_000)
    assert "features fit" in message.inner_text()
    picture = page.locator("img.widget-image").first
    before = picture.get_attribute("src")

    page.locator("button.widget-toggle-button", has_text="cover the lens").click()
    page.locator(".widget-html", has_text="lost").first.wait_for(timeout=60_000)
    page.screenshot(path=tmp_path / "covered.png", full_page=True)

    assert picture.get_attribute("src") != before
    camera, fused = (
        float(re.search(rf"{name} ([0-9.]+) mm", message.inner_text()).group(1))
        for name in ("camera", "fusion")
    )
    assert fused < camera
    assert "weight of the fibre 1.00" in message.inner_text()

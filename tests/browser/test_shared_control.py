"""One whole trial, driven by pointer, wheel and keys in a real browser, lands in the statistics."""

import json
import math
import os
import re
import signal
from pathlib import Path

import pytest

from soro_lib.papers.shared_control.experiments.task import Scene
from soro_lib.papers.shared_control.experiments.trials import load_trial, load_trials, standing, trial_table

pytestmark = pytest.mark.browser

SCENE = Scene()
ROOT = ".soro-operator"
CANVAS = f"{ROOT} canvas"


class Driver:
    """Hands at pointer, wheel and keyboard; eyes on what the page states."""

    def __init__(self, page):
        self.page = page
        self.canvas = page.locator(CANVAS)
        self.canvas.scroll_into_view_if_needed()

    def label(self):
        return self.canvas.get_attribute("aria-label")

    def tip(self):
        """Tip position [m]."""
        numbers = re.search(r"tip at \((.*)\) mm", self.label())[1].split(", ")
        return [1e-3 * float(number) for number in numbers]

    def status(self):
        return self.page.locator(ROOT).get_attribute("data-status")

    def clock(self):
        return float(self.page.locator(f"{ROOT} .clock").text_content().removesuffix(" s"))

    def file(self):
        return Path(self.page.locator(ROOT).get_attribute("data-file"))

    def point(self, place):
        """Move the pointer to where the hand commands a place."""
        (x0, y0), (x1, y1), (x2, y2) = json.loads(self.canvas.get_attribute("data-pad"))
        box = self.canvas.bounding_box()
        x = x0 + place[0] * (x1 - x0) + place[1] * (x2 - x0)
        y = y0 + place[0] * (y1 - y0) + place[1] * (y2 - y0)
        self.page.mouse.move(box["x"] + x, box["y"] + y, steps=8)

    def until(self, condition, what, timeout=20.0):
        for _ in range(round(timeout / 0.05)):
            if condition():
                return
            self.page.wait_for_timeout(50)
        pytest.fail(f"{what} did not happen: {self.label()}, {self.status()}")

    def near(self, place, distance, axes=(0, 1, 2)):
        gap = math.dist([self.tip()[axis] for axis in axes], [place[axis] for axis in axes])
        return gap < distance

    def start(self, paradigm, arm="simulated", view="above and front"):
        choices = self.page.locator(".widget-dropdown select")
        choices.nth(0).select_option(label=paradigm)
        choices.nth(1).select_option(label=arm)
        choices.nth(3).select_option(label=view)
        self.page.locator(f"{ROOT} button").click()
        self.until(lambda: self.status() == "armed", "arming")
        self.point(SCENE.start)
        self.until(lambda: self.status() == "running", "start of the clock")


def test_whole_trial_by_pointer_wheel_and_keys(open_notebook, tmp_path):
    page = open_notebook("be_the_operator.ipynb")
    cells = page.locator(".jp-Cell").count()
    driver = Driver(page)
    driver.start("Assist-as-Needed")

    for number, (item, target) in enumerate(zip(SCENE.items, SCENE.targets, strict=True)):
        driver.point(item)
        for _ in range(26 if number == 0 else 0):  # 20 mm a notch
            page.mouse.wheel(0, 100)
            page.wait_for_timeout(20)
        driver.until(lambda place=item: driver.near(place, 0.03), f"tip at item {number + 1}")
        page.keyboard.press("Space")
        driver.until(lambda index=number: f"item {index + 1} held" in driver.label(), "grasp")
        page.keyboard.down("w")
        page.wait_for_timeout(300)
        page.keyboard.up("w")
        driver.point(target)
        driver.until(lambda place=target: driver.near(place, 0.1, (0, 1)), "flight to the target")
        if number == 0:
            page.screenshot(path=tmp_path / "driving.png")  # for a look, where pytest keeps its folder
        page.keyboard.down("s")
        page.wait_for_timeout(300)
        page.keyboard.up("s")
        driver.until(lambda place=target: driver.near(place, 0.012, (0, 1)), f"tip at target {number + 1}")
        page.keyboard.press("Space")
        driver.until(lambda: "nothing held" in driver.label(), "release")

    driver.until(lambda: driver.status() == "done", "end of the trial")
    page.screenshot(path=tmp_path / "done.png")
    assert page.locator(".jp-Cell").count() == cells, "the keys are the operator's, not the notebook's"

    trial = load_trial(driver.file())
    assert trial.complete
    assert trial.finished
    assert trial.header.paradigm == "assist_as_needed"
    for number, target in enumerate(SCENE.targets):
        assert math.dist(trial.points(f"item{number + 1}")[-1][:2], target[:2]) < 0.05, "on the disc"
    assert trial.replay() == pytest.approx(trial.points("tip"), abs=1e-6)

    metrics = trial.metrics()
    shown = {
        cell.get_attribute("data-metric"): cell.text_content()
        for cell in page.locator(f"{ROOT} [data-metric]").all()
    }
    assert set(shown) == {"time_s", "path_m", "assistance_n", "item1_error_mm", "item2_error_mm"}
    for name, text in shown.items():
        number = text.partition(" ")[0]
        digits = len(number.partition(".")[2])
        assert f"{metrics[name]:.{digits}f}" == number, name
    assert driver.clock() == pytest.approx(metrics["time_s"], abs=0.006)

    plots = page.locator(".jp-CodeCell").nth(1)
    plots.locator(".cm-content").click()
    page.keyboard.press("Shift+Enter")
    plots.get_by_text(driver.file().name).wait_for()
    plots.locator("img").scroll_into_view_if_needed()
    page.screenshot(path=tmp_path / "among_the_crowd.png")

    table = trial_table(load_trials(driver.file().parent))
    assert list(table["finished"]) == [1.0]
    crowd = table.assign(kind="naive", time_s=1000.0)
    assert (standing(table, crowd, ["time_s"])["below"] == 0.0).all()


def test_pause_stop_closed_tab_and_killed_kernel_leave_readable_trials(open_notebook, tmp_path):
    page = open_notebook("be_the_operator.ipynb")
    driver = Driver(page)
    driver.start("Mostly Autonomous", "real")
    driver.until(lambda: driver.clock() > 0.5, "half a second")
    page.locator(".jp-Cell .cm-content").first.click()  # the reader looks elsewhere
    driver.until(lambda: page.locator(ROOT).get_by_text("Paused").is_visible(), "pause")
    page.wait_for_timeout(300)
    held = driver.clock()
    page.wait_for_timeout(700)
    assert driver.clock() == held
    driver.canvas.click(position={"x": 5, "y": 5})
    driver.until(lambda: driver.clock() > held + 0.3, "going on")

    kernel = int(page.locator(".jp-OutputArea-executeResult pre").last.text_content())
    os.kill(kernel, signal.SIGSTOP)
    driver.until(lambda: page.locator(ROOT).get_by_text("Waiting for the kernel").is_visible(), "waiting")
    os.kill(kernel, signal.SIGCONT)
    held = driver.clock()
    driver.until(lambda: driver.clock() > held + 0.5, "going on after the kernel was held")
    page.keyboard.press("Escape")
    driver.until(lambda: driver.status() == "stopped", "stop")
    stopped = load_trial(driver.file())
    assert not stopped.complete
    times = stopped.samples["time_s"]
    assert times.iloc[-1] == pytest.approx(driver.clock(), abs=0.006)
    assert times.diff().iloc[1:].to_numpy() == pytest.approx(0.01), "neither pause nor wait is in the record"

    driver.start("Fixed Assistance", view="camera")
    driver.point((0.2, 0.0))
    driver.until(lambda: driver.tip()[0] > 0.05, "motion")
    driver.until(lambda: driver.clock() > 1.5, "full force")
    page.screenshot(path=tmp_path / "pulled.png")
    file = driver.file()
    page.close()
    os.kill(kernel, signal.SIGKILL)
    trial = load_trial(file)
    assert not trial.complete
    assert not trial.finished
    pulled = trial.points("command")[-1] - trial.points("aim")[-1]
    toward = trial.points("force")[-1]
    assert math.hypot(*toward) > 3.0
    assert pulled @ toward > 0.1, "the hand gives to the force"
    assert trial.replay() == pytest.approx(trial.points("tip"), abs=1e-6)

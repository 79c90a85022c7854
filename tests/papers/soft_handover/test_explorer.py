"""The handover explorer: what is dragged moves, what is covered is unseen, and a run ends with the ball."""

import numpy as np
import pytest

from soro_lib.papers.soft_handover.explorer import GRAB, HIGH, LOW, HandoverExplorer, HandoverSession, explore
from soro_lib.replication import frontend


@pytest.fixture
def explorer():
    return HandoverExplorer()


def pixel(explorer, index, point):
    return explorer.session.cameras[index].project([point])[0]


def drag(explorer, index, x, y, gesture, down=1):
    explorer.cameras[index].drag = [float(x), float(y), gesture, down]


def test_pictures_and_shapes_are_drawn_at_once(explorer):
    assert all(camera.picture[:3] == b"\xff\xd8\xff" for camera in explorer.cameras)
    assert len(explorer.view.scene["tubes"]) == 3
    explorer.advance()
    assert len(explorer.view.scene["tubes"]) == 4
    assert "step 1" in explorer.message.value


@pytest.mark.parametrize("index", [0, 1])
def test_a_dragged_ball_follows_the_pointer_and_keeps_its_depth(explorer, index):
    before = explorer.session.ball.copy()
    x, y = pixel(explorer, index, before)
    drag(explorer, index, x, y, 1)
    drag(explorer, index, x + 60, y - 20, 1)
    drag(explorer, index, x + 60, y - 20, 1, 0)
    after = explorer.session.ball
    assert np.abs(pixel(explorer, index, after) - (x + 60, y - 20)).max() < 4
    forward = explorer.session.observer.views[index].pose[:3, 2]
    assert forward @ after == pytest.approx(forward @ before, abs=1e-9)
    assert np.linalg.norm(explorer.session.seen.ball - after) < 0.005


def test_the_ball_stays_in_reach_and_a_drag_of_nothing_moves_nothing(explorer):
    x, y = pixel(explorer, 0, explorer.session.ball)
    drag(explorer, 0, x, y, 1)
    drag(explorer, 0, x - 3000, y, 1)
    assert (explorer.session.ball >= LOW).all()
    assert (explorer.session.ball <= HIGH).all()
    ball, state = explorer.session.ball.copy(), explorer.session.state.copy()
    drag(explorer, 0, x + 5 * GRAB, 30, 2)
    assert np.array_equal(ball, explorer.session.ball)
    assert np.array_equal(state, explorer.session.state)


def test_a_pushed_arm_goes_where_it_is_pushed_until_let_go(explorer):
    start = explorer.session.gripper
    x, y = pixel(explorer, 0, start)
    drag(explorer, 0, x, y, 1)
    drag(explorer, 0, x - 70, y, 1)
    assert explorer.session.push is not None
    assert explorer.session.gripper[0] < start[0] - 0.01
    drag(explorer, 0, x - 70, y, 1, 0)
    assert explorer.session.push is None


def test_a_covered_camera_costs_the_ball_and_not_the_arm(explorer):
    explorer.advance()
    explorer.covers[0].value = True
    assert explorer.session.seen.ball is None
    assert explorer.session.seen.wrist is not None
    explorer.covers[1].value = True
    explorer.advance()
    assert "hold" in explorer.message.value
    explorer.covers[0].value = explorer.covers[1].value = False
    assert explorer.session.seen.ball is not None


@pytest.mark.parametrize(("plant", "estimator"), [("K", "joint"), ("E", "thesis")])
def test_a_run_ends_with_the_ball_in_the_gripper(plant, estimator):
    session = HandoverSession()
    session.start(plant, estimator, 0.4)
    for _ in range(60):
        if not session.step():
            break
    assert session.finished
    assert "held" in session.status()
    assert not session.step()


def test_alpha_changes_in_the_middle_and_again_starts_anew(explorer):
    explorer.advance()
    commanded = explorer.session.controller.q_sys.copy()
    explorer.step_size.value = 0.6
    assert explorer.session.controller.parameters.control.step_size == pytest.approx(0.6)
    assert np.array_equal(commanded, explorer.session.controller.q_sys)
    explorer.plant.value = "E"
    assert explorer.session.steps == 0
    assert explorer.session.controller.parameters.control.step_size == pytest.approx(0.6)


def test_the_run_button_works_without_an_event_loop(explorer):
    explorer.run.value = True
    assert explorer.session.steps == 1
    assert not explorer.run.value


def test_headless_is_a_picture(monkeypatch):
    monkeypatch.setenv("SORO_OUTPUT", "somewhere")
    assert not frontend.is_live()
    assert explore().data[:4] == b"\x89PNG"

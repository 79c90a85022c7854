"""The explorer steps the real task from batches of inputs; only their time stamps count."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control.experiments.trial_format import TrialHeader
from soro_lib.papers.shared_control.experiments.trials import load_trial, load_trials, trial_table
from soro_lib.papers.shared_control.explorer import (
    HIGH,
    LOW,
    CompliantHand,
    DrivenTrial,
    OperatorExplorer,
    explore,
    trials_to_show,
)
from soro_lib.papers.shared_control.world.people import DEVICE_SCALE, EXPERT
from soro_lib.project import data_directory
from soro_lib.replication import frontend

START = (0.0, 0.0, 0.1)


def header(paradigm="full_teleoperation", environment="simulated", **options):
    return TrialHeader(paradigm, environment, "reader", seed=(1, 1), **options)


def drive(trial, aim, seconds, closed=False, confirmed=False, rate=60.0):
    """Hold an aim for some time, with inputs at a rate."""
    count = round(seconds * rate)
    stamps = trial.input.time + np.arange(1, count + 1) / rate
    trial.advance([[float(time), *aim, int(closed), int(confirmed)] for time in stamps])


def deliver(trial):
    """The whole task by hand: to each item, close, to its target, open."""
    scene, real = trial.header.scene, trial.task.rule.confirmed_by_hand
    wait = 12.0 if real else 5.0
    for item, target in zip(scene.items, scene.targets, strict=True):
        drive(trial, (item[0], item[1], 0.55), wait)
        drive(trial, item, wait)
        drive(trial, item, 0.5, closed=True)
        drive(trial, item, 0.5, closed=True, confirmed=real)
        drive(trial, (target[0], target[1], 0.5), wait, closed=True, confirmed=real)
        drive(trial, target, wait, closed=True, confirmed=real)
        drive(trial, target, 3.0, confirmed=real)
        drive(trial, (target[0], target[1], 0.5), 4.0)


@pytest.mark.parametrize("environment", ["simulated", "real"])
@pytest.mark.parametrize("paradigm", PARADIGMS)
def test_whole_task_under_every_paradigm(tmp_path, paradigm, environment):
    trial = DrivenTrial(tmp_path, header(paradigm, environment, hand_stiffness=600.0))
    deliver(trial)
    assert trial.status == "done"
    recorded = load_trial(trial.recorder.path)
    assert recorded.complete
    assert recorded.finished
    shown = {name: math.nan if value is None else value for name, value in trial.metrics().items()}
    np.testing.assert_allclose(list(recorded.metrics().values()), list(shown.values()), rtol=1e-5, atol=1e-5)
    assert shown["placement_error_mm"] < 50.0
    np.testing.assert_allclose(recorded.replay(), recorded.points("tip"), rtol=1e-7, atol=1e-8)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(1, 60), min_size=1, max_size=8), st.randoms(use_true_random=False))
def test_trajectory_does_not_depend_on_the_batches(tmp_path_factory, sizes, random):
    folder = tmp_path_factory.mktemp("batches")
    stamps = np.cumsum([random.uniform(0.001, 0.05) for _ in range(sum(sizes))])
    inputs = [
        [float(time), *(random.uniform(low, high) for low, high in zip(LOW, HIGH)), 0, 0] for time in stamps
    ]
    whole, pieces = (DrivenTrial(folder, header("fixed_assistance")) for _ in range(2))
    whole.advance(inputs)
    for begin, end in pairwise([0, *np.cumsum(sizes)]):
        pieces.advance(inputs[begin:end])
    assert whole.task.state.plant.tip == pieces.task.state.plant.tip
    assert whole.time == pieces.time == pytest.approx(math.floor(stamps[-1] * 100 + 1e-7) / 100)
    for trial in (whole, pieces):
        trial.stop()


def test_an_input_holds_until_the_next_one(tmp_path):
    trial = DrivenTrial(tmp_path, header())
    trial.advance([[0.015, 0.3, 0.0, 0.2, 0, 0], [0.05, 0.1, 0.0, 0.2, 0, 0]])
    trial.stop()
    aims = load_trial(trial.recorder.path).points("aim")
    np.testing.assert_array_equal(aims[:, 0], [0.0, 0.3, 0.3, 0.3, 0.3])


BAD_INPUTS = {
    "not a number": [0.5, math.nan, 0, 0.1, 0, 0],
    "infinite time": [math.inf, 0, 0, 0.1, 0, 0],
    "too few": [0.5, 0, 0],
    "text": [0.5, "0", 0, 0.1, 0, 0],
    "nothing": None,
    "backward": [0.1, 0, 0, 0.1, 0, 0],
    "a jump": [60.0, 0, 0, 0.1, 0, 0],
}


@pytest.mark.parametrize("case", BAD_INPUTS)
def test_bad_input_is_skipped_and_counted(tmp_path, case):
    trial = DrivenTrial(tmp_path, header())
    drive(trial, START, 0.2)
    trial.advance([BAD_INPUTS[case]])
    assert (trial.skipped, trial.time) == (1, 0.2)
    drive(trial, START, 0.2)
    assert trial.frame()["skipped"] == 1
    assert trial.time == pytest.approx(0.4)
    trial.stop()


def test_aim_outside_the_workspace_is_moved_to_its_border(tmp_path):
    trial = DrivenTrial(tmp_path, header())
    drive(trial, (9.0, -9.0, 9.0), 0.1)
    assert trial.input.aim == (HIGH[0], LOW[1], HIGH[2])
    trial.stop()


def test_time_out_ends_the_trial_and_its_file(tmp_path, monkeypatch):
    monkeypatch.setattr("soro_lib.papers.shared_control.explorer.TIME_LIMIT", 1.0)
    trial = DrivenTrial(tmp_path, header())
    drive(trial, START, 3.0)
    assert (trial.status, trial.time) == ("time out", 1.0)
    recorded = load_trial(trial.recorder.path)
    assert (recorded.complete, recorded.finished) == (True, False)


# --- The hand ---------------------------------------------------------------------------------------------


def test_hand_settles_at_aim_plus_force_over_stiffness():
    hand, aim = CompliantHand(stiffness=150.0, friction=0.0), (0.1, -0.05, 0.4)
    force = (3.0, -1.5, 0.6)
    for _ in range(200):
        command = hand.command(aim, force)
    expected = np.add(aim, np.multiply(DEVICE_SCALE, force) / 150.0)
    assert command == pytest.approx(expected, abs=1e-6)
    for _ in range(200):
        command = hand.command(aim, (0.0, 0.0, 0.0))
    assert command == pytest.approx(aim, abs=1e-6)


def test_force_acts_only_through_the_hand(tmp_path):
    """A rigid hand feels the force and goes where it aims; a soft one is pulled toward the goal."""
    gaps = {}
    for stiffness in (50.0, 600.0, 1e9):
        trial = DrivenTrial(tmp_path, header("fixed_assistance", hand_stiffness=stiffness))
        drive(trial, START, 3.0)
        trial.stop()
        assert math.hypot(*trial.task.state.force) > 0.3
        gaps[stiffness] = math.dist(trial.task.state.plant.tip, START)
    assert gaps[50.0] > gaps[600.0] > 0.05
    assert gaps[1e9] < 1e-6


def test_hand_stiffness_must_be_positive():
    with pytest.raises(ValueError, match="stiffness must be a finite number above 0"):
        CompliantHand(stiffness=0.0)


# --- The explorer -----------------------------------------------------------------------------------------


@pytest.fixture
def explorer(tmp_path):
    return OperatorExplorer(tmp_path / "trials")


def send(explorer, *inputs, run=None, seq=1):
    explorer.receive(
        {"type": "inputs", "run": explorer.runs if run is None else run, "seq": seq, "inputs": list(inputs)}
    )


def test_nothing_is_written_before_the_start(explorer):
    assert explorer.view.frame["status"] == "ready"
    send(explorer, [0.1, 0, 0, 0.1, 0, 0])
    assert explorer.trial is None
    assert not explorer.folder.exists()


def test_choices_are_recorded_and_fixed_during_a_trial(explorer):
    explorer.paradigm.value, explorer.environment.value = "fixed_assistance", "real"
    explorer.law.value, explorer.stiffness.value = "program", 300.0
    explorer.sight.value = "camera"
    assert explorer.view.scene["title"] == "Fixed Assistance"
    assert explorer.view.scene["confirms"]
    assert explorer.view.scene["elevation"] == EXPERT.view_elevation
    explorer.receive({"type": "start"})
    assert explorer.view.frame["status"] == "armed"
    assert all(control.disabled for control in explorer.controls)
    send(explorer, [0.1, 0, 0, 0.1, 0, 0], seq=7)
    assert (explorer.view.frame["status"], explorer.view.frame["seq"]) == ("running", 7)
    explorer.receive({"type": "stop"})
    assert explorer.view.frame["status"] == "stopped"
    assert not any(control.disabled for control in explorer.controls)
    recorded = load_trials(explorer.folder)[0].header
    assert (recorded.paradigm, recorded.environment) == ("fixed_assistance", "real")
    assert (recorded.force_law, recorded.hand_stiffness, recorded.view) == ("program", 300.0, "camera")


def test_law_can_be_chosen_only_where_there_is_a_force(explorer):
    for name, paradigm in PARADIGMS.items():
        explorer.paradigm.value = name
        assert explorer.law.disabled == (paradigm.assistance == "none")


def test_inputs_of_an_earlier_trial_are_left_alone(explorer):
    explorer.start()
    explorer.start()
    send(explorer, [0.5, 0.3, 0, 0.1, 0, 0], run=1)
    assert explorer.trial.time == 0.0
    assert [path.name[:4] for path in sorted(explorer.folder.iterdir())] == ["0001", "0002"]
    assert load_trials(explorer.folder) == [], "neither has a sample"


def full_disk(lines):
    raise OSError(28, "No space left on device")


def test_trial_that_cannot_be_recorded_says_so(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    explorer = OperatorExplorer(tmp_path / "file" / "trials")
    explorer.receive({"type": "start"})
    assert "cannot be recorded" in explorer.view.frame["message"]
    explorer = OperatorExplorer(tmp_path / "good")
    explorer.start()
    send(explorer, [0.5, 0.3, 0, 0.1, 0, 0])
    monkeypatch.setattr(explorer.trial.recorder, "write", full_disk)
    send(explorer, [1.0, 0.3, 0, 0.1, 0, 0])
    assert explorer.view.frame["status"] == "failed"
    assert "No space left" in explorer.view.frame["message"]
    assert len(load_trials(explorer.folder)[0].samples) == 50, "what was written stays"


def test_driven_trials_land_in_the_table(explorer):
    explorer.paradigm.value = "asme"
    trial = explorer.start()
    deliver(trial)
    table = trial_table(load_trials(explorer.folder))
    assert list(table[["paradigm", "kind", "operator", "finished"]].iloc[0]) == ["asme", "own", "reader", 1.0]


def test_without_a_reader_there_is_a_picture_and_shipped_trials(monkeypatch, tmp_path):
    shipped = data_directory("shared_control") / "trials"
    assert explore().data.startswith(b"\x89PNG")
    assert trials_to_show() == shipped
    monkeypatch.setattr(frontend, "get_ipython", lambda: type("Shell", (), {"kernel": object()})())
    monkeypatch.delenv("SORO_OUTPUT", raising=False)
    monkeypatch.setattr("soro_lib.papers.shared_control.explorer.trials_directory", lambda: tmp_path)
    assert isinstance(explore(), OperatorExplorer)
    assert trials_to_show() == shipped, "nothing recorded yet"
    trial = DrivenTrial(tmp_path, header())
    drive(trial, START, 0.1)
    trial.stop()
    assert trials_to_show() == tmp_path
    assert trials_to_show(shipped) == shipped
    with pytest.raises(FileNotFoundError, match="no such folder of trials"):
        trials_to_show(tmp_path / "none")

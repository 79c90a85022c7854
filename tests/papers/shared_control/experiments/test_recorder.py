"""A trial under way is on the disk at any moment."""

import os
import signal
import subprocess
import sys

import numpy as np

from soro_lib.papers.shared_control.experiments.recorder import TrialRecorder, recordable, sample_line
from soro_lib.papers.shared_control.experiments.trial_format import TrialHeader
from soro_lib.papers.shared_control.experiments.trials import load_trials, trial_table


def drive(header, folder, seconds, aim=(0.0, 0.0, 0.1)):
    """A trial with a resting hand and an open gripper, left under way."""
    task, recorder = header.task(), TrialRecorder(folder, header)
    for _ in range(round(100 * seconds)):
        command = recordable(aim)
        sample = task.step(command, False, False)
        recorder.write([sample_line(sample, aim, command, False, False, task.state.goal.item)])
    return recorder


def test_trial_under_way_can_be_read_and_is_marked(tmp_path):
    recorder = drive(TrialHeader("full_teleoperation", "simulated", "reader", seed=(1,)), tmp_path, 0.5)
    (trial,) = load_trials(tmp_path)
    assert trial.path.name == "0001_full_teleoperation_simulated.csv.part"
    assert not trial.complete
    assert not trial.finished
    assert len(trial.samples) == 50
    row = trial_table([trial]).iloc[0]
    assert (row["complete"], row["finished"], row["time_s"]) == (False, 0.0, 0.5)
    assert np.isnan(row["release_error_mm"])
    recorder.close()


def test_torn_last_line_is_left_out(tmp_path):
    recorder = drive(TrialHeader("msae", "real", "reader", seed=(1,)), tmp_path, 0.2)
    recorder.file.write("0.21,0,0")
    recorder.close()
    assert len(load_trials(tmp_path)[0].samples) == 20


def test_trial_survives_a_killed_process(tmp_path):
    code = (
        "import os, signal; from pathlib import Path\n"
        "from soro_lib.papers.shared_control.experiments.recorder import TrialRecorder, sample_line\n"
        "from soro_lib.papers.shared_control.experiments.trial_format import TrialHeader\n"
        "header = TrialHeader('asme', 'simulated', 'reader', seed=(1,)); task = header.task()\n"
        f"recorder = TrialRecorder(Path({str(tmp_path)!r}), header)\n"
        "for _ in range(30):\n"
        "    sample = task.step((0, 0, 0.1), False, False)\n"
        "    recorder.write([sample_line(sample, (0, 0, 0.1), (0, 0, 0.1), False, False, 0)])\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    killed = subprocess.run([sys.executable, "-c", code], check=False, cwd=os.getcwd())
    assert killed.returncode == -signal.SIGKILL
    (trial,) = load_trials(tmp_path)
    assert (len(trial.samples), trial.complete) == (30, False)


def test_names_are_counted_on_and_nothing_is_overwritten(tmp_path):
    header = TrialHeader("asme", "simulated", "reader", seed=(1,))
    recorders = [drive(header, tmp_path, 0.02) for _ in range(3)]
    assert [recorder.number for recorder in recorders] == [1, 2, 3]
    assert recorders[1].finish().name == "0002_asme_simulated.csv"
    assert TrialRecorder(tmp_path, header).number == 4
    assert [trial.complete for trial in load_trials(tmp_path)] == [False, True, False]

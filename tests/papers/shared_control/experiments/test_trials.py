"""A recorded trial is read as it was driven, or refused with file, row and column."""

import gzip
import shutil

import numpy as np
import pandas as pd
import pytest

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control.experiments.demonstrations import (
    summary,
)
from soro_lib.papers.shared_control.experiments.metrics import mean_assistance
from soro_lib.papers.shared_control.experiments.simulation import (
    METRICS,
    TRACE,
    TrialPlan,
    simulate,
    trial_metrics,
)
from soro_lib.papers.shared_control.experiments.task import TaskSettings
from soro_lib.papers.shared_control.experiments.trial_format import TrialError
from soro_lib.papers.shared_control.experiments.trials import load_trial, load_trials, standing, trial_table
from soro_lib.papers.shared_control.recordings import (
    SHIPPED,
)
from soro_lib.papers.shared_control.world.people import NAIVE
from soro_lib.project import data_directory

SHIPPED_FOLDER = data_directory("shared_control") / "trials"


@pytest.fixture(scope="module")
def short_file(tmp_path_factory):
    """The quickest shipped trial, unpacked."""
    path = tmp_path_factory.mktemp("short") / "0006_mostly_autonomous_simulated.csv"
    path.write_bytes(gzip.decompress((SHIPPED_FOLDER / (path.name + ".gz")).read_bytes()))
    return path


@pytest.mark.parametrize("number", range(len(SHIPPED)))
def test_recorded_commands_replay_to_the_recorded_trajectory(shipped, number):
    trial = shipped[number]
    np.testing.assert_allclose(trial.replay(), trial.points("tip"), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("number", range(len(SHIPPED)))
def test_metrics_of_the_recording_are_those_of_the_task(shipped, number):
    trial = shipped[number]
    task = trial.header.task()
    buttons = trial.samples[["gripper_closed", "confirmed"]].to_numpy(dtype=bool)
    for command, (closed, confirmed) in zip(trial.points("command"), buttons, strict=True):
        task.step(command, closed, confirmed)
    expected = trial_metrics(task.rule, task.state, task.memory)
    np.testing.assert_allclose(list(trial.metrics().values()), expected, rtol=1e-5, atol=1e-5)


def test_trace_has_the_columns_of_a_simulated_one(shipped):
    trace = shipped[1].trace
    assert list(trace) == list(TRACE)
    assert trace["distance_m"].iloc[-1] == pytest.approx(
        np.linalg.norm(shipped[1].points("goal")[-1] - shipped[1].points("tip")[-1])
    )
    assert set(trace["item"]) == {-1.0, 0.0, 1.0}


def corrupted(source, folder, change):
    """A copy of a trial file whose lines were changed."""
    lines = source.read_text().splitlines()
    path = folder / source.name
    path.write_text("\n".join(change(lines)) + "\n")
    return path


def first_row(lines):
    return next(index for index, line in enumerate(lines) if not line.startswith("#"))


def set_value(lines, row, column, text):
    """Replace one value; row 1 is the first after the names of the columns."""
    top = first_row(lines)
    values = lines[top + row].split(",")
    values[lines[top].split(",").index(column)] = text
    return [*lines[: top + row], ",".join(values), *lines[top + row + 1 :]]


def rename(lines, old, new):
    top = first_row(lines)
    return [*lines[:top], lines[top].replace(old, new), *lines[top + 1 :]]


def set_header(lines, name, value):
    return [f"# {name} = {value}" if line.startswith(f"# {name} ") else line for line in lines]


BAD_FILES = {
    "missing column": (
        lambda lines: rename(lines, "tip_y_m", "other"),
        r"0006\S+: column tip_y_m is missing \(\[m\] end-effector",
    ),
    "wrong unit": (
        lambda lines: rename(lines, "tip_y_m", "tip_y_mm"),
        r"0006\S+: column tip_y_mm has the wrong unit; tip_y_m in \[m\] is needed",
    ),
    "millimetres": (
        lambda lines: set_value(lines, 12, "tip_z_m", "645.0"),
        r"row 12, column tip_z_m: '645.0' is beyond 5: is it in \[m\]\?",
    ),
    "nan": (
        lambda lines: set_value(lines, 7, "force_x_n", "nan"),
        r"0006\S+, row 7, column force_x_n: 'nan' is not a finite number",
    ),
    "infinite": (
        lambda lines: set_value(lines, 7, "goal_x_m", "inf"),
        r"row 7, column goal_x_m: 'inf' is not a finite",
    ),
    "text": (
        lambda lines: set_value(lines, 1, "tip_x_m", "left"),
        r"row 1, column tip_x_m: 'left' is not a finite number",
    ),
    "empty value": (
        lambda lines: set_value(lines, 3, "tip_x_m", ""),
        r"row 3, column tip_x_m: '' is not a finite number",
    ),
    "unsorted": (
        lambda lines: set_value(lines, 40, "time_s", "0.2"),
        r"row 40, column time_s: 0.2 s must be above 0.39 s in the row before",
    ),
    "starts at zero": (
        lambda lines: set_value(lines, 1, "time_s", "0"),
        r"row 1, column time_s: 0 s must be above 0 s",
    ),
    "unknown phase": (
        lambda lines: set_value(lines, 5, "phase", "flying"),
        r"row 5, column phase: 'flying' is not one of start, grasping",
    ),
    "button": (
        lambda lines: set_value(lines, 5, "gripper_closed", "2"),
        r"row 5, column gripper_closed: '2' is not a whole number from 0 to 1",
    ),
    "no such item": (
        lambda lines: set_value(lines, 5, "item_held", "3"),
        r"row 5, column item_held: '3' is not a whole number from 0 to 2",
    ),
    "ragged": (
        lambda lines: [*lines, lines[-1] + ",1,2"],
        r"0006\S+: not a table of comma-separated values",
    ),
    "no samples": (lambda lines: lines[: first_row(lines) + 1], r"0006\S+: no samples"),
    "empty": (lambda lines: [], r"0006\S+: the first line must be"),
    "another format": (
        lambda lines: lines[first_row(lines) :],
        'the first line must be "# soro_lib trial 1"',
    ),
    "paradigm": (
        lambda lines: set_header(lines, "paradigm", '"telepathy"'),
        r"0006\S+: paradigm must be one of 'full_teleoperation', .*got 'telepathy'",
    ),
    "environment": (
        lambda lines: set_header(lines, "environment", '"imagined"'),
        "environment must be",
    ),
    "view": (
        lambda lines: set_header(lines, "view", '"mirror"'),
        "view must be one of 'above and front', 'camera'",
    ),
    "law": (lambda lines: set_header(lines, "force_law", '"third"'), "force_law must be"),
    "no paradigm": (
        lambda lines: [line for line in lines if not line.startswith("# paradigm")],
        "the header lacks paradigm",
    ),
    "header in millimetres": (
        lambda lines: [line.replace("# items_m ", "# items_mm ") for line in lines],
        r"unknown entry 'items_mm' in the header; known are .*items_m,",
    ),
    "targets too far": (
        lambda lines: set_header(lines, "targets_m", "[[0.4, -170, 0.6], [0.4, 0.1, 0.6]]"),
        r"targets_m\[0\] is out of reach",
    ),
    "type": (
        lambda lines: set_header(lines, "seed", '"one"'),
        r"seed must be \[-\] entropy .*got 'one'",
    ),
    "stiffness": (
        lambda lines: set_header(lines, "hand_stiffness_n_per_m", "-3"),
        "hand_stiffness_n_per_m must be a finite number above 0",
    ),
    "not TOML": (lambda lines: set_header(lines, "seed", "[1,"), "the header is not TOML"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_file_is_refused_by_name_row_and_column(short_file, tmp_path, case):
    change, message = BAD_FILES[case]
    corrupted(short_file, tmp_path, change)
    with pytest.raises(TrialError, match=message):
        load_trials(tmp_path)


def test_damaged_archive_and_binary_file_are_refused(tmp_path):
    source = SHIPPED_FOLDER / "0006_mostly_autonomous_simulated.csv.gz"
    (tmp_path / "0001_x.csv.gz").write_bytes(source.read_bytes()[:5000])
    with pytest.raises(TrialError, match=r"0001_x\.csv\.gz: truncated or damaged gzip"):
        load_trials(tmp_path)
    (tmp_path / "0001_x.csv.gz").unlink()
    (tmp_path / "0002_x.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(TrialError, match=r"0002_x\.csv: not a text file"):
        load_trials(tmp_path)


def test_endless_file_is_refused(short_file, tmp_path, monkeypatch):
    monkeypatch.setattr("soro_lib.papers.shared_control.experiments.trial_format.MAXIMUM_ROWS", 100)
    with pytest.raises(TrialError, match=r"samples, bound 100; cut the file"):
        load_trial(short_file)


def test_folder_must_exist_and_may_be_empty(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such folder of trials"):
        load_trials(tmp_path / "none")
    (tmp_path / "notes.txt").write_text("not a trial")
    assert load_trials(tmp_path) == []
    assert list(trial_table([]))[-len(METRICS) :] == list(METRICS)


def test_trial_without_a_seed_cannot_be_replayed(short_file, tmp_path):
    path = corrupted(short_file, tmp_path, lambda lines: set_header(lines, "seed", "[]"))
    trial = load_trial(path)
    assert trial.finished
    with pytest.raises(ValueError, match="no seed, so it cannot be replayed"):
        trial.replay()


def test_recording_at_another_rate_keeps_its_metrics(shipped, tmp_path):
    """Every third sample, as a slower device would give it: the metrics stay within the sampling."""
    trial = shipped[2]
    keep = np.arange(len(trial.samples)) % 3 == 2
    keep[-1] = True
    thin = type(trial)(trial.path, trial.header, trial.samples[keep].reset_index(drop=True), True)
    fine, coarse = trial.metrics(), thin.metrics()
    assert coarse["time_s"] == fine["time_s"]
    assert coarse["path_m"] == pytest.approx(fine["path_m"], rel=0.01)
    assert coarse["assistance_n"] == pytest.approx(fine["assistance_n"], rel=0.01)
    assert coarse["release_error_mm"] == pytest.approx(fine["release_error_mm"], abs=2.0)


def test_recording_that_goes_on_after_the_delivery_is_counted_to_it(shipped):
    trial = shipped[0]
    last = trial.samples.iloc[[-1]].copy()
    last["time_s"] += 5.0
    longer = pd.concat([trial.samples, last], ignore_index=True)
    assert type(trial)(trial.path, trial.header, longer, True).metrics() == trial.metrics()


def test_table_goes_into_the_statistics_of_the_study(shipped):
    table = trial_table(shipped)
    assert list(table["trial"]) == [0] * len(shipped)
    statistics = summary(table)
    assert set(statistics["paradigm"]) == set(PARADIGMS)
    forces = shipped[1].points("force")
    mean = statistics.query("paradigm == 'assist_as_needed' and metric == 'assistance_n'")["mean"]
    assert mean.iloc[0] == pytest.approx(mean_assistance(forces, shipped[1].samples["time_s"]))


def test_standing_counts_the_crowd_below(shipped):
    plans = [
        TrialPlan(
            TaskSettings(PARADIGMS["asme"]),
            NAIVE,
            (seed,),
            {"environment": "simulated", "kind": "naive", "paradigm": "asme"},
        )
        for seed in range(20)
    ]
    crowd = simulate(plans)
    table = trial_table(shipped)
    rows = standing(table, crowd)
    assert set(rows["paradigm"]) == {"asme"}
    time = rows[rows["metric"] == "time_s"].iloc[0]
    assert time["below"] == (crowd["time_s"] < time["own"]).mean()
    assert time["crowd_median"] == crowd["time_s"].median()
    assert standing(table[table["paradigm"] == "msae"], crowd).empty


def test_files_may_be_moved_and_copied(shipped, tmp_path):
    for trial in shipped[:2]:
        shutil.copy(trial.path, tmp_path / f"mine-{trial.path.name}")
    assert len(load_trials(tmp_path)) == 2

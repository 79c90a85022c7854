"""A recorded trial is read as it was driven, or refused with file, row and column."""

import gzip
import os
import shutil
import signal
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control import figures
from soro_lib.papers.shared_control.experiments.demonstrations import run_demonstrations, summary
from soro_lib.papers.shared_control.experiments.metrics import mean_assistance
from soro_lib.papers.shared_control.experiments.recorder import (
    SHIPPED,
    TrialRecorder,
    record_operator,
    recordable,
    sample_line,
    write_shipped_trials,
)
from soro_lib.papers.shared_control.experiments.simulation import (
    METRICS,
    TRACE,
    TrialPlan,
    simulate,
    trial_metrics,
)
from soro_lib.papers.shared_control.experiments.task import TaskSettings
from soro_lib.papers.shared_control.experiments.trial_format import TrialError, TrialHeader, trial_columns
from soro_lib.papers.shared_control.experiments.trials import load_trial, load_trials, standing, trial_table
from soro_lib.papers.shared_control.world import EXPERT, NAIVE
from soro_lib.project import data_directory
from soro_lib.replication.datacards import verified

SHIPPED_FOLDER = data_directory("shared_control") / "trials"


@pytest.fixture(scope="module")
def shipped():
    return load_trials(SHIPPED_FOLDER)


@pytest.fixture(scope="module")
def short_file(tmp_path_factory):
    """The quickest shipped trial, unpacked."""
    path = tmp_path_factory.mktemp("short") / "0006_mostly_autonomous_simulated.csv"
    path.write_bytes(gzip.decompress((SHIPPED_FOLDER / (path.name + ".gz")).read_bytes()))
    return path


def drive(header, folder, seconds, aim=(0.0, 0.0, 0.1)):
    """A trial with a resting hand and an open gripper, left under way."""
    task, recorder = header.task(), TrialRecorder(folder, header)
    for _ in range(round(100 * seconds)):
        command = recordable(aim)
        sample = task.step(command, False, False)
        recorder.write([sample_line(sample, aim, command, False, False, task.state.goal.item)])
    return recorder


# --- What is written is what was driven -------------------------------------------------------------------


def test_shipped_trials_are_whole_and_finished(shipped):
    assert [(trial.header.paradigm, trial.header.environment, trial.header.kind) for trial in shipped] == [
        *SHIPPED
    ]
    assert {paradigm for paradigm, _, _ in SHIPPED} == set(PARADIGMS)
    for trial in shipped:
        assert verified(trial.path)
        assert trial.complete
        assert trial.finished
        assert list(trial.samples) == list(trial_columns(2))


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


def test_recordings_of_one_seed_are_the_same_bytes(tmp_path):
    header = TrialHeader("mostly_autonomous", "real", "simulated", seed=(5,))
    files = [record_operator(tmp_path / name, header, EXPERT) for name in ("a", "b")]
    assert files[0].read_bytes() == files[1].read_bytes()
    other = record_operator(tmp_path / "c", TrialHeader("mostly_autonomous", "real", "s", seed=(6,)), EXPERT)
    assert not np.array_equal(load_trial(other).points("tip"), load_trial(files[0]).points("tip"))


def test_shipped_trials_are_what_their_generator_writes(tmp_path, monkeypatch):
    monkeypatch.setattr("soro_lib.papers.shared_control.experiments.recorder.SHIPPED", SHIPPED[:1])
    monkeypatch.setattr(
        "soro_lib.papers.shared_control.experiments.recorder.draw_operators", lambda *_: drawn
    )
    from soro_lib.papers.shared_control.experiments.demonstrations import draw_operators
    from soro_lib.papers.shared_control.experiments.recorder import SHIPPED_SEED

    drawn = draw_operators("expert", len(SHIPPED), SHIPPED_SEED)
    (path,) = write_shipped_trials(tmp_path)
    ours, committed = load_trial(path), load_trial(SHIPPED_FOLDER / path.name)
    assert ours.header == committed.header
    pd.testing.assert_frame_equal(ours.samples, committed.samples)
    assert verified(path)


def test_trace_has_the_columns_of_a_simulated_one(shipped):
    trace = shipped[1].trace
    assert list(trace) == list(TRACE)
    assert trace["distance_m"].iloc[-1] == pytest.approx(
        np.linalg.norm(shipped[1].points("goal")[-1] - shipped[1].points("tip")[-1])
    )
    assert set(trace["item"]) == {-1.0, 0.0, 1.0}


# --- A trial that was cut off -----------------------------------------------------------------------------


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


# --- Bad files --------------------------------------------------------------------------------------------


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
        r"0006\S+: paradigm must be one of full_teleoperation, .*got 'telepathy'",
    ),
    "environment": (
        lambda lines: set_header(lines, "environment", '"imagined"'),
        "environment must be",
    ),
    "view": (
        lambda lines: set_header(lines, "view", '"mirror"'),
        "view must be one of above and front, camera",
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
    monkeypatch.setattr("soro_lib.papers.shared_control.experiments.trials.MAXIMUM_ROWS", 100)
    with pytest.raises(TrialError, match=r"samples, bound 100; cut the file"):
        load_trial(short_file)


def test_folder_must_exist_and_may_be_empty(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such folder of trials"):
        load_trials(tmp_path / "none")
    (tmp_path / "notes.txt").write_text("not a trial")
    assert load_trials(tmp_path) == []
    assert list(trial_table([]))[-len(METRICS) :] == list(METRICS)


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(list(PARADIGMS)),
    st.sampled_from(["simulated", "real"]),
    st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1, max_size=20),
    st.lists(st.integers(0, 2**31), max_size=4),
    st.floats(1, 1e4),
)
def test_header_survives_writing_and_reading(paradigm, environment, operator, seed, stiffness):
    header = TrialHeader(
        paradigm, environment, operator, seed=tuple(seed), hand_stiffness=stiffness, force_law="program"
    )
    assert TrialHeader.parse(header.text().splitlines()) == header


def test_trial_without_a_seed_cannot_be_replayed(short_file, tmp_path):
    path = corrupted(short_file, tmp_path, lambda lines: set_header(lines, "seed", "[]"))
    trial = load_trial(path)
    assert trial.finished
    with pytest.raises(ValueError, match="no seed, so it cannot be replayed"):
        trial.replay()


# --- Irregular times, and the way into the statistics -----------------------------------------------------


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


# --- Figures ----------------------------------------------------------------------------------------------


def stars(axes):
    """Values of the driven trials drawn into an axes."""
    lines = [line for line in axes.lines if line.get_marker() == "*"]
    return sorted(float(value) for line in lines for value in line.get_ydata())


def test_driven_trials_are_drawn_where_they_belong(shipped):
    crowd = run_demonstrations(2, 1, trials=1)
    own = trial_table(shipped)
    figure = figures.fig07b_time(crowd, own)
    for axes in figure.axes:
        kind, environment = axes.get_title(loc="left").split(", ")
        fits = own[(own["kind"] == kind) & (own["environment"] == environment)]
        assert stars(axes) == sorted(fits["time_s"])
    anonymous = figures.fig07b_time(crowd, own.assign(kind="own"))
    assert [len(stars(axes)) for axes in anonymous.axes] == [6, 6, 2, 2], "both panels of the environment"
    unfinished = figures.fig09_assistance(crowd, own.assign(finished=0.0))
    assert stars(unfinished.axes[0]) == []
    assert len(stars(figures.fig09_assistance(crowd, own).axes[0])) == 3
    assert sum(len(stars(axes)) for axes in figures.fig08_error_against_time(crowd, own).axes) == 16


@pytest.mark.parametrize("count", [1, 3, 8])
def test_any_folder_of_trials_makes_every_figure(shipped, count):
    table = trial_table(shipped[:count])
    panels = table.groupby(["environment", "kind"]).ngroups
    assert len(figures.fig07a_placement_error(table).axes) == panels
    assert len(figures.fig07b_time(table).axes) == panels
    assert sum(axes.get_visible() for axes in figures.fig08_error_against_time(table).axes) == panels
    guided = table["paradigm"].isin(["assist_as_needed", "fixed_assistance"]).sum()
    assert len(figures.fig09_assistance(table).axes[0].get_xticklabels()) >= guided
    assert len(figures.fig05_stiffness_machine({"a": shipped[1].trace}).axes) == 3
    assert figures.fig04_goal_machine(shipped[5].trace).axes

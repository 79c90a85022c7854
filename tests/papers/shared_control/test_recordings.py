"""The shipped trials are what their generator writes."""

import numpy as np
import pandas as pd

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control.experiments.demonstrations import draw_operators
from soro_lib.papers.shared_control.experiments.trial_format import TrialHeader, trial_columns
from soro_lib.papers.shared_control.experiments.trials import load_trial
from soro_lib.papers.shared_control.recordings import (
    SHIPPED,
    SHIPPED_SEED,
    record_operator,
    write_shipped_trials,
)
from soro_lib.papers.shared_control.world.people import EXPERT
from soro_lib.project import data_directory
from soro_lib.replication.datacards import verified

SHIPPED_FOLDER = data_directory("shared_control") / "trials"


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


def test_recordings_of_one_seed_are_the_same_bytes(tmp_path):
    header = TrialHeader("mostly_autonomous", "real", "simulated", seed=(5,))
    files = [record_operator(tmp_path / name, header, EXPERT) for name in ("a", "b")]
    assert files[0].read_bytes() == files[1].read_bytes()
    other = record_operator(tmp_path / "c", TrialHeader("mostly_autonomous", "real", "s", seed=(6,)), EXPERT)
    assert not np.array_equal(load_trial(other).points("tip"), load_trial(files[0]).points("tip"))


def test_shipped_trials_are_what_their_generator_writes(tmp_path, monkeypatch):
    drawn = draw_operators("expert", len(SHIPPED), SHIPPED_SEED)
    monkeypatch.setattr("soro_lib.papers.shared_control.recordings.SHIPPED", SHIPPED[:1])
    monkeypatch.setattr("soro_lib.papers.shared_control.recordings.draw_operators", lambda *_: drawn)
    (path,) = write_shipped_trials(tmp_path)
    ours, committed = load_trial(path), load_trial(SHIPPED_FOLDER / path.name)
    assert ours.header == committed.header
    pd.testing.assert_frame_equal(ours.samples, committed.samples)
    assert verified(path)

"""Sweeps of any size: drawn and kept in chunks, on any number of workers, killed and taken up again."""

import json
import signal
import subprocess
import sys
import time
import tracemalloc
import warnings
from contextlib import contextmanager

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.papers.shared_control.experiments import finished_chunks, simulation
from soro_lib.papers.shared_control.experiments.demonstrations import demonstration_plans, resampled_means
from soro_lib.papers.shared_control.experiments.simulation import METRICS, simulate

PEOPLE, SEED, CHUNK = 2, 6, 4

SWEEP = f"""
import sys
from soro_lib.papers.shared_control.experiments.demonstrations import demonstration_plans
from soro_lib.papers.shared_control.experiments.simulation import simulate
plans = demonstration_plans(int(sys.argv[2]), seed={SEED}, trials=2)
simulate(plans, chunk={CHUNK}, store=sys.argv[1])
"""

MEMORY = """
import json, sys
import numpy as np
from soro_lib.papers.shared_control.experiments import simulation
from soro_lib.papers.shared_control.experiments.claims import claim_probabilities, evaluate_claims
from soro_lib.papers.shared_control.experiments.demonstrations import effects, run_demonstrations, summary
from soro_lib.papers.shared_control import figures
run_demonstrations(1, 1, trials=1)
metrics = np.abs(np.random.default_rng(1).normal(20.0, 3.0, (250, len(simulation.METRICS))))
simulation.simulate_chunk = lambda plans, time_limit: metrics[: len(plans)].copy()
trials = run_demonstrations(3200, 1)
summary(trials), effects(trials), claim_probabilities(evaluate_claims(trials))
figures.fig07b_time(trials), figures.fig08_error_against_time(trials)
# Not ru_maxrss, which begins with the memory of the process that started this one.
status = dict(line.split(":") for line in open("/proc/self/status"))
print(json.dumps([len(trials), int(status["VmHWM"].split()[0]) / 1024]))
"""


def plans(people=PEOPLE):
    return demonstration_plans(people, seed=SEED, trials=2)


@pytest.fixture(scope="module")
def alone():
    """The sweep in one go, in this process."""
    return simulate(plans(), chunk=CHUNK)


@pytest.fixture
def simulated(monkeypatch):
    """Chunks that were simulated, not read."""
    chunks = []

    def counted(piece, time_limit, run=simulation.simulate_chunk):
        chunks.append(len(piece))
        return run(piece, time_limit)

    monkeypatch.setattr(simulation, "simulate_chunk", counted)
    return chunks


def assert_same(one, other):
    pd.testing.assert_frame_equal(one, other, check_exact=True)


# --- Bootstrap in pieces ----------------------------------------------------------------------------


def whole_means(values, resamples, rng):
    """The resampling in one piece, as anyone would write it."""
    picks = rng.integers(len(values), size=(resamples, len(values)))
    return np.nanmean(values[picks], axis=1)


@given(st.integers(2, 30), st.integers(1, 40), st.integers(1, 500), st.integers(0, 2**32 - 1))
def test_resampling_in_pieces_gives_the_same_bits(people, resamples, largest, seed):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(people, 4))
    values[rng.random(values.shape) < 0.05] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a sample may be of people without an error only
        pieces = resampled_means(values, resamples, np.random.default_rng(seed), largest)
        whole = whole_means(values, resamples, np.random.default_rng(seed))
    np.testing.assert_array_equal(pieces, whole)


def test_resampling_many_people_takes_little_memory():
    values = np.random.default_rng(1).normal(size=(3200, 4))
    tracemalloc.start()
    try:
        resampled_means(values, 200, np.random.default_rng(2))
        _, in_pieces = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        whole_means(values, 200, np.random.default_rng(2))
        _, whole = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert in_pieces < 10e6
    assert whole > 4 * in_pieces


# --- Finished chunks --------------------------------------------------------------------------------


def test_a_kept_sweep_is_the_same_table_and_is_not_simulated_twice(alone, tmp_path, simulated):
    assert_same(simulate(plans(), chunk=CHUNK, store=tmp_path, jobs=2), alone)
    assert sum(simulated) == len(alone)
    simulated.clear()
    assert_same(simulate(plans(), chunk=CHUNK, store=tmp_path), alone)
    assert simulated == []


def test_a_longer_sweep_goes_on_from_a_shorter_one(tmp_path, simulated):
    shorter = list(plans())[: 2 * CHUNK]
    simulate(shorter, chunk=CHUNK, store=tmp_path)
    simulated.clear()
    longer = simulate(list(plans())[: 3 * CHUNK], chunk=CHUNK, store=tmp_path)
    assert simulated == [CHUNK]
    assert len(longer) == 3 * CHUNK


@pytest.mark.parametrize("change", ["time limit", "seed", "code"])
def test_a_stale_store_is_not_continued(tmp_path, simulated, monkeypatch, change):
    few = list(plans())[:CHUNK]
    simulate(few, chunk=CHUNK, store=tmp_path, time_limit=5.0)
    options = {"time_limit": 5.0}
    if change == "time limit":
        options = {"time_limit": 6.0}
    elif change == "seed":
        few = list(demonstration_plans(PEOPLE, seed=SEED + 1, trials=2))[:CHUNK]
    else:
        monkeypatch.setattr(finished_chunks, "code_digest", lambda: "other")
    simulated.clear()
    simulate(few, chunk=CHUNK, store=tmp_path, **options)
    assert simulated == [CHUNK]


def test_partial_and_damaged_files_are_not_believed(alone, tmp_path, simulated):
    simulate(plans(), chunk=CHUNK, store=tmp_path)
    kept = sorted(tmp_path.rglob("*.npy"))
    kept[0].rename(kept[0].with_suffix(".123.part"))
    kept[1].write_bytes(kept[1].read_bytes()[:-8])
    kept[2].write_bytes(b"")
    kept[3].write_bytes(b"no table at all")
    simulated.clear()
    assert_same(simulate(plans(), chunk=CHUNK, store=tmp_path), alone)
    assert len(simulated) == 4


def kill_when(folder, chunks, people):
    """Start the sweep in a process of its own and kill it as soon as it has kept so many chunks."""
    child = subprocess.Popen([sys.executable, "-c", SWEEP, str(folder), str(people)])
    try:
        while child.poll() is None and len(list(folder.rglob("*.npy"))) < chunks:
            time.sleep(0.005)
        child.send_signal(signal.SIGKILL)
    finally:
        child.wait()
    return child.returncode


def test_a_killed_sweep_goes_on_where_it_stood(alone, tmp_path, simulated):
    assert kill_when(tmp_path, 3, PEOPLE) == -signal.SIGKILL
    kept = len(list(tmp_path.rglob("*.npy")))
    whole = -(-len(alone) // CHUNK)
    assert 3 <= kept < whole
    assert_same(simulate(plans(), chunk=CHUNK, store=tmp_path), alone)
    assert len(simulated) == whole - kept


@pytest.mark.soak
def test_a_sweep_killed_again_and_again_ends_with_the_same_table(tmp_path):
    people, chunks = 20, 0
    while kill_when(tmp_path, chunks + 25, people) == -signal.SIGKILL:
        chunks = len(list(tmp_path.rglob("*.npy")))
    assert chunks > 100
    together = simulate(plans(people), chunk=CHUNK, store=tmp_path)
    assert_same(together, simulate(plans(people), jobs=2))


# --- Workers ----------------------------------------------------------------------------------------


@contextmanager
def cluster(workers, processes=False):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=processes,
            dashboard_address=None,
            silence_logs=50,
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


@pytest.mark.parametrize("workers", [2, 4])
def test_a_cluster_gives_the_table_of_this_process(alone, tmp_path, workers):
    with cluster(workers) as client:
        assert_same(simulate(plans(), chunk=CHUNK, scheduler=client, store=tmp_path), alone)
        assert_same(simulate(plans(), chunk=CHUNK, scheduler=client, store=tmp_path), alone)
    assert_same(simulate(plans(), chunk=CHUNK, store=tmp_path), alone)


@pytest.mark.soak
@pytest.mark.parametrize("workers", [2, 4])
def test_a_cluster_of_processes_gives_the_table_of_this_process(workers):
    with cluster(workers, processes=True) as client:
        assert_same(simulate(plans(20), scheduler=client), simulate(plans(20), jobs=2))


# --- Memory -----------------------------------------------------------------------------------------


def test_text_labels_are_categories(alone):
    text = ["environment", "kind", "paradigm"]
    assert all(isinstance(alone[name].dtype, pd.CategoricalDtype) for name in text)
    assert alone[text].memory_usage(index=False, deep=True).max() < len(alone) + 500
    assert list(alone.columns) == [*text, "operator", "trial", *METRICS]


@pytest.mark.soak
def test_the_demonstrations_of_3200_people_stay_below_400_megabytes():
    """384,000 trials through tables, claims and figures; what a trial computes is not the matter here."""
    run = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, check=True)
    trials, peak = json.loads(run.stdout.splitlines()[-1])
    assert trials == 384_000
    assert peak < 400

"""A sweep that was killed is taken up again, and nothing stale is believed."""

import signal
import subprocess
import sys
import time

import pandas as pd
import pytest

from soro_lib.papers.shared_control.experiments import finished_chunks, simulation
from soro_lib.papers.shared_control.experiments.demonstrations import demonstration_plans
from soro_lib.papers.shared_control.experiments.simulation import simulate

PEOPLE, SEED, CHUNK = 2, 6, 4


SWEEP = f"""
import sys
from soro_lib.papers.shared_control.experiments.demonstrations import demonstration_plans
from soro_lib.papers.shared_control.experiments.simulation import simulate
plans = demonstration_plans(int(sys.argv[2]), seed={SEED}, trials=2)
simulate(plans, chunk={CHUNK}, store=sys.argv[1])
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

"""One implementation: the compiled trials are the readable classes, whatever the threads or machines."""

import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager

import numpy as np
import pandas as pd
import pytest

from soro_lib.controllers import AssistAsNeeded, FixedAssistance, GoalSelection
from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.controllers.shared_control.assist_as_needed import COUNTERS, MOTIONS
from soro_lib.controllers.shared_control.goal_selection import PHASES
from soro_lib.papers.shared_control.experiments.demonstrations import (
    demonstration_plans,
)
from soro_lib.papers.shared_control.experiments.simulation import (
    METRICS,
    TRACE,
    TrialPlan,
    play_trial,
    simulate,
    trace_trial,
)
from soro_lib.papers.shared_control.experiments.task import Scene, TaskSettings
from soro_lib.papers.shared_control.world.people import EXPERT, NAIVE
from soro_lib.papers.shared_control.world.plant import PlantParameters, SoftGrowingPlant, real_arm

CASES = [
    (name, environment, law)
    for name in PARADIGMS
    for environment in ("simulated", "real")
    for law in ("printed", "program")
]


def columns(trace, name):
    return trace[[column for column in trace if column.startswith(name)]].to_numpy()


@pytest.mark.parametrize(("name", "environment", "law"), CASES)
def test_compiled_trial_is_the_interpreted_one_bit_for_bit(name, environment, law):
    plan = TrialPlan(TaskSettings(PARADIGMS[name], environment=environment, force_law=law), NAIVE, (7,))
    rule = plan.settings.rule()
    traces = [np.zeros((250, len(TRACE))) for _ in range(2)]
    for trace, compiled in zip(traces, (True, False)):
        play_trial(plan, rule, 250, trace, compiled)
    np.testing.assert_array_equal(*traces)


def grasping_trial(name, law="printed", **options):
    trace = trace_trial(TrialPlan(TaskSettings(PARADIGMS[name], force_law=law, **options), NAIVE, (3,)))
    assert trace["item"].max() == 1
    return trace


@pytest.mark.parametrize("counter", COUNTERS)
def test_compiled_assist_as_needed_is_the_readable_class(counter):
    options = {"counter": counter, "approach_delay": 0.5, "away_delay": 0.3}
    trace = grasping_trial("assist_as_needed", assist_as_needed=options)
    assistance = AssistAsNeeded(**options)
    tips, goals, forces = (columns(trace, name) for name in ("tip_", "goal_", "force_"))
    for index, row in enumerate(trace.itertuples()):
        result = assistance.update(tips[index], goals[index])
        assert MOTIONS[int(row.motion)] == result.state
        assert row.stiffness_n_per_m == result.stiffness
        assert row.magnitude_n == result.magnitude
        np.testing.assert_array_equal(forces[index], result.force)
    assert trace["stiffness_n_per_m"].max() > 0


def test_compiled_fixed_assistance_is_the_readable_class():
    trace = grasping_trial("fixed_assistance", "program")
    assistance = FixedAssistance(damping=0.0, near_distance=0.03, unit_direction=False)
    tips, goals, forces = (columns(trace, name) for name in ("tip_", "goal_", "force_"))
    ours = np.array([assistance.update(tip, goal).force for tip, goal in zip(tips, goals)])
    np.testing.assert_allclose(forces, ours, rtol=0, atol=1e-12)
    assert np.abs(forces).max() > 0


@pytest.mark.parametrize("name", ["full_teleoperation", "mostly_autonomous"])
def test_compiled_goal_machine_is_the_readable_class(name):
    trace = grasping_trial(name)
    scene = Scene()
    machine = GoalSelection(scene.items, scene.targets, lift=PARADIGMS[name].lifts)
    tips, goals = columns(trace, "tip_"), columns(trace, "goal_")
    for tip, goal, row in zip(tips, goals, trace.itertuples()):
        result = machine.update(tip, row.item >= 0)
        assert PHASES[int(row.phase)] == result.phase
        np.testing.assert_array_equal(goal, result.goal)


@pytest.mark.parametrize(("environment", "plant"), [("simulated", PlantParameters()), ("real", real_arm())])
def test_compiled_arm_is_the_readable_class(environment, plant):
    settings = TaskSettings(PARADIGMS["msae"], environment=environment)
    trace = trace_trial(TrialPlan(settings, EXPERT, (3,)))
    arm = SoftGrowingPlant(plant)
    ours = np.array([arm.step(desired) for desired in columns(trace, "desired_")])
    np.testing.assert_allclose(columns(trace, "tip_"), ours, rtol=0, atol=1e-12)


@pytest.mark.parametrize("options", [{"jobs": 2}, {"chunk": 7}, {"chunk": 1000, "jobs": 2}])
def test_numbers_do_not_depend_on_threads_or_chunks(options):
    plans = list(demonstration_plans(1, seed=4, trials=2))
    pd.testing.assert_frame_equal(simulate(plans), simulate(plans, **options), check_exact=True)


def test_a_dead_worker_changes_nothing():
    """Two worker processes, one killed in the middle of the sweep: the same table as in this process."""
    distributed = pytest.importorskip("distributed")
    plans = list(demonstration_plans(2, seed=6, trials=3))
    alone = simulate(plans, chunk=4)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        victim = next(iter(client.run(os.getpid).values()))
        killed = threading.Event()

        def kill():
            os.kill(victim, signal.SIGKILL)
            killed.set()

        timer = threading.Timer(0.5, kill)
        timer.start()
        together = simulate(plans, scheduler=client, chunk=4)
        assert killed.is_set(), "the sweep ended before the worker was killed"
        again = simulate(plans[:20], scheduler=cluster.scheduler_address, chunk=4)
    pd.testing.assert_frame_equal(alone, together, check_exact=True)
    pd.testing.assert_frame_equal(again, simulate(plans[:20], chunk=4), check_exact=True)


def test_bad_sweeps_are_named():
    with pytest.raises(ValueError, match="time_limit"):
        simulate([], time_limit=0.0)
    with pytest.raises(ValueError, match="chunk"):
        simulate([], chunk=0)
    assert simulate([]).empty


def test_an_unfinished_trial_has_no_error():
    table = simulate([TrialPlan(TaskSettings(), EXPERT, (1,))], time_limit=5.0)
    assert table["finished"][0] == 0
    assert table["time_s"][0] == 5.0
    assert np.isnan(table["placement_error_mm"][0])


PEOPLE, SEED, CHUNK = 2, 6, 4


MEMORY = """
import json, sys
import numpy as np
from soro_lib.papers.shared_control.experiments import simulation
from soro_lib.papers.shared_control.experiments.claims import claim_probabilities, evaluate_claims
from soro_lib.papers.shared_control.experiments.demonstrations import effects, run_demonstrations, summary
from soro_lib.papers.shared_control.figures import paper
run_demonstrations(1, 1, trials=1)
metrics = np.abs(np.random.default_rng(1).normal(20.0, 3.0, (250, len(simulation.METRICS))))
simulation.simulate_chunk = lambda plans, time_limit: metrics[: len(plans)].copy()
trials = run_demonstrations(3200, 1)
summary(trials), effects(trials), claim_probabilities(evaluate_claims(trials))
paper.fig07b_time(trials), paper.fig08_error_against_time(trials)
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


def assert_same(one, other):
    pd.testing.assert_frame_equal(one, other, check_exact=True)


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

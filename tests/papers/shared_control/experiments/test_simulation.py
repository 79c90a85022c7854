"""One implementation: the compiled trials are the readable classes, whatever the threads or machines."""

import os
import signal
import threading

import numpy as np
import pandas as pd
import pytest

from soro_lib.controllers import AssistAsNeeded, FixedAssistance, GoalSelection
from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.controllers.shared_control.assist_as_needed import COUNTERS, MOTIONS
from soro_lib.controllers.shared_control.goal_selection import PHASES
from soro_lib.papers.shared_control.experiments.demonstrations import demonstration_plans, run_demonstrations
from soro_lib.papers.shared_control.experiments.metrics import (
    mean_assistance,
    placement_error,
    trajectory_length,
)
from soro_lib.papers.shared_control.experiments.simulation import (
    METRICS,
    TRACE,
    TrialPlan,
    play_trial,
    simulate,
    trace_trial,
    trial_metrics,
)
from soro_lib.papers.shared_control.experiments.task import Scene, TaskSettings, Trial
from soro_lib.papers.shared_control.world import EXPERT, NAIVE
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


def test_a_trial_from_outside_is_the_simulated_one():
    """Replaying a simulated operator's commands and button through `Trial` gives the same trial."""
    settings = TaskSettings(PARADIGMS["assist_as_needed"])
    plan = TrialPlan(settings, EXPERT, (5,))
    trace = trace_trial(plan)
    trial = Trial(settings, np.random.default_rng(1))
    commands = columns(trace, "command_")
    samples = [
        trial.step(command, bool(closed)) for command, closed in zip(commands, trace["closed"], strict=True)
    ]
    np.testing.assert_array_equal([sample.tip for sample in samples], columns(trace, "tip_"))
    np.testing.assert_array_equal([sample.force for sample in samples], columns(trace, "force_"))
    assert [sample.done for sample in samples] == [False] * (len(samples) - 1) + [True]


def test_metrics_of_the_loop_are_the_equations():
    settings = TaskSettings(PARADIGMS["fixed_assistance"])
    plan = TrialPlan(settings, EXPERT, (5,))
    rule = settings.rule()
    trace = np.empty((24000, len(TRACE)))
    state, memory = play_trial(plan, rule, 24000, trace)
    metrics = dict(zip(METRICS, trial_metrics(rule, state, memory), strict=True))
    table = pd.DataFrame(trace[: state.sample], columns=list(TRACE))
    tips = np.vstack([settings.scene.start, columns(table, "tip_")])
    assert metrics["path_m"] == pytest.approx(trajectory_length(tips))
    force = mean_assistance(columns(table, "force_"), table["time_s"])
    assert metrics["assistance_n"] == pytest.approx(force)
    placed = 1e3 * placement_error(memory.items, settings.scene.targets)
    assert metrics["placement_error_mm"] == pytest.approx(placed)
    assert metrics["item1_time_s"] + metrics["item2_time_s"] == pytest.approx(metrics["time_s"])


def test_printed_path_integral_is_only_the_displacement():
    angle = np.linspace(0, 2 * np.pi, 1001)
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    assert trajectory_length(circle) == pytest.approx(2 * np.pi, rel=1e-4)
    np.testing.assert_allclose(np.diff(circle, axis=0).sum(axis=0), 0.0, atol=1e-12)


def test_printed_assistance_and_error_need_the_norm_and_the_index():
    forces = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    assert mean_assistance(forces, [1.0, 2.0]) == 1.0
    np.testing.assert_array_equal(forces.mean(axis=0), 0.0)
    items = np.array([[0.0, 0.0, 0.6], [1.0, 0.0, 0.6]])
    assert placement_error(items, items) == 0.0  # eq. (11) prints one target t for both items
    assert placement_error(items, np.tile(items[0], (2, 1))) == 0.5


@pytest.mark.parametrize("options", [{"jobs": 2}, {"chunk": 7}, {"chunk": 1000, "jobs": 2}])
def test_numbers_do_not_depend_on_threads_or_chunks(options):
    plans = list(demonstration_plans(1, seed=4, trials=2))
    pd.testing.assert_frame_equal(simulate(plans), simulate(plans, **options), check_exact=True)


def test_the_first_people_are_the_same_however_many_there_are():
    few, many = run_demonstrations(1, 2, trials=1), run_demonstrations(2, 2, trials=1)
    same = many[many["operator"] == 0].reset_index(drop=True)
    pd.testing.assert_frame_equal(few, same)


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


# --- The task for a hand from outside and bad input -------------------------------------------------


def test_a_sample_that_is_not_a_number_holds_the_last_command():
    trial = Trial(TaskSettings(), np.random.default_rng(1))
    good = trial.step((0.1, 0.0, 0.5), gripper_closed=False)
    held = trial.step((np.nan, 0.0, 0.5), gripper_closed=False)
    assert not good.held_command
    assert held.held_command
    np.testing.assert_array_equal(held.desired, [0.1, 0.0, 0.5])
    with pytest.raises(ValueError, match=r"command must have shape \(3,\)"):
        trial.step((0.0, 1.0), gripper_closed=False)


def test_the_real_arm_waits_for_the_operator_to_report_the_item():
    trial = Trial(
        TaskSettings(environment="real", scene=Scene(start=(-0.095, 0.117, 0.64))), np.random.default_rng(1)
    )
    here = (-0.095, 0.117, 0.645)
    assert trial.step(here, True, confirm=False).item == 0
    assert trial.step(here, True, confirm=False).phase == "grasping"
    assert trial.step(here, True, confirm=True).phase == "placing"


def test_a_dropped_item_falls_and_can_be_fetched():
    trial = Trial(TaskSettings(PARADIGMS["msae"]), np.random.default_rng(1))
    here = (-0.095, 0.117, 0.645)
    for _ in range(800):
        trial.step(here, False)
    for _ in range(30):
        sample = trial.step(here, True)
    assert sample.phase == "lifting with item"
    sample = trial.step(here, False)
    assert sample.phase == "grasping"
    np.testing.assert_allclose(sample.goal, [*sample.tip[:2], 0.645])
    np.testing.assert_allclose(sample.items[0], sample.goal)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"environment": "imagined"}, "environment must be"),
        ({"force_law": "guessed"}, "force_law must be"),
        ({"scene": Scene(items=((0.0, 0.0, 3.0), (0.0, 0.0, 0.6)))}, r"items\[0\] is out of reach"),
        ({"assist_as_needed": {"maximum_force": -1.0}}, "maximum_force"),
        ({"detection_error": (np.nan, 0.0, 0.0)}, "detection_error must be finite"),
    ],
)
def test_bad_settings_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        TaskSettings(**options).rule()


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


def test_metrics_refuse_bad_records():
    with pytest.raises(ValueError, match="times must be 2 increasing numbers"):
        mean_assistance(np.zeros((2, 3)), [1.0, 1.0])
    with pytest.raises(ValueError, match="row 1 is not"):
        trajectory_length([[0, 0, 0], [0, np.nan, 0]])
    with pytest.raises(ValueError, match=r"items must have shape \(n, 3\)"):
        placement_error([0.0], [0.0])

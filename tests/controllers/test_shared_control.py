"""Equations (1)-(8), the state machines of Figs. 4 and 5, their errata and bad input."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.controllers import AssistAsNeeded, FixedAssistance, GoalSelection
from soro_lib.controllers.shared_control import PARADIGMS, Paradigm, desired_position
from soro_lib.controllers.shared_control.assist_as_needed import (
    ASSIST_START,
    COUNTERS,
    REACHED,
    STEADY,
    assist_step,
)
from soro_lib.controllers.shared_control.guidance import damped_magnitude, guidance_force, hooke_magnitude

ITEMS = [[-0.095, 0.117, 0.645], [-0.103, -0.175, 0.645]]
TARGETS = [[0.4, -0.17, 0.643], [0.4, 0.11, 0.643]]
GOAL = (0.0, 0.0, 0.6)

coordinate = st.floats(-1.0, 1.0)
point = st.tuples(coordinate, coordinate, coordinate)
share = st.floats(0.0, 1.0)


def drive(assistance, distances, **options):
    """Update with tips straight above the goal at the given distances."""
    return [assistance.update((0.0, 0.0, 0.6 - m), GOAL, **options) for m in distances]


# --- Paradigms --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("paradigm", "expected"),
    [
        ("full_teleoperation", (1.0, 2.0, 3.0)),
        ("assist_as_needed", (1.0, 2.0, 3.0)),
        ("fixed_assistance", (1.0, 2.0, 3.0)),
        ("msae", (1.0, 2.0, 30.0)),
        ("asme", (10.0, 20.0, 3.0)),
        ("mostly_autonomous", (10.0, 20.0, 30.0)),
    ],
)
def test_paradigms_take_their_axes_from_command_or_goal(paradigm, expected):
    automation = PARADIGMS[paradigm].automation
    assert desired_position((1.0, 2.0, 3.0), (10.0, 20.0, 30.0), automation) == expected


@given(point, point, st.tuples(share, share, share))
def test_blend_stays_between_command_and_goal(command, goal, automation):
    blend = np.array(desired_position(command, goal, automation))
    low, high = np.minimum(command, goal), np.maximum(command, goal)
    assert np.all(blend >= low - 1e-12)
    assert np.all(blend <= high + 1e-12)


def test_only_automatic_eversion_lifts():
    assert [name for name, paradigm in PARADIGMS.items() if paradigm.lifts] == ["msae", "mostly_autonomous"]


def test_shares_outside_the_unit_interval_are_refused():
    with pytest.raises(ValueError, match=r"automation must be in \[0, 1\], got 1.5 at index \(1,\)"):
        Paradigm("mine", (0.0, 1.5, 0.0))
    with pytest.raises(ValueError, match="assistance must be one of"):
        Paradigm("mine", (0.0, 0.0, 0.0), "sometimes")


# --- Forces -----------------------------------------------------------------------------------------


@given(point, point, st.floats(0.0, 100.0))
def test_force_points_to_the_goal_with_its_magnitude_and_never_exceeds_the_bound(tip, goal, stiffness):
    offset = np.subtract(goal, tip)
    distance = float(np.linalg.norm(offset))
    magnitude = hooke_magnitude(stiffness, distance, 7.0)
    force = np.array(guidance_force(magnitude, tip, goal, True))
    assert np.linalg.norm(force) <= 7.0 + 1e-12
    if distance > 1e-9:
        np.testing.assert_allclose(force, magnitude * offset / distance, atol=1e-12)


def test_zero_distance_gives_zero_force():
    for law in (True, False):
        assert AssistAsNeeded(unit_direction=law).update(GOAL, GOAL).force.tolist() == [0.0, 0.0, 0.0]
        assert FixedAssistance(unit_direction=law).update(GOAL, GOAL).force.tolist() == [0.0, 0.0, 0.0]


def test_unnormalised_direction_of_the_program_scales_the_force_with_the_distance():
    tip, goal = (0.0, 0.0, 0.1), (0.0, 0.3, 0.5)
    unit = np.array(guidance_force(7.0, tip, goal, True))
    program = np.array(guidance_force(7.0, tip, goal, False))
    np.testing.assert_allclose(program, 0.5 * unit)
    with np.errstate(invalid="ignore"):  # printed: 0 / 0 at the goal
        assert np.all(np.isnan(np.zeros(3) / np.float64(0.0)))


def test_damper_weakens_an_approach_and_never_repels():
    approaching = damped_magnitude(10.0, 0.1, 0.5, -0.3, 7.0)
    assert approaching == pytest.approx(10 * 0.5 - 0.1 * 0.3)
    assert damped_magnitude(10.0, 0.1, 0.001, -0.3, 7.0) == 0.0
    # The printed b |velocity| pushes harder the faster the tip approaches: it adds energy.
    speed, dt, stiffness, damping = 0.3, 0.01, 10.0, 0.1
    printed_power = (stiffness * 0.5 + damping * speed) * speed
    corrected_power = (stiffness * 0.5 - damping * speed) * speed
    spring_power = stiffness * 0.5 * speed
    assert printed_power * dt > spring_power * dt > corrected_power * dt


def test_fixed_assistance_is_a_constant_spring_after_the_filter_has_filled():
    assistance = FixedAssistance()
    results = drive(assistance, [0.4] * 60)
    magnitudes = [result.magnitude for result in results]
    np.testing.assert_allclose(magnitudes[:50], 4.0 * np.arange(1, 51) / 50)
    np.testing.assert_allclose(magnitudes[50:], 4.0)
    assert {result.stiffness for result in results} == {10.0}
    np.testing.assert_allclose(results[-1].force, [0.0, 0.0, 4.0])


def test_moving_average_is_the_mean_of_the_last_fifty():
    rng = np.random.default_rng(1)
    distances = rng.uniform(0.05, 0.6, 200)
    assistance = FixedAssistance(damping=0.0)
    ours = [result.magnitude for result in drive(assistance, distances)]
    padded = np.concatenate([np.zeros(49), 10.0 * distances])
    np.testing.assert_allclose(ours, np.convolve(padded, np.full(50, 1 / 50), "valid"), rtol=1e-12)


# --- Assist as needed -------------------------------------------------------------------------------


def test_stiffness_waits_for_the_reaction_time_then_climbs_to_its_bound():
    results = drive(AssistAsNeeded(), [0.5] * 500)
    stiffness = np.array([result.stiffness for result in results])
    assert results[0].state == "start"
    assert results[1].state == "steady"
    assert np.all(stiffness[:101] == 0)  # entry plus 100 samples at 100 Hz
    np.testing.assert_allclose(np.diff(stiffness[100:350]), 0.2, rtol=1e-9)
    assert stiffness.max() == 50.0
    assert np.all(stiffness[352:] == 50.0)


def test_printed_condition_would_assist_at_once_and_then_freeze():
    """Eq. (3) prints tau < xi: on a resting tip the stiffness would climb at once, by Delta xi, for ever."""
    step, delay = 0.2, 100
    printed = [0.0]
    for tau in range(1000):
        printed.append(min(printed[-1] + (step if tau < delay else 0.0), 50.0))
    assert printed[1] > 0
    assert printed[-1] == pytest.approx(step * delay)
    ours = [result.stiffness for result in drive(AssistAsNeeded(), [0.5] * 1000)]
    assert ours[50] == 0.0
    assert ours[-1] == 50.0


def test_stiffness_falls_late_while_approaching_and_at_once_at_the_goal():
    assistance = AssistAsNeeded()
    drive(assistance, [0.5] * 500)
    closer = drive(assistance, 0.5 - 0.001 * np.arange(1, 402))
    stiffness = np.array([result.stiffness for result in closer])
    assert {result.state for result in closer} == {"closer"}
    assert np.all(stiffness[:300] == 50.0)
    assert np.all(np.diff(stiffness[300:]) < 0)
    there = drive(assistance, [0.02] * 2)
    assert there[0].state == "reached"
    assert there[0].stiffness == pytest.approx(stiffness[-1] - 0.2)


def test_exact_equality_of_the_printed_cases_never_fires():
    """Printed: reached is m = 0, steady is dm/dt = 0; a hovering hand meets neither, but the thresholds."""
    rng = np.random.default_rng(3)
    distances = 0.02 + 0.00001 * rng.standard_normal(200)
    assert not np.any(distances == 0)
    assert not np.any(np.diff(distances) == 0)
    assert {result.state for result in drive(AssistAsNeeded(), distances)[1:]} == {"reached"}
    assert {result.state for result in drive(AssistAsNeeded(), distances + 0.4)[1:]} == {"steady"}


def test_reached_comes_before_the_cases_it_overlaps():
    """At m = 0 at rest the first two printed cases both hold; the stiffness must fall, not climb."""
    assistance = AssistAsNeeded()
    drive(assistance, [0.5] * 400)
    results = drive(assistance, [0.0] * 300)
    assert results[-1].stiffness == 0.0
    assert results[-1].state == "reached"


def steady_then_away(counter):
    assistance = AssistAsNeeded(counter=counter, steady_delay=3.0, away_delay=1.0)
    drive(assistance, [0.3] * 150)
    return drive(assistance, 0.3 + 0.001 * np.arange(1, 111))


def test_the_printed_readings_of_the_counter_differ():
    text = [result.stiffness for result in steady_then_away("text")]
    caption = [result.stiffness for result in steady_then_away("caption")]
    assert caption[0] > 0  # 1.5 s steady count for the 1 s of moving away
    assert np.all(np.array(text[:100]) == 0)
    assert text[-1] > 0


ARMED = -1
PROGRAM = {  # previous state: state taken up: what happens to the counter, and the delay that limits it
    "init": {
        "steady": ("reset", "steady"),
        "away": ("reset", "away"),
        "closer": ("reset", "closer"),
        "reached": ("arm", None),
    },
    "steady": {
        "steady": ("go on", "steady"),
        "away": ("go on", "away"),
        "closer": ("reset", "closer"),
        "reached": ("keep", None),
    },
    "away": {
        "steady": ("go on", "away"),
        "away": ("go on", "away"),
        "closer": ("reset", "closer"),
        "reached": ("arm", None),
    },
    "closer": {
        "steady": ("reset", "steady"),
        "away": ("reset", "away"),
        "closer": ("go on", "closer"),
        "reached": ("arm", None),
    },
    "reached": {
        "steady": ("reset", "steady"),
        "away": ("reset", "away"),
        "closer": ("reset", "closer"),
        "reached": ("arm", None),
    },
}


def programmed_stiffness(distances, limits, step=0.2, maximum=50.0, near=0.03):
    """The authors' machine from its transition table: an integer counter, armed once past its limit."""
    stiffness, counter, previous = [0.0], 0, "init"
    for last, distance in pairwise(distances):
        change = distance - last
        state = "closer" if change < -1e-4 else "away" if change > 1e-4 else "steady"
        state = "reached" if distance <= near else state
        action, delay = PROGRAM[previous][state]
        if action == "arm":
            counter = ARMED
        elif action != "keep":
            counter = 0 if action == "reset" else counter
            if counter != ARMED:
                counter = counter + 1 if counter < limits[delay] else ARMED
        move = {"steady": step, "away": step, "closer": -step, "reached": -step}[state]
        stiffness.append(min(max(stiffness[-1] + (move if counter == ARMED else 0.0), 0.0), maximum))
        previous = state
    return stiffness


def hand(spells):
    """Distances from spells of (samples, change per sample); no value lies on a threshold."""
    distances = [0.0332]
    for count, change in spells:
        for _ in range(count):
            distances.append(max(distances[-1] + change, 0.0202))
    return distances


def steps(counter, distances, steady, closer, away):
    """States of the machine, one per distance; one sample a second, so that delays are whole numbers."""
    rule = AssistAsNeeded(
        counter=counter,
        steady_delay=steady,
        approach_delay=closer,
        away_delay=away,
        stiffness_rate=0.2,
        steady_speed=1e-4,
        sample_rate=1.0,
    ).rule
    state, states = ASSIST_START, []
    for distance in distances:
        state = assist_step(rule, state, distance, 1.0)
        states.append(state)
    return states


hands = st.lists(
    st.tuples(st.integers(1, 15), st.sampled_from([-4e-4, 0.0, 4e-4])), min_size=3, max_size=40
).map(hand)
delay = st.integers(0, 25)


@settings(max_examples=200)
@given(hands, delay, delay, delay)
def test_the_program_reading_is_the_authors_machine(distances, steady, closer, away):
    ours = [state.stiffness for state in steps("program", distances, steady, closer, away)]
    limits = {"steady": steady, "closer": closer, "away": away}
    np.testing.assert_allclose(ours, programmed_stiffness(distances, limits), atol=1e-9)


def escaped_then_steady(counter):
    """A hand that drifts off for 1.11 s and then rests; the delays and gains of Table 2."""
    assistance = AssistAsNeeded(
        counter=counter,
        steady_delay=3.0,
        approach_delay=1.0,
        away_delay=1.0,
        maximum_stiffness=100.0,
        stiffness_rate=50.0,
    )
    distances = 0.3 + 0.001 * np.minimum(np.arange(300), 111)
    return distances, np.array([result.stiffness for result in drive(assistance, distances)])


def test_an_armed_counter_of_the_program_outlives_the_escape():
    """The caption alone has the resting hand wait for xi_S = 3 s; the program pushes it on."""
    distances, program = escaped_then_steady("program")
    _, caption = escaped_then_steady("caption")
    machine = programmed_stiffness(
        distances, {"steady": 300, "closer": 100, "away": 100}, step=0.5, maximum=100.0
    )
    np.testing.assert_allclose(program, machine, atol=1e-9)
    np.testing.assert_array_equal(caption[:112], program[:112])
    assert np.all(caption[112:] == caption[111])
    assert np.max(program - caption) == pytest.approx(94.0)


@settings(max_examples=200)
@given(hands, delay, delay)
def test_equal_delays_leave_the_program_the_caption_but_for_early_arrivals(distances, poor, closer):
    """With xi_S = xi_A only whoever comes to the goal from rest, before xi_S has passed, feels a difference:
    the stiffness falls one sample later."""
    caption = steps("caption", distances, poor, closer, poor)
    program = steps("program", distances, poor, closer, poor)
    early = [
        before.motion == STEADY and now.motion == REACHED and before.elapsed < poor
        for before, now in pairwise(caption)
    ]
    gaps = np.subtract(*([state.stiffness for state in states] for states in (program, caption)))
    assert np.all(gaps >= -1e-9)
    assert np.all(gaps[1:] <= 0.2 * np.cumsum(early) + 1e-9)


def test_an_early_arrival_keeps_the_stiffness_for_one_sample():
    """Built up at rest, then a step toward the goal, a rest too short for xi_S, and the goal."""
    distances = [0.0362] * 20 + [0.0308] * 3 + [0.0292] * 5
    caption, program = (
        np.array([state.stiffness for state in steps(counter, distances, 10, 10, 10)])
        for counter in ("caption", "program")
    )
    np.testing.assert_array_equal(caption[:23], program[:23])
    np.testing.assert_allclose(program[24:], caption[23:-1], atol=1e-9)
    assert program[23] == program[22] > caption[23]


@pytest.mark.parametrize("counter", ["text", "caption", "program"])
def test_a_spell_of_approach_resets_the_counter_in_every_reading(counter):
    assistance = AssistAsNeeded(counter=counter)
    drive(assistance, [0.3] * 90)
    drive(assistance, [0.298])
    assert drive(assistance, [0.298] * 100)[-1].stiffness == 0.0
    assert drive(assistance, [0.298] * 2)[-1].stiffness > 0.0


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=200), st.sampled_from(COUNTERS))
def test_stiffness_stays_in_bounds_and_moves_at_most_one_step(distances, counter):
    assistance = AssistAsNeeded(
        counter=counter, steady_delay=0.02, away_delay=0.0, approach_delay=0.05, stiffness_rate=2000.0
    )
    stiffness = np.array([0.0] + [result.stiffness for result in drive(assistance, distances)])
    assert np.all((stiffness >= 0) & (stiffness <= 50.0))
    assert np.all(np.abs(np.diff(stiffness)) <= 20.0 + 1e-9)


def test_delta_is_a_rate():
    """20 N/m per sample would fill 50 N/m in 0.03 s; Table 3 read as N/m per second takes 2.5 s."""
    results = drive(AssistAsNeeded(), [0.5] * 400)
    climbing = [result.stiffness for result in results if 0 < result.stiffness < 50.0]
    assert len(climbing) == pytest.approx(250, abs=2)


def test_irregular_samples_do_not_change_the_law():
    regular, irregular = AssistAsNeeded(), AssistAsNeeded()
    slow = drive(regular, [0.5] * 301)[-1]
    irregular.update((0.0, 0.0, 0.1), GOAL)
    for elapsed in [0.005, 0.02, 0.03, 0.005] * 50:
        fast = irregular.update((0.0, 0.0, 0.1), GOAL, elapsed=elapsed)
    assert fast.stiffness == pytest.approx(slow.stiffness, abs=0.5)


def test_factors_of_the_tuning_study_are_confounded():
    """With k_MAX = 50 N/m the force reaches 3 N at 60 mm: f_MAX, not k_MAX, rules most of the way."""
    assert hooke_magnitude(50.0, 0.06, 3.0) == 3.0
    assert hooke_magnitude(50.0, 0.14, 7.0) == pytest.approx(7.0)
    distances = np.linspace(0.03, 0.57, 100)
    for bound, share in ((3.0, 0.9), (7.0, 0.75)):
        forces = [[hooke_magnitude(k, m, bound) for m in distances] for k in (50.0, 100.0)]
        assert np.mean(np.isclose(*forces)) > share


# --- Goal selection ---------------------------------------------------------------------------------


def test_goals_follow_item_target_item_target():
    machine = GoalSelection(ITEMS, TARGETS, lift=False)
    tip = (0.0, 0.0, 0.5)
    visited = [machine.update(tip, held) for held in (False, True, True, False, True, False)]
    assert [result.phase for result in visited] == [
        *("grasping", "placing", "placing", "grasping", "placing", "end"),
    ]
    for result, expected in zip(visited, [ITEMS[0], TARGETS[0], TARGETS[0], ITEMS[1], TARGETS[1], tip]):
        np.testing.assert_array_equal(result.goal, expected)


def test_lifting_goal_retracts_along_the_body():
    machine = GoalSelection(ITEMS, TARGETS)
    machine.update(ITEMS[0], False)
    result = machine.update(ITEMS[0], True)
    assert result.phase == "lifting with item"
    assert result.goal[2] == pytest.approx(0.645 - 0.15)
    np.testing.assert_allclose(np.cross(result.goal, ITEMS[0]), 0.0, atol=1e-12)
    assert machine.update((-0.08, 0.1, 0.551), True).phase == "lifting with item"
    assert machine.update((-0.08, 0.1, 0.55), True).phase == "placing"
    assert machine.update(TARGETS[0], False).phase == "lifting empty"
    assert machine.update((0.3, -0.1, 0.5), False).phase == "grasping"


def lifted_in_finite_time(printed, depth):
    """Whether a tip that follows its goal with a lag leaves the lifting phase within a minute."""
    machine = GoalSelection([[0.1, 0.1, depth]], [[0.3, 0.1, depth]], reach=2.0, printed=printed)
    tip = np.array([0.1, 0.1, depth])
    machine.update(tip, False)
    for _ in range(6000):
        result = machine.update(tip, True)
        if result.phase == "placing":
            return True
        tip += 0.01 * (result.goal - tip)
    return False


def test_printed_lift_deadlocks_at_the_papers_table_height():
    """The proxy 150 mm above a tip at 700 mm lies at the very 550 mm that must be passed."""
    assert lifted_in_finite_time(printed=True, depth=0.645)
    assert not lifted_in_finite_time(printed=True, depth=0.705)
    assert lifted_in_finite_time(printed=False, depth=0.705)


def lose_item_while_lifting(printed):
    machine = GoalSelection(ITEMS, TARGETS, printed=printed)
    machine.update(ITEMS[0], False)
    machine.update(ITEMS[0], True)
    return [machine.update(tip, False) for tip in ((-0.09, 0.11, 0.6), (-0.08, 0.1, 0.54), (-0.08, 0.1, 0.5))]


def test_an_item_lost_while_lifted_is_fetched_again():
    """The printed machine lifts on empty and takes that for a delivery; item 1 is never placed."""
    printed = lose_item_while_lifting(True)
    assert [result.phase for result in printed] == ["lifting with item", "grasping", "grasping"]
    assert printed[-1].item == 1
    mended = lose_item_while_lifting(False)
    assert {result.phase for result in mended} == {"grasping"}
    assert {result.item for result in mended} == {0}
    np.testing.assert_allclose(mended[0].goal, [-0.09, 0.11, 0.645])


@given(st.lists(st.tuples(point, st.booleans()), max_size=60), st.booleans(), st.booleans())
def test_machine_survives_any_input_and_never_goes_back(inputs, lift, printed):
    machine = GoalSelection(ITEMS, TARGETS, lift=lift, printed=printed)
    items = [machine.update(tip, held).item for tip, held in inputs]
    assert items == sorted(items)
    assert np.all(np.isfinite(machine.state.goal))


# --- Bad input --------------------------------------------------------------------------------------


@pytest.mark.parametrize("controller", [AssistAsNeeded, FixedAssistance])
def test_nan_from_the_device_is_refused_and_leaves_the_state(controller):
    assistance = controller()
    drive(assistance, [0.5] * 200)
    before = assistance.state
    with pytest.raises(ValueError, match=r"end_effector must be finite, got nan at index \(1,\)"):
        assistance.update((0.0, math.nan, 0.5), GOAL)
    with pytest.raises(ValueError, match=r"goal must have shape \(3,\), got \(2,\)"):
        assistance.update(GOAL, (0.0, 1.0))
    with pytest.raises(ValueError, match=r"elapsed must be a finite number above 0, got 0.0"):
        assistance.update(GOAL, GOAL, elapsed=0.0)
    assert assistance.state == before


@pytest.mark.parametrize(
    ("controller", "name", "value"),
    [
        (AssistAsNeeded, "maximum_force", 0.0),
        (AssistAsNeeded, "maximum_stiffness", -1.0),
        (AssistAsNeeded, "stiffness_rate", 0.0),
        (AssistAsNeeded, "near_distance", -0.01),
        (AssistAsNeeded, "steady_delay", math.inf),
        (AssistAsNeeded, "sample_rate", math.nan),
        (FixedAssistance, "stiffness", 0.0),
        (FixedAssistance, "damping", -0.1),
        (FixedAssistance, "window", 0),
        (FixedAssistance, "window", 2.5),
    ],
)
def test_bad_parameters_are_named(controller, name, value):
    with pytest.raises(ValueError, match=name):
        controller(**{name: value})


def test_unknown_counter_is_refused():
    with pytest.raises(ValueError, match="counter must be one of 'text', 'caption', 'program'; got 'figure'"):
        AssistAsNeeded(counter="figure")


@pytest.mark.parametrize(
    ("items", "targets", "options", "message"),
    [
        ([[0, 0, 2.0]], [[0, 0, 0.6]], {}, r"items\[0\] is out of reach: 2.000 m from the base, bound 1.5 m"),
        ([[0, 0, 0.6]], [[0, 0, -0.1]], {}, r"targets\[0\] must lie below the base"),
        ([[0, 0, math.nan]], [[0, 0, 0.6]], {}, r"items must be finite, got nan at index \(0, 2\)"),
        ([], [], {}, r"items must have shape \(n, 3\)"),
        (ITEMS, TARGETS[:1], {}, "items and targets must be as many"),
        (ITEMS, TARGETS, {"lifted_height": 0.7}, "lifted_height = 0.7 m must be above every goal"),
        (ITEMS, TARGETS, {"lift_offset": 0.0}, "lift_offset"),
    ],
)
def test_bad_goals_are_named(items, targets, options, message):
    with pytest.raises(ValueError, match=message):
        GoalSelection(items, targets, **options)

"""The gate: what is believed of a tracker, and why not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from soro_lib.controllers.hand_gate import GateSettings, HandGate
from soro_lib.controllers.hand_mapping import PalmMapping
from soro_lib.sensing.hand_tracking import HandSample

PERIOD = 0.0087
FLAT = HandSample(0.0, 1, (0.0, 0.2, 0.0), (0.0, -1.0, 0.0), (True,) * 5, (0.1, 0.0, 0.0), 1.0)
UPSIDE_DOWN = (0.0, 1.0, 0.0)


def tracked(frames=10, **changes):
    """Return a gate that has seen some sound frames, and what it makes of one more."""
    gate = HandGate(PalmMapping())
    for index in range(frames):
        gate.update(replace(FLAT, time=index * PERIOD))
    return gate, gate.update(replace(FLAT, time=frames * PERIOD, **changes))


def test_sound_frame_passes():
    _, hand = tracked()
    assert hand.valid
    assert not hand.restart
    assert hand.palm == FLAT.palm
    assert hand.velocity == FLAT.velocity


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"hand_id": None}, "no hand"),
        ({"palm": (math.nan, 0.2, 0.0)}, "palm or normal is not finite"),
        ({"normal": (math.inf, 0.0, 0.0)}, "palm or normal is not finite"),
        ({"normal": (0.0, -0.5, 0.0)}, "palm normal has length 0.5"),
        ({"normal": (0.0, -1.2, 0.0)}, "palm normal has length 1.2"),
        ({"palm": (0.0, 0.05, 0.0)}, "palm is outside the allowed box"),
        ({"palm": (0.2, 0.2, 0.0)}, "palm is outside the allowed box"),
    ],
)
def test_unsound_frames_are_named(changes, reason):
    _, hand = tracked(**changes)
    assert not hand.valid
    assert hand.reason == reason


@pytest.mark.parametrize(
    ("time", "reason"), [(0.01, "time did not advance"), (math.nan, "time stamp is not finite")]
)
def test_the_clock_must_advance(time, reason):
    gate, _ = tracked()
    assert gate.update(replace(FLAT, time=time)).reason == reason
    assert gate.update(replace(FLAT, time=11 * PERIOD)).valid


def test_nearly_unit_normals_are_renormalised():
    _, hand = tracked(normal=(0.0, -1.05, 0.0))
    assert hand.normal == pytest.approx((0.0, -1.0, 0.0))


def test_a_new_identity_starts_anew():
    _, hand = tracked(hand_id=2)
    assert hand.valid
    assert hand.restart
    assert hand.velocity is None


def test_a_second_hand_is_ignored_until_the_first_has_been_gone_for_a_moment():
    gate, hand = tracked(hand_id=2, palm=(0.08, 0.2, 0.0))
    assert hand.reason == "another hand"
    assert gate.update(replace(FLAT, time=11 * PERIOD)).valid
    for index in range(12, 17):
        hand = gate.update(replace(FLAT, time=index * PERIOD, hand_id=2, palm=(0.08, 0.2, 0.0)))
        assert hand.reason == "another hand"
    hand = gate.update(replace(FLAT, time=17 * PERIOD, hand_id=2, palm=(0.08, 0.2, 0.0)))
    assert hand.valid
    assert hand.restart


def test_a_long_pause_starts_anew():
    gate, _ = tracked()
    assert not gate.update(replace(FLAT, time=10 * PERIOD + 0.19)).restart
    assert gate.update(replace(FLAT, time=10 * PERIOD + 0.40)).restart


def test_a_long_stay_outside_the_box_starts_anew():
    gate, _ = tracked()
    for index in range(40):
        gate.update(replace(FLAT, time=(11 + index) * PERIOD, palm=(0.0, 0.05, 0.0)))
    assert gate.update(replace(FLAT, time=60 * PERIOD)).restart


def test_velocity_of_the_first_frames_is_not_believed():
    gate = HandGate(PalmMapping())
    believed = [gate.update(replace(FLAT, time=index * PERIOD)).velocity is not None for index in range(4)]
    assert believed == [False, False, True, True]


def test_a_flip_is_not_believed_at_once():
    gate, hand = tracked(normal=UPSIDE_DOWN)
    assert hand.normal == FLAT.normal
    normals = [
        gate.update(replace(FLAT, time=(11 + i) * PERIOD, normal=UPSIDE_DOWN)).normal for i in range(5)
    ]
    assert normals == [FLAT.normal] * 3 + [UPSIDE_DOWN] * 2


def test_scattered_flips_are_never_believed():
    gate = HandGate(PalmMapping())
    for index in range(200):
        normal = UPSIDE_DOWN if index % 3 == 1 else FLAT.normal
        assert gate.update(replace(FLAT, time=index * PERIOD, normal=normal)).normal == FLAT.normal


def test_random_flips_in_random_directions_are_never_believed():
    rng, gate = np.random.default_rng(0), HandGate(PalmMapping())
    gate.update(FLAT)
    for index in range(1, 50):
        vector = rng.normal(size=3)
        vector[1] = abs(vector[1]) + 2.0 if index % 2 else -3.0
        normal = tuple(vector / np.linalg.norm(vector))
        found = gate.update(replace(FLAT, time=index * PERIOD, normal=normal)).normal
        assert found[1] < 0


@pytest.mark.parametrize(
    "name", ["largest_turn", "flip_frames", "largest_jump", "reset_after", "velocity_after"]
)
def test_bad_settings_are_named(name):
    with pytest.raises(ValueError, match=rf"GateSettings\.{name}"):
        GateSettings(**{name: 0})

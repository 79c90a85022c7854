"""How the operator moves: single submovements of an intention, followed by a compliant hand."""

import math
from typing import NamedTuple

import numpy as np

from soro_lib.jit import inlined
from soro_lib.papers.shared_control.world import vectors
from soro_lib.papers.shared_control.world.people import DEVICE_SCALE, SAMPLE_TIME, Operator, Vector

HAND_STEPS = 4
"""Steps of the hand's mechanics per period (400 Hz)."""

WANDER_TIME = 0.5
"""Correlation time of the slow drift of a held hand [s]."""

TREMOR_FREQUENCY = 9.3
"""Physiological tremor [Hz]; textbooks give 8 to 12 Hz."""


class Movement(NamedTuple):
    """A submovement of the hand: amplitude [m], start and duration [s]; the intended position [m]."""

    change: Vector
    start: float
    duration: float
    intention: Vector


class Hand(NamedTuple):
    """Position [m] and velocity [m/s] of the hand on the device, and its slow drift [m]."""

    position: Vector
    velocity: Vector
    drift: Vector


@inlined
def minimum_jerk(share: float) -> float:
    """Position along a minimum-jerk movement, 0 to 1, at a share of its duration (Flash and Hogan 1985)."""
    s = min(max(share, 0.0), 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)


@inlined
def plan_submovement(
    rule: Operator, movement: Movement, error: Vector, time: float, rng: np.random.Generator
) -> Movement:
    """Start a submovement that covers part of the seen error, turned and scaled by what is misjudged."""
    sine, cosine = math.sin(rule.mapping_angle), math.cos(rule.mapping_angle)
    gain = rule.primary_gain * (1.0 - rule.passivity) / rule.gain_factor
    x = gain * (cosine * error[0] - sine * error[1]) / DEVICE_SCALE[0]
    y = gain * (sine * error[0] + cosine * error[1]) / DEVICE_SCALE[1]
    z = gain * error[2] / DEVICE_SCALE[2]
    length = vectors.size((x, y, z))
    change = vectors.scattered((x, y, z), rule.motor_noise * length, rng)
    duration = rule.submovement_time + 0.1 * math.log2(1.0 + length / 0.005)
    return Movement(change, time, duration, movement.intention)


@inlined
def intend(rule: Operator, movement: Movement, hand: Hand, time: float) -> Movement:
    """Advance the intended position along the submovement; a yielding operator lets it drift to the hand."""
    now = minimum_jerk((time - movement.start) / movement.duration)
    before = minimum_jerk((time - SAMPLE_TIME - movement.start) / movement.duration)
    intention = vectors.moved(movement.intention, now - before, movement.change)
    give = vectors.difference(hand.position, movement.intention)
    intention = vectors.moved(intention, SAMPLE_TIME / rule.yield_time, give)
    return Movement(movement.change, movement.start, movement.duration, intention)


@inlined
def pull_axis(rule: Operator, position: float, velocity: float, aim: float, force: float) -> Vector:
    """One period of the hand's mass, damper and spring along one axis: position, velocity, 0."""
    step = SAMPLE_TIME / HAND_STEPS
    share = step / rule.hand_mass
    for _ in range(HAND_STEPS):
        pull = force - rule.hand_damping * velocity - rule.hand_stiffness * (position - aim)
        velocity += share * pull
        position += step * velocity
    return (position, velocity, 0.0)


@inlined
def hand_step(
    rule: Operator, hand: Hand, intention: Vector, force: Vector, time: float, rng: np.random.Generator
) -> Hand:
    """One period of the compliant hand: it follows the intention, drifts, trembles and gives to the force."""
    keep = 1.0 - SAMPLE_TIME / WANDER_TIME
    fresh = rule.wander * math.sqrt(1.0 - keep * keep)
    drift = vectors.scattered(vectors.scaled(keep, hand.drift), fresh, rng)
    tremor = rule.tremor * math.sin(2.0 * math.pi * TREMOR_FREQUENCY * time)
    pull = vectors.after_friction(force, rule.device_friction)
    x = pull_axis(rule, hand.position[0], hand.velocity[0], intention[0] + drift[0] + tremor, pull[0])
    y = pull_axis(rule, hand.position[1], hand.velocity[1], intention[1] + drift[1] + tremor, pull[1])
    z = pull_axis(rule, hand.position[2], hand.velocity[2], intention[2] + drift[2] + tremor, pull[2])
    return Hand((x[0], y[0], z[0]), (x[1], y[1], z[1]), drift)


@inlined
def hand_command(hand: Hand) -> Vector:
    """Position commanded by the device [m]."""
    return vectors.product(DEVICE_SCALE, hand.position)

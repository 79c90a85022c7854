"""What the operator believes about the goal: errors across and along the line of sight."""

import math
from typing import NamedTuple

import numpy as np

from soro_lib.jit import inlined
from soro_lib.papers.shared_control.world.people import Operator, Vector
from soro_lib.papers.shared_control.world.vectors import ZERO

BELIEF_CORRELATION = 0.6
"""Correlation of the depth error between consecutive goals [-]."""


class Belief(NamedTuple):
    """Errors along the screen's right and up and along depth, last glance, shift by the force [m]."""

    right: float
    up: float
    depth: float
    glance: float
    shift: Vector


@inlined
def new_belief(rule: Operator, old: Belief, rng: np.random.Generator) -> Belief:
    """Fresh look at a new goal; the depth error is correlated with that of the last one."""
    fresh = math.sqrt(1.0 - BELIEF_CORRELATION**2) * rule.depth_error
    half = rule.lateral_error / 2.0
    return Belief(
        right=half * rng.standard_normal(),
        up=half * rng.standard_normal(),
        depth=BELIEF_CORRELATION * old.depth + fresh * rng.standard_normal(),
        glance=0.0,
        shift=ZERO,
    )


@inlined
def scaled_belief(belief: Belief, factor: float) -> Belief:
    """The belief after a failed grasp: part of the error is gone."""
    return Belief(
        factor * belief.right, factor * belief.up, factor * belief.depth, belief.glance, belief.shift
    )


@inlined
def belief_error(rule: Operator, belief: Belief, automation: Vector) -> Vector:
    """Error of the believed goal [m].

    The line of sight lies in the x-z plane. With both axes in his hands the operator suffers the depth error
    along it. Where the machine holds one of them right, what he sees on the screen fixes the other, up to
    the screen error divided by the sine or cosine of the elevation. What the machine steers he leaves alone.
    """
    sine, cosine = math.sin(rule.view_elevation), math.cos(rule.view_elevation)
    depth = belief.depth + belief.glance
    free_x = depth * cosine - belief.up * sine
    free_z = depth * sine + belief.up * cosine
    manual_x, manual_y, manual_z = 1.0 - automation[0], 1.0 - automation[1], 1.0 - automation[2]
    return (
        manual_x * (manual_z * free_x - automation[2] * belief.up / sine),
        manual_y * belief.right,
        manual_z * (manual_x * free_z + automation[0] * belief.up / cosine),
    )

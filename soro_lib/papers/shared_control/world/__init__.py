"""Simulated humans at the controls: what they believe, decide and do, and how their hand yields to a force.

An operator sees a delayed picture and misjudges depth along the line of sight; corrects in single
submovements with a refractory pause; holds the device with a compliant hand; and presses the button when the
tip has looked right for a while. The attitude to a guidance force is an open factor: ignore it, use it as a
cue, or yield.

The rules are functions of plain numbers, compiled by the simulator. Lengths are metres at the tip unless
called hand; base frame of the robot, z down; one call per 10 ms.
"""

from soro_lib.papers.shared_control.world.people import (
    ATTITUDES,
    EXPERT,
    NAIVE,
    POPULATIONS,
    Operator,
    Population,
)

__all__ = ["ATTITUDES", "EXPERT", "NAIVE", "POPULATIONS", "Operator", "Population"]

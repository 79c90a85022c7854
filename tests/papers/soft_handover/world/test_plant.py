"""Plants K and E, the motors and the gripper."""

import numpy as np
import pytest
from scipy.optimize import minimize

from soro_lib.papers.soft_handover.world.plant import (
    AngleLossPlant,
    ElasticPlant,
    Gripper,
    Hand,
    LaggingPlant,
    Stiffness,
)
from soro_lib.robots import HelixArm

ARM = HelixArm()
BENT = np.array([0.3, -0.2, 0.11, 0.5, 0.4, 0.22, -0.6, 0.1, 0.24])


def elastic_energy(plant, q, tendons, steps=3):
    """The energy of plant E written out with the batched kinematics, independent of the compiled one."""
    from soro_lib.arcs import chain_transform

    lengths = np.asarray(ARM.rest_lengths)
    segments = q.reshape(3, 3)
    bends = np.hypot(segments[:, 0], segments[:, 1])
    energy = np.sum(plant.stiffness.bending / lengths * bends**2 / 2)
    energy += np.sum(
        plant.stiffness.axial / lengths * (segments[:, 2] - plant.free_length * lengths) ** 2 / 2
    )
    stretch = np.maximum(ARM.tendon_lengths(q) - tendons, 0)
    energy += plant.tendon_stiffness * np.sum(stretch**2) / 2
    for i in range(3):
        for j in range(steps):
            part = np.concatenate([segments[:i], (j + 0.5) / steps * segments[i : i + 1]])
            mass = plant.linear_density * lengths[i] / steps
            energy -= mass * 9.81 * chain_transform(part)[2, 3]
    wrist = chain_transform(segments)
    energy -= plant.gripper_mass * 9.81 * (wrist[2, 3] + plant.gripper_mass_distance * wrist[2, 2])
    return energy


@pytest.mark.parametrize("command", [ARM.home, BENT])
def test_elastic_arm_rests_where_its_energy_is_least(command):
    plant = ElasticPlant()
    tendons = ARM.tendon_lengths(command)
    state = plant.settle(tendons)
    found = minimize(
        lambda q: elastic_energy(plant, q, tendons),
        command,
        method="BFGS",
        options={"gtol": 1e-8, "maxiter": 2000},
    )
    np.testing.assert_allclose(state, found.x, atol=2e-5)


def test_elastic_arm_hangs_lower_than_calibrated_and_sags_when_bent():
    plant = ElasticPlant()
    droop = ARM.tip_points(plant.settle(ARM.tendon_lengths(ARM.home)))[5] - 0.7
    assert 0.003 < droop < 0.02
    sag = ARM.tip_points(plant.settle(ARM.tendon_lengths(BENT))) - ARM.tip_points(BENT)
    assert np.linalg.norm(sag[3:]) > 0.05
    assert sag[5] > 0


def test_slack_tendons_do_nothing():
    plant = ElasticPlant()
    loose = ARM.tendon_lengths(ARM.home) + 0.10
    np.testing.assert_allclose(plant.settle(loose), plant.settle(loose + 0.05), atol=1e-7)


def test_stiffer_tendons_sag_less_and_a_load_sags_more():
    tendons = ARM.tendon_lengths(BENT)

    def sag(plant, mass=0.0):
        plant.carry(mass)
        return np.linalg.norm(ARM.tip_points(plant.settle(tendons)) - ARM.tip_points(BENT))

    assert sag(ElasticPlant(tendon_stiffness=5000.0)) < sag(ElasticPlant()) < sag(ElasticPlant(), 0.05)


def test_angle_loss_plant_realises_its_shares_and_all_lengths():
    state = AngleLossPlant((0.4, 0.5, 0.6)).settle(ARM.tendon_lengths(BENT))
    np.testing.assert_allclose(
        state / BENT, np.repeat([0.4, 0.5, 0.6], 3) ** np.tile([1, 1, 0], 3), atol=1e-12
    )


def test_play_keeps_the_arm_until_it_is_taken_up():
    plant = AngleLossPlant((0.5, 0.5, 0.5), play=0.05)
    forth = plant.settle(ARM.tendon_lengths(BENT))
    back = plant.settle(ARM.tendon_lengths(BENT * np.tile([0.9, 0.9, 1.0], 3)))
    assert np.abs(forth - back).max() <= 0.05
    assert np.any(forth == back)


@pytest.mark.parametrize("plant", [AngleLossPlant((0.5, 0.5, 0.5)), ElasticPlant()])
def test_a_stiffer_hand_brings_the_gripper_closer_to_where_it_wants_it(plant):
    wanted = np.array([0.10, 0.0, 0.55, 0.10, 0.0, 0.65])
    tendons = ARM.tendon_lengths(ARM.home)
    misses = []
    for stiffness in (20.0, 200.0, 2000.0):
        plant.reset()
        misses.append(np.linalg.norm(ARM.tip_points(plant.settle(tendons, Hand(wanted, stiffness))) - wanted))
    assert misses[0] > misses[1] > misses[2]
    assert misses[2] < 0.03


def test_lagging_plant_covers_its_share_of_the_way():
    plant = LaggingPlant(AngleLossPlant((1.0, 1.0, 1.0)), timestep=0.5, time_constant=1.0)
    start = plant.settle(ARM.tendon_lengths(ARM.home))
    after = plant.settle(ARM.tendon_lengths(BENT))
    np.testing.assert_allclose(after, start + (1 - np.exp(-0.5)) * (BENT - start), atol=1e-12)


def test_gripper_holds_what_lies_between_its_fingers():
    points = np.array([0.1, 0.0, 0.5, 0.1, 0.0, 0.6])
    gripper = Gripper(opening=0.04, reach=0.03)
    assert gripper.holds(points, [0.139, 0.0, 0.6])
    assert gripper.holds(points, [0.1, 0.0, 0.629])
    assert not gripper.holds(points, [0.1, 0.041, 0.6])
    assert not gripper.holds(points, [0.1, 0.0, 0.569])


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: AngleLossPlant((0.0, 0.5, 0.5)), "realised"),
        (lambda: AngleLossPlant((0.5, 0.5, 0.5), play=-1), "play"),
        (lambda: ElasticPlant(tendon_stiffness=0), "tendon_stiffness"),
        (lambda: ElasticPlant(gripper_mass=-1), "gripper_mass"),
        (lambda: Stiffness(bending=0), "bending"),
        (lambda: LaggingPlant(ElasticPlant(), 0.0, 1.0), "timestep"),
        (lambda: Gripper(opening=-0.1), "opening"),
    ],
)
def test_bad_parameters_are_named(build, message):
    with pytest.raises(ValueError, match=message):
        build()

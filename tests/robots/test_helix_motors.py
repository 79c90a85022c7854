"""The motors that pull the tendons: their range, their ticks, and what they refuse."""

import numpy as np
import pytest

from soro_lib.robots import HelixArm
from soro_lib.robots.helix_motors import TendonMotors

ARM = HelixArm()


def test_motors_round_to_ticks_and_stay_in_range():
    motors = TendonMotors()
    pulled = motors.pull(np.full(9, 0.01234)) - ARM.tendon_lengths(ARM.home)
    assert np.abs(pulled - 0.01234).max() <= np.pi / 4096 * ARM.pulley_radius + 1e-12
    clipped, cut = motors.clip(np.full(9, 0.3))
    assert cut.all()
    assert (clipped == 0.1).all()
    assert (motors.clip(np.full(9, -0.3))[0] == np.array([-0.1] * 3 + [-0.2] * 6)).all()


@pytest.mark.parametrize("change", [np.full(9, np.nan), np.zeros(8), np.full(9, np.inf)])
def test_motors_refuse_what_is_no_command(change):
    with pytest.raises(ValueError, match="tendon_change must"):
        TendonMotors().pull(change)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [({"ticks_per_turn": 0}, "ticks_per_turn"), ({"shortest": (0.2,) * 9}, "shortest must be below longest")],
)
def test_bad_parameters_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        TendonMotors(**parameters)

"""Pushes and flicks: calibrated where they say so, and the contact mask; small but real."""

import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion.experiments import collisions
from soro_lib.papers.visual_strain_fusion.world import motion


def test_push_is_calibrated_to_fifteen_millimetres():
    contact = collisions.touches()["push cap"]
    pushed, event, _ = collisions.simulate_contacts(contact, np.random.default_rng(1))
    free = motion.spiral()
    displaced = np.linalg.norm(pushed.pose[:, :3] - free.pose[:, :3], axis=1)
    peaks = [displaced[event == number].max() for number in range(event.max() + 1)]
    assert np.mean(peaks) == pytest.approx(15e-3, rel=0.05)


def test_only_a_finger_on_the_body_presses_on_gratings():
    for place, pressed in (("cap", False), ("body", True)):
        _, _, squeeze = collisions.simulate_contacts(
            collisions.Contact("push", place), np.random.default_rng(1)
        )
        assert (squeeze.max() > 0.0) == pressed
        assert squeeze.max() <= 1.0


def test_masking_helps_where_the_fibre_stands_alone():
    contacts = {name: collisions.protections()[name] for name in ("bare", "bare, masked")}
    runs = collisions.sweep_contacts(1, contacts, seeds=2)
    table = runs.groupby(["contact", "estimator"]).mean_mm.mean()
    assert table["bare, masked", "fibre"] < 0.9 * table["bare", "fibre"]


@pytest.mark.parametrize("options", [{"kind": "kiss"}, {"place": "base"}, {"fibre": "steel"}, {"force": 0.0}])
def test_bad_contact_is_refused(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        collisions.Contact(**{"kind": "push", "place": "cap", **options})

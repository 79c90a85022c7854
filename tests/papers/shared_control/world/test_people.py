"""Populations, and the bounds of an operator's parameters."""

import math
from dataclasses import fields

import numpy as np
import pytest

from soro_lib.papers.shared_control.world.people import POPULATIONS, Operator


def test_populations_scatter_about_their_typical_person():
    rng = np.random.default_rng(1)
    people = [POPULATIONS["naive"].draw(rng) for _ in range(2000)]
    assert np.median([person.depth_error for person in people]) == pytest.approx(0.05, rel=0.05)
    assert np.std(np.log([person.hand_stiffness for person in people])) == pytest.approx(0.4, rel=0.1)
    assert all(0 <= person.lag_model <= 1 for person in people)
    assert np.std([person.mapping_angle for person in people]) == pytest.approx(math.radians(15), rel=0.1)


@pytest.mark.parametrize("name", [field.name for field in fields(Operator)])
def test_every_parameter_is_checked(name):
    with pytest.raises(ValueError, match=name):
        Operator(**{name: math.nan})
    if name != "mapping_angle":
        with pytest.raises(ValueError, match=name):
            Operator(**{name: -1.0})


@pytest.mark.parametrize(("name", "value"), [("lag_model", 1.5), ("passivity", 1.0), ("view_elevation", 2.0)])
def test_bounds_above_are_checked(name, value):
    with pytest.raises(ValueError, match=name):
        Operator(**{name: value})

"""Trials that several tests look at; none of them changes any."""

import pytest

from soro_lib.papers.shared_control.experiments import demonstrations, factorial
from soro_lib.papers.shared_control.experiments.trials import load_trials
from soro_lib.project import data_directory


@pytest.fixture(scope="session")
def shipped():
    """The recorded trials that come with the workbook."""
    return load_trials(data_directory("shared_control") / "trials")


@pytest.fixture(scope="session")
def tuning():
    """The tuning study of two naive users."""
    return factorial.run_factorial(demonstrations.draw_operators("naive", 2, 1), 1)


@pytest.fixture(scope="session")
def crowd():
    """The demonstrations of three people of each kind."""
    return demonstrations.run_demonstrations(3, 1, trials=2)

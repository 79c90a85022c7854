"""The index of equations and the errata."""

from soro_lib.replication.equations import index_problems


def test_index_and_errata_are_complete():
    assert index_problems("shared_control") == []

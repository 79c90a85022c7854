"""Writes the shipped trials again: ``python -m soro_lib.papers.shared_control.experiments``."""

from soro_lib.papers.shared_control.experiments.recorder import write_shipped_trials
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options

if __name__ == "__main__":
    # The trials take seconds: their small form is the whole one.
    parser = generator_options("Record the simulated operators again.", data_directory("shared_control"))
    write_shipped_trials(parser.parse_args().output / "trials")

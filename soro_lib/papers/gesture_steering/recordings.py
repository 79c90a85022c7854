"""Writes the shipped recordings again: ``python -m soro_lib.papers.gesture_steering.experiments``."""

from soro_lib.papers.gesture_steering.experiments.hands import write_recordings
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options

if __name__ == "__main__":
    # The recordings take seconds: their small form is the whole one.
    parser = generator_options("Simulate the hands again.", data_directory("gesture_steering"))
    write_recordings(parser.parse_args().output / "recordings")

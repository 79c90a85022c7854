"""Writes the shipped recordings again: ``python -m soro_lib.studies.gesture_steering``."""

from soro_lib.datacards import generator_options
from soro_lib.project import data_directory
from soro_lib.studies.gesture_steering.hands import write_recordings

if __name__ == "__main__":
    # The recordings take seconds: their small form is the whole one.
    parser = generator_options("Simulate the hands again.", data_directory("gesture_steering"))
    write_recordings(parser.parse_args().output / "recordings")

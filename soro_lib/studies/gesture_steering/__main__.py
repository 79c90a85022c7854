"""Writes the shipped recordings again: ``python -m soro_lib.studies.gesture_steering``."""

from soro_lib.project import data_directory
from soro_lib.studies.gesture_steering.hands import write_recordings

if __name__ == "__main__":
    write_recordings(data_directory("gesture_steering") / "recordings")

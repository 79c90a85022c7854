"""Writes the shipped trials again: ``python -m soro_lib.studies.shared_control``."""

from soro_lib.project import data_directory
from soro_lib.studies.shared_control.recorder import write_shipped_trials

if __name__ == "__main__":
    write_shipped_trials(data_directory("shared_control") / "trials")

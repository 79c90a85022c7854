"""Kinematics, filters, controllers and simulated plants of four soft-robot papers, in SI units throughout."""

import os

from soro_lib import moved
from soro_lib.project import compiled_code_directory

__version__ = "0.1.0"

moved.install()
os.environ.setdefault("NUMBA_CACHE_DIR", str(compiled_code_directory()))

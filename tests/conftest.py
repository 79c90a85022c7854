"""One thread per test, no user settings of matplotlib: what the runner also gives its notebooks."""

import os

from hypothesis import settings

os.environ.setdefault("MPLBACKEND", "Agg")
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(variable, "1")

# The same examples everywhere, and no time limit on one: a busy machine is not a failure.
settings.register_profile("workbook", deadline=None, derandomize=True)
settings.load_profile("workbook")

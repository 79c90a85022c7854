"""What "the same number" means: every tolerance of tables and scorecards, in one place."""

import math

TABLE_RELATIVE = 1e-4
"""Two runs of the same seed agree when their table entries do to this relative error [-]."""

TABLE_ABSOLUTE = 1e-9
"""... or to this absolute error, in the unit of the column (for entries that are zero but for rounding)."""

ROUNDING = 1e-9
"""Slack of a tolerance, relative to the numbers: 1.30 is within 0.05 of 1.25 despite binary fractions [-]."""

CLOSE_FACTOR = 2.0
"""A value is close when it is within this many tolerances [-]."""

CONFIDENCE = 0.95
"""Level of every interval over seeds [-]."""

BOOTSTRAP_RESAMPLES = 4000
"""Resamples of every bootstrap interval [count]."""

BOOTSTRAP_SEED = 20260101
"""Seed of the resampling alone; the experiments have their own [-]."""

FLOAT_FORMAT = "%.6g"
"""How tables write a number: enough digits for every published one, few enough to be the same everywhere.

How small it may be before it is written as zero is said by `soro_lib.replication.resolution`.
"""

DPI = 150
"""Resolution of every saved figure [pixels per inch]."""

QUICK_DPI = 50
"""Resolution of the figures of a quick run, which show that everything can be drawn [pixels per inch]."""


def same_number(first: float, second: float) -> bool:
    """Return whether two runs of the same seed gave the same number; two NaN are the same."""
    if math.isnan(first) and math.isnan(second):
        return True
    return math.isclose(first, second, rel_tol=TABLE_RELATIVE, abs_tol=TABLE_ABSOLUTE)


def within(ours: float, published: float, tolerance: float) -> bool:
    """Return whether a value is within the tolerance of the published one, all in the same unit."""
    return abs(ours - published) <= tolerance + ROUNDING * max(abs(ours), abs(published), tolerance)

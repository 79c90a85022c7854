"""What a study hands to the scorecard: one finding per published number, never the number itself."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

STATISTICS: dict[str, Callable[..., Any]] = {
    "mean": np.mean,
    "median": np.median,
    "min": np.min,
    "max": np.max,
    "std": lambda samples, axis=None: np.std(samples, axis=axis, ddof=1),
    "rms": lambda samples, axis=None: np.sqrt(np.mean(np.square(samples), axis=axis)),
    "p05": lambda samples, axis=None: np.percentile(samples, 5.0, axis=axis),
    "p25": lambda samples, axis=None: np.percentile(samples, 25.0, axis=axis),
    "p75": lambda samples, axis=None: np.percentile(samples, 75.0, axis=axis),
    "p95": lambda samples, axis=None: np.percentile(samples, 95.0, axis=axis),
}
"""The statistics over seeds that a finding may ask for, by name."""


@dataclass(frozen=True, eq=False)
class Finding:
    """What the replication obtains for one published number.

    Parameters
    ----------
    samples
        One value, or one value per seed, shape ``()`` or ``(seeds,)``, in the unit of the published row.
        For an ``ordering`` row each sample says whether the claim held: 1 (yes), 0 (no) or a probability.
    reason
        Why the value is what it is; printed beside the verdict, expected wherever it differs.
    statistic
        Name of the statistic over seeds that is compared with the published value, one of `STATISTICS`.

    Raises
    ------
    ValueError
        If the samples are empty or have more than one axis, or the statistic is unknown.

    Examples
    --------
    >>> Finding([1.0, 2.0, 6.0], statistic="median").value
    2.0
    """

    samples: ArrayLike
    reason: str = ""
    statistic: str = "mean"

    def __post_init__(self) -> None:
        samples = np.array(self.samples, dtype=float)
        if samples.ndim > 1 or samples.size == 0:
            raise ValueError(
                f"samples: shape {samples.shape}, expected () or (seeds,) with at least one seed"
            )
        if self.statistic not in STATISTICS:
            raise ValueError(f"statistic: {self.statistic!r} is not one of {', '.join(STATISTICS)}")
        object.__setattr__(self, "samples", np.atleast_1d(samples))

    @property
    def value(self) -> float:
        """The statistic of the samples, in the unit of the published row."""
        return float(STATISTICS[self.statistic](np.asarray(self.samples)))

    @property
    def seeds(self) -> int:
        """Number of samples."""
        return int(np.size(self.samples))

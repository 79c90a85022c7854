"""Published number, our number, interval over seeds, verdict: the heart of every notebook."""

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from soro_lib.replication import policy, resolution
from soro_lib.replication.findings import STATISTICS, Finding
from soro_lib.replication.published import PublishedNumber, load_published
from soro_lib.replication.tabular import suggestion

COLUMNS = [
    *("id", "location", "quantity", "unit", "kind", "role"),
    *("published", "ours", "low", "high", "seeds", "tolerance", "verdict", "reason"),
]
"""The header of ``scorecard.csv``."""

VERDICTS = ("reproduced", "close", "differs", "calibrated", "not attempted")
"""Every verdict, best first."""


def verdict(role: str, published: float, ours: float | None, tolerance: float) -> str:
    """Judge one number by the rules that were fixed before the run.

    Parameters
    ----------
    role
        ``prediction`` or ``calibration``.
    published, ours, tolerance
        In the same unit; `ours` is None where the number was not attempted.

    Returns
    -------
    str
        ``reproduced`` within the tolerance, ``close`` within twice the tolerance, ``differs`` beyond. A
        number that the plant was fitted to is at best ``calibrated`` (within twice the tolerance), never
        reproduced.
    """
    if ours is None:
        return "not attempted"
    if not policy.within(ours, published, policy.CLOSE_FACTOR * tolerance):
        return "differs"
    if role == "calibration":
        return "calibrated"
    return "reproduced" if policy.within(ours, published, tolerance) else "close"


def confidence_interval(finding: Finding) -> tuple[float, float]:
    """Return the 95 % percentile-bootstrap interval over seeds, (NaN, NaN) for a single sample.

    The resampling has a generator of its own (`policy.BOOTSTRAP_SEED`): the same samples give the same
    interval.
    """
    if finding.seeds == 1:
        return math.nan, math.nan
    from scipy.stats import bootstrap  # takes longer to import than all the rest of a small notebook

    result = bootstrap(
        (np.asarray(finding.samples),),
        STATISTICS[finding.statistic],
        n_resamples=policy.BOOTSTRAP_RESAMPLES,
        batch=max(1, 1_000_000 // finding.seeds),  # bounds the memory where the samples are many
        confidence_level=policy.CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(policy.BOOTSTRAP_SEED),
    )
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def build_scorecard(slug: str, findings: Mapping[str, Finding]) -> pd.DataFrame:
    """Set the findings of a study beside the published numbers of its paper.

    Parameters
    ----------
    slug
        The paper.
    findings
        Findings by the id of the published row. Rows without one are ``not attempted``, with their note as
        reason.

    Returns
    -------
    pandas.DataFrame
        One row per published number, `COLUMNS`, in the order of ``published.csv``.

    Raises
    ------
    TableError
        If ``published.csv`` is wrong.
    ValueError
        If a finding has an unknown id, belongs to a hardware row, or is not finite.
    """
    numbers = load_published(slug)
    _check(slug, numbers, findings)
    rows = [_judge(number, findings.get(number.id)) for number in numbers.values()]
    return pd.DataFrame(rows, columns=COLUMNS).astype({"seeds": "Int64"})


def _check(slug: str, numbers: Mapping[str, PublishedNumber], findings: Mapping[str, Finding]) -> None:
    source = f"data/{slug}/published.csv"
    problems = [
        f"finding {name!r} has no row in {source}{suggestion(name, numbers)}"
        for name in findings
        if name not in numbers
    ]
    for name, finding in findings.items():
        number = numbers.get(name)
        if number is None:
            continue
        if not np.all(np.isfinite(finding.samples)) or not math.isfinite(finding.value):
            problems.append(
                f"finding {name!r}: {finding.statistic} of {finding.seeds} samples is {finding.value}; "
                "every sample and the statistic must be finite"
            )
        if number.kind == "hardware":
            problems.append(
                f"finding {name!r}: its row in {source} is of kind hardware, which no simulation can give"
            )
        if number.kind == "ordering" and not 0.0 <= finding.value <= 1.0:
            problems.append(
                f"finding {name!r}: {finding.value} is no probability, an ordering row needs 0..1"
            )
    if problems:
        raise ValueError("\n".join(problems))


def _judge(number: PublishedNumber, finding: Finding | None) -> dict[str, object]:
    """Return one row of the scorecard."""
    # The verdict is that of the number as written, so that it follows from the table a reader sees.
    unit = number.unit
    ours = None if finding is None else float(resolution.rounded(finding.value, unit))
    low, high = (math.nan, math.nan) if finding is None else confidence_interval(finding)
    return {
        "id": number.id,
        "location": number.location,
        "quantity": number.quantity,
        "unit": unit,
        "kind": number.kind,
        "role": number.role,
        "published": number.value,
        "ours": math.nan if ours is None else ours,
        "low": float(resolution.rounded(low, unit)),
        "high": float(resolution.rounded(high, unit)),
        "seeds": pd.NA if finding is None else finding.seeds,
        "tolerance": number.tolerance,
        "verdict": verdict(number.role, number.value, ours, number.tolerance),
        "reason": (finding.reason if finding else "") or number.note,
    }


def stale_verdicts(slug: str, scorecard: pd.DataFrame) -> list[str]:
    """Return where a written scorecard no longer follows from ``published.csv`` and the verdict rules."""
    numbers = load_published(slug)
    problems = [
        f"row {name!r} of published.csv is missing" for name in numbers if name not in set(scorecard["id"])
    ]
    for _, row in scorecard.iterrows():
        number = numbers.get(row["id"])
        if number is None:
            problems.append(f"row {row['id']!r} is not in published.csv")
            continue
        ours = None if math.isnan(row["ours"]) else row["ours"]
        expected = verdict(number.role, number.value, ours, number.tolerance)
        if row["verdict"] != expected:
            problems.append(f"row {row['id']!r} says {row['verdict']!r}, the rules say {expected!r}")
        if row["verdict"] in ("differs", "not attempted") and not row["reason"]:
            problems.append(f"row {row['id']!r} {row['verdict']} without a reason")
    return problems

"""What the handover study takes from the thesis: plant K's three shares, and the length of a timestep.

Plant K is fitted to three printed numbers (Vervloet, Section 5.2: 16, 29 and 14 cm) and to nothing else;
these three count as calibrated, never as reproduced. The timestep is the speed of the thesis's laptop; with
it, steps become seconds.
"""

import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from soro_lib.papers.soft_handover.experiments.handover import HEADINGS, still_handover, thesis_parameters
from soro_lib.papers.soft_handover.world.plant import AngleLossPlant
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options
from soro_lib.replication.published import load_published

FITTED_ROWS = ("s52_measured_distance", "s52_commanded_distance", "s52_gap")
"""The rows of ``published.csv`` that plant K is fitted to: final distances at step size 0.1."""

EVENNESS = 0.02
"""Pull of the three shares towards each other in the fit; three numbers that depend on two things need it."""


def plant_k_file() -> Path:
    """Return where the fitted shares are kept: ``data/soft_handover/plant_k.toml``."""
    return data_directory("soft_handover") / "plant_k.toml"


def plant_k() -> AngleLossPlant:
    """Return plant K with the stored shares."""
    stored = tomllib.loads(plant_k_file().read_text())
    return AngleLossPlant(tuple(stored["realised"]))


def timestep(step_size: float) -> float:
    """Return the thesis's duration of one step [s] (Table 1, last row); 0.3 takes the mean of 0.2 and 0.4."""
    printed = load_published("soft_handover")
    seconds = [printed[f"table1_timestep_{alpha:02d}"].value for alpha in (1, 2, 4)]
    return float(np.interp(step_size, [0.1, 0.2, 0.4], seconds))


def final_distances(realised: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return measured and commanded distance of the gripper and their gap (3,) [m] at the end of a still
    handover.

    Mean over the four locations, step size 0.1; without noise, so that the fit depends on no random number.
    """
    plant = AngleLossPlant(tuple(realised))
    ends = []
    for location in HEADINGS:
        trace = still_handover(thesis_parameters(0.1), plant, location, 120).trace
        ends.append([trace[name][-1] for name in ("measured_mm", "commanded_mm", "commanded_gap_mm")])
    return 1e-3 * np.mean(ends, axis=0)


def fit_plant_k(iterations: int = 600) -> NDArray[np.float64]:
    """Return the three shares that bring the final distances closest to the printed 16, 29 and 14 cm.

    The search ends when it has converged, which takes fewer `iterations` than the default.
    """
    printed = load_published("soft_handover")
    target = 1e-2 * np.array([printed[row].value for row in FITTED_ROWS])

    def misfit(realised: NDArray[np.float64]) -> float:
        if realised.min() <= 0.2 or realised.max() > 1:
            return 1.0
        unevenness = EVENNESS * (realised - realised.mean())
        return float(np.sum((final_distances(realised) - target) ** 2) + np.sum(unevenness**2))

    fit = minimize(
        misfit,
        np.full(3, 0.5),
        method="Nelder-Mead",
        options={"xatol": 2e-3, "fatol": 1e-8, "maxiter": iterations},
    )
    return fit.x


def main() -> None:
    """Fit plant K and store its shares; takes about a minute."""
    options = generator_options("Fit plant K again.", data_directory("soft_handover")).parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    fitted = fit_plant_k(2) if options.small else fit_plant_k()
    shares = ", ".join(f"{share:.4f}" for share in fitted)
    text = (
        "# Plant K of the handover study: the share of its commanded bending angle "
        "that each segment realises.\n"
        "# Declared calibration to 16, 29 and 14 cm (Vervloet, Section 5.2): "
        "soro_lib.papers.soft_handover.calibration.fit_plant_k.\n"
        f"realised = [{shares}]\n"
    )
    path = options.output / plant_k_file().name
    partial = path.with_suffix(".toml.partial")
    partial.write_text(text, encoding="utf-8")
    partial.replace(path)
    print(f"wrote {path}: {shares}")


if __name__ == "__main__":
    main()

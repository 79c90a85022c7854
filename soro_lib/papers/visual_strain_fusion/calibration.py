"""Calibration of the simulated pneumatic plant on the model-based columns of Tables I and II (Wang et al.).

Sixteen published numbers are read here, openly: the mean tracking error and the mean path deviation of the
model-based controller for two paths and four gains. Nine parameters of the plant are fitted to them by a
global search, once with the desired step capped at 3 mm and once without any cap, as the control of that
hypothesis. No hybrid number is read; the hybrid columns are predictions of the fitted plant.

    python -m soro_lib.papers.visual_strain_fusion.calibration            # search again, write the parameters
    python -m soro_lib.papers.visual_strain_fusion.calibration --check    # verify the stored optimum
"""

import sys
import tomllib
from pathlib import Path

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from soro_lib.controllers.hybrid import HybridController, HybridSettings
from soro_lib.papers.visual_strain_fusion.experiments import tracking
from soro_lib.papers.visual_strain_fusion.experiments.tracking import GAINS, turn
from soro_lib.papers.visual_strain_fusion.world.plant import Array, ChamberParameters, PneumaticPlant
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options
from soro_lib.replication.published import load_published
from soro_lib.robots.pneumatic import PneumaticArm

SLUG = "visual_strain_fusion"
CAPS = {"cap_3mm": 3e-3, "no_cap": np.inf}
BOUNDS = {
    "gain_pentagram": (np.log(0.2), np.log(30.0)),
    "gain_circle": (np.log(0.2), np.log(30.0)),
    "resolution": (0.0, 0.02e-3),
    "play": (0.0, 0.5e-3),
    "dead_band": (0.0, 2e-3),
    "softness": (0.02e-3, 0.6e-3),
    "exponent": (0.4, 1.8),
    "suction": (0.3, 1.2),
    "rotation": (0.0, 2.0 * np.pi / 15.0),
}
"""Search bounds: gains as logarithms, lengths in metres; the rotation up to the symmetry of star and arm."""
LIMITS = np.array(list(BOUNDS.values())).T

SEED = 20230207
GENERATIONS, MEMBERS = 100, 10
THINNING = 4


HEADER = f"""\
# Simulated pneumatic plant, fitted to the model-based columns of Tables I and II (16 numbers) and
# to nothing else. Written by: python -m soro_lib.papers.visual_strain_fusion.calibration
[provenance]
fitted_to = "data/visual_strain_fusion/published.csv: table{{1,2}}_kp*_model_{{error,deviation}}_mean"
seed = {SEED}
generations = {GENERATIONS}
method = "differential evolution, population 90, noise-free simulation of two cycles from rest\""""
"""What the file of the fitted parameters begins with."""


def published_cells() -> Array:
    """Mean errors and deviations of the model-based controller, ``(2 paths, 2 measures, 4 gains)`` [m]."""
    numbers = load_published(SLUG)
    cells = [
        numbers[f"table{table}_kp{100 * gain:02.0f}_model_{measure}_mean"].value
        for table in (1, 2)
        for measure in ("error", "deviation")
        for gain in GAINS
    ]
    return 1e-3 * np.reshape(cells, (2, 2, len(GAINS)))


def simulated_cells(candidates: Array, cap: float) -> Array:
    """The same numbers of candidate plants ``(9, n)``, without sensor noise, as ``(n, 2, 2, 4)`` [m]."""
    values = dict(zip(BOUNDS, candidates[..., None]))
    chambers = {name: values[name][..., None] for name in list(BOUNDS)[2:8]}
    paths = {path: np.exp(values[f"gain_{path}"]) for path in ("pentagram", "circle")}
    cells = [_path_cells(path, gain, values["rotation"], chambers, cap) for path, gain in paths.items()]
    return np.stack(cells, axis=1)


def _path_cells(path: str, gain: Array, rotation: Array, chambers: dict[str, Array], cap: float) -> Array:
    arm, batch = PneumaticArm(), (len(gain), len(GAINS))
    plant = PneumaticPlant(arm, ChamberParameters(gain=gain[..., None], **chambers), batch=batch)
    settings = HybridSettings(proportional_gain=np.array(GAINS), maximum_step=cap, compensation="none")
    points = tracking.path_points(path)
    turned = np.stack([turn(points, float(angle)) for angle in rotation[:, 0]], axis=1)
    targets = np.tile(turned[:, :, None], (tracking.CYCLES, 1, 1, 1))
    run = tracking.track(plant, HybridController(arm, settings, batch), targets, compensating=False)
    for member, angle in enumerate(rotation[:, 0]):
        run.tip[:, member] = turn(run.tip[:, member], -float(angle))
    deviation = run.deviation(points, every=THINNING)
    error = np.linalg.norm(run.tip - np.tile(points, (tracking.CYCLES, 1))[:, None, None], axis=-1)
    return np.stack([error.mean(axis=0), deviation.mean(axis=0)], axis=1)


def misfit(candidates: Array, cap: float) -> Array:
    """Root-mean-square log of simulated over published cells, ``(n,)`` for candidates ``(9, n)`` [-]."""
    ratio = np.log(simulated_cells(candidates, cap) / published_cells())
    return np.asarray(np.sqrt(np.mean(ratio**2, axis=(1, 2, 3))), dtype=np.float64)


def search(cap: float, generations: int, members: int) -> tuple[Array, float]:
    """Search the nine parameters from scratch, with so many members of each generation per parameter.

    Returns the parameters and their misfit.
    """
    result = differential_evolution(
        # scipy's stubs do not know the vectorised form, which returns one value per candidate.
        lambda candidates: misfit(candidates, cap),  # type: ignore[arg-type, misc]
        Bounds(*LIMITS),
        maxiter=generations,
        popsize=members,
        tol=0.0,
        rng=np.random.default_rng(SEED),
        polish=False,
        vectorized=True,
        updating="deferred",
        callback=lambda intermediate_result: print(f"  misfit {intermediate_result.fun:.4f}", flush=True),
    )
    return result.x, float(result.fun)


def plant_file() -> Path:
    """The file of the fitted parameters."""
    return data_directory(SLUG) / "plant.toml"


def write(optima: dict[str, tuple[Array, float]], path: Path) -> None:
    """Write the fitted parameters with their provenance, in one step."""
    lines = [HEADER]
    for name, (candidate, value) in optima.items():
        lines += ["", f"[{name}]", f"misfit = {value!r}  # root-mean-square log ratio"]
        for parameter, number in zip(BOUNDS, candidate):
            number = np.exp(number) if parameter.startswith("gain") else number
            lines.append(f"{parameter} = {float(number)!r}")
    partial = path.with_suffix(".toml.partial")
    partial.write_text("\n".join(lines) + "\n", encoding="utf-8")
    partial.replace(path)


def read(path: Path) -> dict[str, tuple[Array, float]]:
    """Read the fitted parameters back as the candidates of `misfit`, with their stored misfit."""
    stored = tomllib.loads(path.read_text(encoding="utf-8"))
    optima = {}
    for name in CAPS:
        numbers = {key: stored[name][key] for key in BOUNDS}
        numbers |= {key: np.log(numbers[key]) for key in ("gain_pentagram", "gain_circle")}
        optima[name] = (np.array(list(numbers.values())), float(stored[name]["misfit"]))
    return optima


def check(path: Path) -> list[str]:
    """What is wrong with the stored optimum; nothing if it is reproduced and no neighbour is much better.

    Neighbours are the optimum with one parameter moved by 2 % of its search range, either way. The misfit may
    be off by 0.01 and a tenth: without the cap the loop is not stable, and then the last digit of a sine
    decides where the tip goes.
    """
    problems = []
    for name, (optimum, stored) in read(path).items():
        low, high = LIMITS
        moves = 0.02 * np.vstack([np.diag(high - low), -np.diag(high - low)])
        candidates = np.clip(np.vstack([optimum, optimum + moves]), low, high)
        values = misfit(candidates.T, CAPS[name])
        if abs(values[0] - stored) > 0.01 + 0.1 * stored:
            problems.append(f"{name}: misfit is {values[0]:.4f}, stored is {stored:.4f}")
        if values.min() < 0.9 * values[0]:
            parameter = list(BOUNDS)[(int(values.argmin()) - 1) % len(BOUNDS)]
            better = f"lowers the misfit from {values[0]:.4f} to {values.min():.4f}"
            problems.append(f"{name}: moving {parameter} {better}")
        print(f"{name}: misfit {values[0]:.4f}, stored {stored:.4f}, best neighbour {values[1:].min():.4f}")
    return problems


def main(arguments: list[str] | None = None) -> int:
    """Run the calibration or its check; return the exit code."""
    parser = generator_options("Fit the pneumatic plant again.", data_directory(SLUG))
    parser.add_argument("--check", action="store_true", help="verify the stored parameters, do not search")
    options = parser.parse_args(arguments)
    path = options.output / plant_file().name
    if options.check:
        problems = check(path)
        print("\n".join(problems) or "the stored parameters are reproduced")
        return int(bool(problems))
    optima = {}
    effort = (1, 1) if options.small else (GENERATIONS, MEMBERS)
    for name, cap in CAPS.items():
        print(f"{name}: searching", flush=True)
        optima[name] = search(cap, *effort)
    options.output.mkdir(parents=True, exist_ok=True)
    write(optima, path)
    print(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

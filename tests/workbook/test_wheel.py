"""The library as others install it: a wheel, imported far from any checkout."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from soro_lib.project import ROOT

IMPORT_ALL = """
import importlib, pathlib, sys
import soro_lib
assert pathlib.Path(soro_lib.__file__).is_relative_to(sys.argv[1]), soro_lib.__file__
for package in ("robots", "sensing", "controllers", "estimators"):
    module = importlib.import_module("soro_lib." + package)
    for name in module.__all__:
        getattr(module, name)
print(soro_lib.robots.HelixArm().forward(soro_lib.robots.HelixArm().home)[2, 3])
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a wheel of a copy of the sources, unpack it into a folder, and return the folder."""
    folder = tmp_path_factory.mktemp("wheel")
    shutil.copytree(
        ROOT / "soro_lib", folder / "source" / "soro_lib", ignore=shutil.ignore_patterns("__pycache__")
    )
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder / "source")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    options = ["--no-deps", "--no-index", "--no-build-isolation"]
    subprocess.run([*pip, "wheel", *options, "-w", str(folder), str(folder / "source")], check=True)
    (wheel,) = folder.glob("*.whl")
    subprocess.run([*pip, "install", *options, "--target", str(folder / "site"), str(wheel)], check=True)
    return folder / "site"


def test_the_wheel_imports_outside_a_checkout(installed: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    done = subprocess.run(
        [sys.executable, "-c", IMPORT_ALL, str(installed)],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) > 0.1


def test_the_wheel_holds_the_scripts_of_the_explorers(installed: Path) -> None:
    scripts = {path.relative_to(ROOT) for path in (ROOT / "soro_lib").rglob("*.js")}
    assert scripts
    assert {path.relative_to(installed) for path in installed.rglob("*.js")} == scripts

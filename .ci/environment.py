"""Set up .venv from environment.txt; with the standard library alone, on any Python from 3.11 on.

The environment is finished when .venv/complete holds the digest of what it was made from. Anything else, from
a changed lock to an interrupted installation, is made anew.
"""

import fcntl
import hashlib
import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
COMPLETE = VENV / "complete"
LOCK = ROOT / "environment.txt"


def main() -> None:
    wanted = digest()
    if COMPLETE.is_file() and COMPLETE.read_text() == wanted and works():
        return
    (ROOT / "build").mkdir(exist_ok=True)
    with open(ROOT / "build" / "environment.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (COMPLETE.is_file() and COMPLETE.read_text() == wanted and works()):
            create()
            COMPLETE.write_text(wanted)


def digest() -> str:
    """Digest of what the environment depends on; the tools' settings in pyproject.toml are not part of it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    settings = json.dumps([project["build-system"], project["project"], str(ROOT)])
    return hashlib.sha256(LOCK.read_bytes() + settings.encode()).hexdigest()


def works() -> bool:
    """Whether the interpreter that .venv was made with is still there."""
    return (VENV / "bin" / "python").exists()


def create() -> None:
    version = ".".join(map(str, sys.version_info[:3]))
    say(f"setting up .venv with Python {version} ({sys.executable})")
    try:
        import ensurepip  # noqa: F401
        import venv
    except ImportError:
        sys.exit(
            f"error: this Python {version} comes without venv and ensurepip; on Debian and Ubuntu install "
            f"python3.{sys.version_info.minor}-venv,\nor name another one: make PYTHON=..."
        )
    shutil.rmtree(VENV, ignore_errors=True)
    venv.create(VENV, with_pip=True, symlinks=True)
    pip("--require-hashes", "--no-deps", "--requirement", str(LOCK))
    # setuptools is in the lock; nothing is fetched to build soro_lib.
    pip("--no-deps", "--no-build-isolation", "--no-index", "--editable", str(ROOT))
    say("the environment is complete")


def pip(*arguments: str) -> None:
    """Run pip install, saying how far it is and, if it fails, why."""
    command = [str(VENV / "bin" / "python"), "-m", "pip", "install", "--disable-pip-version-check"]
    command += ["--no-input", "--progress-bar", "off", *arguments]
    lines, collected = [], 0
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        for line in process.stdout:
            lines.append(line.rstrip())
            if line.startswith(("Collecting ", "Processing ", "Obtaining ")):
                collected += 1
                if collected % 25 == 0:
                    say(f"  fetched {collected} packages")
            if line.startswith("Installing collected"):
                say(f"  fetched {collected}, now installing")
    if process.returncode:
        tail = "\n".join(lines[-15:])
        sys.exit(f"{tail}\n\nerror: pip could not install the packages; {explanation(tail)}")


def explanation(output: str) -> str:
    if "HASHES" in output:
        return "a package is not the one that environment.txt has pinned (changed on its way here?)."
    if "No space left" in output:
        return "the disk is full; about 1.5 GB are needed."
    return "is there a network connection, and has this Python version wheels for them? Then run make again."


def say(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("\ninterrupted; the next make starts the set-up anew")

"""Is what is committed what the last run produced? ``python -m soro_lib.workbook.check`` tells.

Every check returns its problems as texts that say what is wrong, where, and how to mend it.
"""

import argparse
import subprocess
import sys
import tarfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from soro_lib.project import ROOT, slugs
from soro_lib.replication import datacards, summary
from soro_lib.replication.equations import index_problems
from soro_lib.replication.scorecard import stale_verdicts
from soro_lib.replication.tabular import TableError
from soro_lib.workbook import compare


def readme(root: Path = ROOT) -> list[str]:
    """Return problems of the scorecard in the README: it must be the one of the committed figures."""
    mend = "run `python -m soro_lib.workbook.check --update-readme`"
    path = root / "README.md"
    try:
        _, block, _ = summary.split_readme(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        return [str(error)]
    return (
        [] if block == _readme_block(root) else [f"README.md: its scorecard is not that of figures/; {mend}"]
    )


def update_readme(root: Path = ROOT) -> None:
    """Write the merged scorecard between the markers of the README.

    Raises
    ------
    ValueError
        If the markers are not there.
    """
    path = root / "README.md"
    before, _, after = summary.split_readme(path.read_text(encoding="utf-8"))
    path.write_text(before + _readme_block(root) + after, encoding="utf-8")


def _readme_block(root: Path) -> str:
    return summary.readme_block(summary.load_scorecards(root / "figures"))


def figures(root: Path = ROOT) -> list[str]:
    """Return where ``figures/`` as the last run wrote it differs from what is committed."""
    with committed(root, "figures") as before:
        found = compare.differences(before, root / "figures")
    return [f"figures/{difference}; look why, then commit or remove it" for difference in found]


@contextmanager
def committed(root: Path, folder: str) -> Iterator[Path]:
    """Give a folder as it is committed, as a temporary copy.

    Raises
    ------
    RuntimeError
        If git does not know the folder.
    """
    archive = _git(root, "archive", "--format=tar", "HEAD", folder)
    with TemporaryDirectory() as copy, tarfile.open(fileobj=BytesIO(archive)) as files:
        files.extractall(copy, filter="data")
        yield Path(copy) / folder


def scorecards(root: Path = ROOT) -> list[str]:
    """Return papers without a scorecard, and verdicts that do not follow from the rules or lack a reason."""
    cards = summary.load_scorecards(root / "figures")
    problems = [
        f"figures/{slug}/scorecard.csv: missing; run `make figures`" for slug in slugs() if slug not in cards
    ]
    for slug, card in cards.items():
        stale = stale_verdicts(slug, card)
        problems += [f"figures/{slug}/scorecard.csv: {what}; mend it, run `make figures`" for what in stale]
    return problems


def equations() -> list[str]:
    """Return equations without a function or test that exists, and errata without a test."""
    problems = []
    for slug in slugs():
        try:
            problems += index_problems(slug)
        except TableError as error:
            problems.append(str(error))
    return problems


def data(root: Path = ROOT) -> list[str]:
    """Return data files without a card, or not as their card says; TOML files speak for themselves."""
    by_hand = {"published.csv", "equations.csv", "errata.csv"}
    files = {path for path in (root / "data").rglob("*") if path.is_file() and path.name not in by_hand}
    cards = {path for path in files if path.name.endswith(".card.toml")}
    described = {path.with_name(path.name.removesuffix(".card.toml")) for path in cards}
    problems = []
    for path in sorted(described | {path for path in files if path.suffix != ".toml"}):
        try:
            datacards.verified(path)
        except datacards.DataCardError as error:
            problems.append(str(error).replace(f"{root}/", ""))
    return problems


def _git(root: Path, *arguments: str) -> bytes:
    """Return what git prints; raises RuntimeError where it fails."""
    result = subprocess.run(["git", *arguments], cwd=root, capture_output=True, check=False)
    if result.returncode:
        raise RuntimeError(f"git {arguments[0]} failed in {root}: {result.stderr.decode().strip()}")
    return result.stdout


CHECKS: dict[str, Callable[[], list[str]]] = {
    "README shows the committed scorecard": readme,
    "committed figures are what the run wrote": figures,
    "verdicts follow from the rules": scorecards,
    "every equation has a function and a test": equations,
    "data files are what their cards say": data,
}
"""Every check, by what it holds."""


def main(arguments: list[str] | None = None) -> int:
    """Run every check, print what failed, and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m soro_lib.workbook.check", description=__doc__)
    parser.add_argument(
        "--update-readme", action="store_true", help="first write the merged scorecard into README.md"
    )
    if parser.parse_args(arguments).update_readme:
        update_readme()
    failed = False
    for title, check in CHECKS.items():
        try:
            problems = check()
        except (OSError, RuntimeError, ValueError) as error:
            problems = [str(error)]
        print(f"{'FAILED' if problems else 'ok    '} {title}")
        for problem in problems:
            print("       - " + problem.replace("\n", "\n         "))
        failed = failed or bool(problems)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())

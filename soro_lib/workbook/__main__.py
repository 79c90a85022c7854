"""The command line of the workbook."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from soro_lib.project import ROOT, cores
from soro_lib.replication.tabular import TableError
from soro_lib.workbook import compare, golden
from soro_lib.workbook.display import Display
from soro_lib.workbook.generators import FILES, NothingToRun, generate
from soro_lib.workbook.notebooks import (
    Notebook,
    NotebookError,
    ParameterError,
    describe,
    find_notebooks,
    parameter_values,
    select,
)
from soro_lib.workbook.pages import export
from soro_lib.workbook.runner import AlreadyRunning, Places, Run, Stopped


def main(arguments: Sequence[str] | None = None, root: Path = ROOT) -> int:
    """Run, list, export or compare the notebooks of a project and return the exit status.

    Zero if all went well, 1 if a notebook failed or outputs differ, 2 if the request made no sense,
    128 + signal if stopped.
    """
    options = _parser().parse_args(arguments)
    try:
        if options.command == "compare":
            return _compare(options)
        if options.command == "digests":
            for name, digest in compare.digests(compare.outputs(root, options.quick)).items():
                print(f"{name},{digest}")
            return 0
        if options.command == "golden":
            reference = options.reference or golden.stated_commit()
            print(f"golden copy: {golden.build(reference, benchmark_runs=options.benchmarks)}")
            return 0
        if options.command == "unchanged":
            return _unchanged(options)
        if options.command == "generate":
            return generate(options.kind, options.output, options.small)
        notebooks = find_notebooks(root / "notebooks")
        if options.command == "list":
            print(describe(notebooks))
            return 0
        if options.command == "html":
            places = Places.of(root, options.output, options.quick, changed=False)
            print(f"open {export(notebooks, places)}")
            return 0
        return _run(options, notebooks, root)
    except (
        NotebookError,
        ParameterError,
        AlreadyRunning,
        NothingToRun,
        golden.GoldenError,
        TableError,
        OSError,
    ) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _run(options: argparse.Namespace, notebooks: Mapping[str, Notebook], root: Path) -> int:
    notebooks = select(notebooks, options.only)
    texts = dict(options.parameter)
    if texts and not options.only:
        concerned = [
            slug for slug, notebook in notebooks.items() if texts.keys() & notebook.parameters.keys()
        ]
        notebooks = select(notebooks, concerned)
    if options.quick:
        texts["quick"] = "True"
    parameters = parameter_values(notebooks, texts)
    places = Places.of(root, options.output, options.quick, changed=bool(options.parameter))
    display = Display()
    jobs = min(options.jobs, len(notebooks))
    run = Run(places, notebooks, parameters, jobs, options.force, options.timeout, display)
    try:
        outcomes = run.start()
    except Stopped as stopped:
        display.say(f"stopped by {stopped}: notebooks that had not ended left their old figures as they were")
        return 128 + stopped.signal_number
    display.close(outcomes)
    display.say(f"figures and tables: {places.figures}")
    return int(any(outcome.status == "failed" for outcome in outcomes))


def _compare(options: argparse.Namespace) -> int:
    before, after = (compare.outputs(place, options.quick) for place in (options.before, options.after))
    found = compare.differences(before, after, options.exact)
    stated = compare.load_exceptions(options.exceptions) if options.exceptions else []
    unstated = compare.without(found, stated)
    for difference in unstated:
        print(difference)
    files = len({difference.file for difference in unstated})
    print(f"{len(unstated)} differences in {files} files" if unstated else "no differences", end="")
    print(f" but for {len(found) - len(unstated)} stated ones" if len(found) > len(unstated) else "")
    return int(bool(unstated))


def _unchanged(options: argparse.Namespace) -> int:
    problems = golden.unchanged(options.quick)
    print("\n".join(problems) or f"nothing has changed since {golden.stated_commit()[:12]}")
    return int(bool(problems))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m soro_lib.workbook", description=main.__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="run the notebooks whose inputs have changed")
    run.add_argument("--only", action="append", default=[], metavar="SLUG", help="this notebook (repeatable)")
    run.add_argument("--jobs", type=_positive, default=cores(), metavar="N", help="how many at once")
    run.add_argument(
        "-p",
        "--parameter",
        nargs=2,
        action="append",
        default=[],
        metavar=("NAME", "VALUE"),
        help="set a parameter in every notebook that has it (repeatable); writes to build/custom",
    )
    run.add_argument("--force", action="store_true", help="run even what is up to date")
    run.add_argument("--timeout", type=_positive, metavar="SECONDS", help="longest time for one cell")
    commands.add_parser("list", help="print the notebooks and their parameters")
    html = commands.add_parser("html", help="export the executed notebooks with an index page")
    differ = commands.add_parser("compare", help="say what differs between two output folders")
    differ.add_argument("before", type=Path, help="folder of outputs, checkout or golden copy")
    differ.add_argument("after", type=Path, help="what to compare with it")
    differ.add_argument("--exact", action="store_true", help="compare numbers to the last digit")
    differ.add_argument(
        "--except",
        dest="exceptions",
        type=Path,
        metavar="FILE",
        help="CSV of stated exceptions: file, row, column (* for any), reason",
    )
    prints = commands.add_parser("digests", help="print the digest of every table and picture")
    copy = commands.add_parser("golden", help="keep all that a commit writes, tests, offers and costs")
    copy.add_argument("reference", nargs="?", help="commit in place of that of tests/golden/commit.toml")
    copy.add_argument(
        "--benchmarks",
        type=int,
        default=golden.BENCHMARK_RUNS,
        metavar="N",
        help="times to run the benchmarks, whose best counts; 0: leave them out",
    )
    same = commands.add_parser("unchanged", help="say what this checkout does otherwise than its golden copy")
    make = commands.add_parser("generate", help="fit the plants or simulate the recordings again")
    make.add_argument("kind", choices=list(FILES))
    make.add_argument("--small", action="store_true", help="all of the code, little of the data")
    for command in (run, html, differ, prints, same):
        command.add_argument("--quick", action="store_true", help="small parameters; in build/quick")
    for command in (run, html, make):
        command.add_argument("--output", type=Path, metavar="DIR", help="folder to write to")
    return parser


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"a positive whole number is needed, not {text!r}")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())

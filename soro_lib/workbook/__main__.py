"""Command line of the runner."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from soro_lib.project import ROOT
from soro_lib.workbook.display import Display
from soro_lib.workbook.execution import cores
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
    """Run, list or export the notebooks of a project and return the exit status.

    Zero if all went well, 1 if a notebook failed, 2 if the request made no sense, 128 + signal if stopped.
    """
    options = _parser().parse_args(arguments)
    try:
        notebooks = find_notebooks(root / "notebooks")
        if options.command == "list":
            print(describe(notebooks))
            return 0
        if options.command == "html":
            places = Places.of(root, options.output, options.quick, changed=False)
            print(f"open {export(notebooks, places)}")
            return 0
        return _run(options, notebooks, root)
    except (NotebookError, ParameterError, AlreadyRunning, OSError) as error:
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
    for command in (run, html):
        command.add_argument("--quick", action="store_true", help="small parameters; in build/quick")
        command.add_argument("--output", type=Path, metavar="DIR", help="folder in place of figures/")
    return parser


def _positive(text: str) -> int:
    if not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"a positive whole number is needed, not {text!r}")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())

"""`skyway compose`: problems in, plans out, one a line.

The planner is imported when a problem is there: other commands start without it.
"""

import sys
from enum import IntEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from skyway.cli.problem_lines import Document, NotJson, documents
from skyway.delivery.plan import Plan, PlanStatus
from skyway.errors import Fault, InvalidInput

if TYPE_CHECKING:
    from skyway.cli.problem_composer import ProblemComposer


class _ExitCode(IntEnum):
    """How the command ended; the worst line counts, in the order 2, 3, 0."""

    ALL_ANSWERED = 0
    SOME_UNREADABLE = 2
    SOME_UNKNOWN = 3


def compose_command(
    file: Annotated[
        typer.FileBinaryRead,
        typer.Argument(help="A problem, or JSON Lines with a problem a line; - is standard input."),
    ],
    strategy: Annotated[
        str | None,
        typer.Option(help="exact, heuristic or exhaustive, in place of the problem's own."),
    ] = None,
    time_limit: Annotated[
        float | None, typer.Option(help="Seconds for one problem, in place of its own limit.")
    ] = None,
) -> None:
    """Compose a plan for each problem in a file."""
    from skyway.cli.problem_composer import ProblemComposer

    composer = ProblemComposer(_overrides(strategy, time_limit))
    exit_codes = {_ExitCode.ALL_ANSWERED}
    for number, document in enumerate(documents(file), start=1):
        outcome = _outcome(composer, document)
        _clear_progress()
        if isinstance(outcome, Plan):
            typer.echo(outcome.model_dump_json())
            sys.stdout.flush()
            if outcome.status is PlanStatus.UNKNOWN:
                exit_codes.add(_ExitCode.SOME_UNKNOWN)
        else:
            exit_codes.add(_ExitCode.SOME_UNREADABLE)
            line, faults = outcome
            for fault in faults:
                typer.echo(f"line {line}: {fault}", err=True)
        _show_progress(number)
    _clear_progress()
    for code in (_ExitCode.SOME_UNREADABLE, _ExitCode.SOME_UNKNOWN):
        if code in exit_codes:
            raise typer.Exit(code)


def _overrides(strategy: str | None, time_limit_s: float | None) -> dict[str, Any]:
    from skyway.planner.compose import STRATEGIES
    from skyway.planner.problem import MAX_SECONDS

    if strategy is not None and strategy not in STRATEGIES:
        raise typer.BadParameter(
            f"{strategy!r} is not a strategy; there are {', '.join(STRATEGIES)}",
            param_hint="--strategy",
        )
    if time_limit_s is not None and not 0 < time_limit_s <= MAX_SECONDS:
        raise typer.BadParameter(
            f"{time_limit_s} is not above 0 and at most {MAX_SECONDS:g}", param_hint="--time-limit"
        )
    given = {"strategy": strategy, "time_limit_s": time_limit_s}
    return {name: value for name, value in given.items() if value is not None}


def _outcome(
    composer: "ProblemComposer", document: Document | NotJson
) -> Plan | tuple[int, list[Fault]]:
    """The plan; or the line, and what is wrong in it."""
    if isinstance(document, NotJson):
        return document.line, [Fault("problem", document.detail)]
    try:
        return composer.plan(document.value)
    except InvalidInput as error:
        return document.line, list(error.faults)


def _show_progress(number: int) -> None:
    """How many problems are done, for whoever looks at a terminal while plans go elsewhere."""
    if sys.stderr.isatty() and not sys.stdout.isatty():
        typer.echo(f"\r{number} problems done", nl=False, err=True)


def _clear_progress() -> None:
    if sys.stderr.isatty() and not sys.stdout.isatty():
        typer.echo("\r\x1b[K", nl=False, err=True)

"""`skyway compose`: reads problems, and prints a plan for each, one per line.

The planner is imported only by this command, because that takes time.
"""

import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO

import typer

from skyway.cli.data_folder import data_folder, keep_kernels
from skyway.errors import FieldFault, InvalidInput
from skyway.json_text import BrokenJson, json_value

if TYPE_CHECKING:
    from skyway.cli.problem_composer import ProblemComposer
    from skyway.delivery.plan import Plan


class _ExitCode(IntEnum):
    """How the command ended; the worst line decides, in the order 2, 3, 0."""

    ALL_ANSWERED = 0
    SOME_UNREADABLE = 2
    SOME_UNKNOWN = 3


@dataclass(frozen=True, slots=True)
class NotJson:
    """A text that is not JSON: the line of the error, counted from 1, and the error."""

    line: int
    detail: str


@dataclass(frozen=True, slots=True)
class Document:
    """A JSON value with the number of its first line, counted from 1."""

    line: int
    value: Any  # any JSON value


def compose_command(
    file: Annotated[
        typer.FileBinaryRead,
        typer.Argument(
            help="A problem, or JSON Lines with one problem per line; - is standard input."
        ),
    ],
    strategy: Annotated[
        str | None,
        typer.Option(help="exact, heuristic or exhaustive; replaces the problem's own strategy."),
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option(help="Seconds for one problem; replaces the problem's own limit."),
    ] = None,
) -> None:
    """Compose a plan for each problem in a file."""
    keep_kernels(data_folder())
    from skyway.cli.problem_composer import ProblemComposer
    from skyway.delivery.plan import Plan, PlanStatus

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
) -> "Plan | tuple[int, list[FieldFault]]":
    """The plan; or the line number and the faults of the problem."""
    if isinstance(document, NotJson):
        return document.line, [FieldFault("problem", document.detail)]
    try:
        return composer.plan(document.value)
    except InvalidInput as error:
        return document.line, list(error.faults)


def _show_progress(number: int) -> None:
    """Print the number of finished problems on the terminal, while plans go to a file."""
    if sys.stderr.isatty() and not sys.stdout.isatty():
        typer.echo(f"\r{number} problems done", nl=False, err=True)


def _clear_progress() -> None:
    if sys.stderr.isatty() and not sys.stdout.isatty():
        typer.echo("\r\x1b[K", nl=False, err=True)


def documents(file: BinaryIO) -> Iterator[Document | NotJson]:
    """The documents of a file, each as soon as it is read.

    When the first line is JSON by itself, each line is a document.
    """
    for number, line in enumerate(file, start=1):
        if not line.strip():
            continue
        first = _read(line, number)
        if isinstance(first, Document):
            yield first
            yield from _lines(file, first_line=number + 1)
        else:
            yield from _whole_or_lines(b"\n" * (number - 1) + line + file.read())
        return
    yield NotJson(1, "nothing to read")


def _whole_or_lines(raw: bytes) -> Iterator[Document | NotJson]:
    """One document over many lines, or one document per line with a broken first line."""
    whole = _read(raw, 1)
    if isinstance(whole, Document):
        yield whole
        return
    lines = raw.splitlines()
    # A broken single document has only one brace that is not indented.
    unindented = [line for line in lines if line[:1] == b"{"]
    if len(unindented) > 1 or any(isinstance(_read(line, 1), Document) for line in unindented):
        yield from _lines(lines, first_line=1)
    else:
        yield whole


def _lines(lines: Iterable[bytes], *, first_line: int) -> Iterator[Document | NotJson]:
    for number, line in enumerate(lines, start=first_line):
        if line.strip():
            yield _read(line, number)


def _read(raw: bytes, line: int) -> Document | NotJson:
    try:
        return Document(line, json_value(raw))
    except BrokenJson as error:
        return NotJson(line + error.line - 1, f"not JSON at column {error.column}")
    except ValueError as error:
        return NotJson(line, f"not JSON: {error}")

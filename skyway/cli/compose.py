"""`skyway compose`: problems in, plans out, one a line."""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, Never

import typer
from pydantic import ValidationError

from skyway.delivery.plan import Plan, PlanStatus
from skyway.errors import InvalidInput
from skyway.planner.compose import STRATEGIES, compose
from skyway.planner.problem import Problem


class _ExitCode(IntEnum):
    """How the command ended; the worst line counts, in the order 2, 3, 0."""

    ALL_ANSWERED = 0
    SOME_UNREADABLE = 2
    SOME_UNKNOWN = 3


@dataclass(frozen=True, slots=True)
class _Overrides:
    """What the command line puts in place of a problem's own fields."""

    strategy: str | None
    time_limit_s: float | None


class _Unreadable(Exception):
    """A line is not a problem; `faults` name the fields at fault, and what is wrong."""

    def __init__(self, faults: list[str], *, line: int) -> None:
        super().__init__("; ".join(faults))
        self.faults = faults
        self.line = line


def compose_command(
    file: Annotated[
        typer.FileBinaryRead,
        typer.Argument(help="A problem, or JSON Lines with a problem a line; - is standard input."),
    ],
    strategy: Annotated[
        str | None,
        typer.Option(help=f"In place of the problem's own: {', '.join(STRATEGIES)}."),
    ] = None,
    time_limit: Annotated[
        float | None, typer.Option(help="Seconds for one problem, in place of its own limit.")
    ] = None,
) -> None:
    """Compose a plan for each problem in a file."""
    if strategy is not None and strategy not in STRATEGIES:
        raise typer.BadParameter(
            f"{strategy!r} is not a strategy; there are {', '.join(STRATEGIES)}",
            param_hint="--strategy",
        )
    if time_limit is not None and not time_limit > 0:
        raise typer.BadParameter(f"{time_limit} is not above 0", param_hint="--time-limit")
    overrides = _Overrides(strategy, time_limit)
    exit_codes = {_ExitCode.ALL_ANSWERED}
    for line, document in _documents(file.read()):
        try:
            plan = _plan_for(document, line, overrides)
        except _Unreadable as unreadable:
            for fault in unreadable.faults:
                typer.echo(f"line {unreadable.line}: {fault}", err=True)
            exit_codes.add(_ExitCode.SOME_UNREADABLE)
            continue
        if plan.status is PlanStatus.UNKNOWN:
            exit_codes.add(_ExitCode.SOME_UNKNOWN)
        typer.echo(plan.model_dump_json())
        sys.stdout.flush()
    for code in (_ExitCode.SOME_UNREADABLE, _ExitCode.SOME_UNKNOWN):
        if code in exit_codes:
            raise typer.Exit(code)


def _documents(raw: bytes) -> Iterator[tuple[int, bytes]]:
    """Each document with the number of its first line: the whole file, or every line of it."""
    lines = raw.splitlines()
    if not _is_json_lines(raw, lines):
        yield 1, raw
        return
    for number, line in enumerate(lines, start=1):
        if line.strip():
            yield number, line


def _is_json_lines(raw: bytes, lines: list[bytes]) -> bool:
    """Whether lines are documents; a broken single document is told by its one opening brace."""
    if _is_json(raw):
        return False
    unindented = [line for line in lines if line[:1] == b"{"]
    return len(unindented) > 1 or any(_is_json(line) for line in unindented)


def _is_json(raw: bytes) -> bool:
    try:
        json.loads(raw)
    except (ValueError, RecursionError):
        return False
    return True


def _plan_for(raw: bytes, line: int, overrides: _Overrides) -> Plan:
    """The plan for one document; what is wrong with it is raised as `_Unreadable`."""
    document = _document(raw, line)
    if overrides.strategy is not None:
        document["strategy"] = overrides.strategy
    if overrides.time_limit_s is not None:
        document["time_limit_s"] = overrides.time_limit_s
    try:
        return compose(Problem.model_validate(document))
    except ValidationError as error:
        faults = [
            f"{'.'.join(map(str, fault['loc'])) or 'problem'}: {fault['msg']}"
            for fault in error.errors(include_url=False, include_context=False)
        ]
        raise _Unreadable(faults, line=line) from error
    except InvalidInput as error:
        raise _Unreadable([str(error)], line=line) from error


def _document(raw: bytes, line: int) -> dict[str, Any]:  # a JSON object, checked by Problem
    if not raw.strip():
        raise _Unreadable(["problem: nothing to read"], line=line)
    try:
        document = json.loads(raw, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        fault = f"problem: not JSON: {error.msg} at column {error.colno}"
        raise _Unreadable([fault], line=line + error.lineno - 1) from error
    except UnicodeDecodeError as error:
        raise _Unreadable([f"problem: not UTF-8: {error.reason}"], line=line) from error
    except (ValueError, RecursionError) as error:
        raise _Unreadable([f"problem: not JSON: {error}"], line=line) from error
    if not isinstance(document, dict):
        raise _Unreadable(["problem: not a JSON object"], line=line)
    return document


def _refuse_constant(name: str) -> Never:
    raise ValueError(f"{name} is not a number in JSON")

"""`skyway register`: the drones or batteries of a CSV file.

All rows are checked before the first is registered. The gateway checks them: a dry run names the
faults of some rows, and is repeated without these rows until no fault is left.
"""

import csv
import json
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import typer

from skyway.cli.data_folder import DataOption, data_folder
from skyway.cli.gateway import ask_gateway, call_gateway, fail
from skyway.cli.providers import ProviderOption, provider_path

register_app: Final = typer.Typer(
    help="Register the drones or batteries of a CSV file, or only check its rows.",
    no_args_is_help=True,
)

#: The most rows of a file: the most batteries that a provider may have.
_MOST_ROWS: Final = 100_000

#: The most rows of one call.
_CHUNK: Final = 500

#: After so many faults the rest of the file is not checked.
_MOST_FAULTS: Final = 100

_SEPARATORS: Final = (",", ";", "\t")

_FileArgument = Annotated[
    Path,
    typer.Argument(
        help="A CSV file in UTF-8 with a line of column names; comma, semicolon or tab between "
        "values.",
    ),
]
_DryRunOption = Annotated[
    bool, typer.Option("--dry-run", help="Only check all rows; register nothing.")
]


class _Kind(NamedTuple):
    """What a file lists: the path of its calls, its columns, and the column that is unique."""

    path: str
    required: tuple[str, ...]
    optional: tuple[str, ...]
    numbers: frozenset[str]
    unique: str


_DRONES: Final = _Kind(
    "/drones",
    ("model_id", "home_station_id"),
    ("name", "registration", "soc", "standby"),
    frozenset({"soc"}),
    "registration",
)
_BATTERIES: Final = _Kind(
    "/batteries", ("serial", "model_id"), ("capacity_j",), frozenset({"capacity_j"}), "serial"
)


class _Row(NamedTuple):
    """A row of the file by its line, and the JSON of its members."""

    line: int
    members: Mapping[str, Any]


@register_app.command("drones")
def register_drones(
    file: _FileArgument,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help="Where the drones' tokens and passwords are written."),
    ] = Path("fleet.json"),
    dry_run: _DryRunOption = False,
    provider: ProviderOption = None,
    data: DataOption = None,
) -> None:
    """Register drones: model_id and home_station_id, and name, registration, soc, standby.

    `skyway fleet` flies the drones of the written file.
    """
    if not dry_run and out.exists():
        fail(f"{out} exists: name another file with --out")
    sender = _Sender(_DRONES, data, provider)
    rows = sender.checked(file)
    if dry_run:
        return
    made: list[Any] = []
    for items in sender.registered(rows):
        made += items
        out.touch(mode=0o600)
        out.write_text(json.dumps({"items": made}))
    typer.echo(f"{len(made)} drones are registered; their tokens and passwords are in {out}")


@register_app.command("batteries")
def register_batteries(
    file: _FileArgument,
    dry_run: _DryRunOption = False,
    provider: ProviderOption = None,
    data: DataOption = None,
) -> None:
    """Register batteries: serial and model_id, and capacity_j."""
    sender = _Sender(_BATTERIES, data, provider)
    rows = sender.checked(file)
    if dry_run:
        return
    made = sum(len(items) for items in sender.registered(rows))
    typer.echo(f"{made} batteries are registered")


class _Sender:
    """Checks and registers rows for one provider."""

    def __init__(self, kind: _Kind, data: DataOption, provider: str | None) -> None:
        self.kind = kind
        self.folder = data_folder(data)
        self.path = provider_path(self.folder, provider) + kind.path

    def checked(self, file: Path) -> Sequence[_Row]:
        """All rows; the command ends and names each wrong row if there is any."""
        rows = _rows_of(file, self.kind)
        faults = [*_repeated(rows, self.kind.unique)]
        repeated = {fault.line for fault in faults}
        others = [row for row in rows if row.line not in repeated]
        for first in range(0, len(others), _CHUNK):
            faults += self._faults_of(others[first : first + _CHUNK], known=len(faults))
        if faults:
            more = "" if len(faults) < _MOST_FAULTS else "\nThe rows after that were not checked."
            lines = "\n".join(f"line {fault.line}, {fault.text}" for fault in sorted(faults))
            fail(f"{file}: nothing was registered\n{lines}{more}")
        typer.echo(f"{len(rows)} rows are good")
        return rows

    def registered(self, rows: Sequence[_Row]) -> Iterator[list[Any]]:
        """Register the rows, chunk by chunk, and yield the answers; of the gateway's JSON."""
        for first in range(0, len(rows), _CHUNK):
            answer = call_gateway(
                "POST",
                self.path,
                folder=self.folder,
                body=_body_of(rows[first : first + _CHUNK]),
                idempotency_key=str(uuid.uuid4()),
            )
            yield answer["items"]

    def _faults_of(self, rows: list[_Row], *, known: int) -> Iterator["_Fault"]:
        """The faults that the gateway finds in a chunk, until there are too many."""
        while rows and known < _MOST_FAULTS:
            path = f"{self.path}?dry_run=true"
            answer = ask_gateway("POST", path, folder=self.folder, body=_body_of(rows))
            if answer.is_success:
                return
            found = _places_in(answer.json())
            if not found:
                fail(f"POST {path} was answered {answer.status_code}: {answer.json()['detail']}")
            for index, text in found:
                yield _Fault(rows[index].line, text)
            known += len(found)
            wrong = {index for index, _ in found}
            rows = [row for index, row in enumerate(rows) if index not in wrong]


@dataclass(frozen=True, slots=True, order=True)
class _Fault:
    line: int
    text: str


def _body_of(rows: Sequence[_Row]) -> bytes:
    return json.dumps([row.members for row in rows]).encode()


def _places_in(problem: Mapping[str, Any]) -> list[tuple[int, str]]:
    """The place in the list, and the words, of each fault of a problem document."""
    found = []
    for error in problem.get("errors", ()):
        index, _, field = str(error["field"]).partition(".")
        if index.isdigit():
            found.append((int(index), f"{field}: {error['detail']}"))
    return found


def _repeated(rows: Sequence[_Row], column: str) -> Iterator[_Fault]:
    """Rows whose unique value stands in an earlier row; a call of the gateway has 500 rows."""
    first: dict[str, int] = {}
    for row in rows:
        value = row.members.get(column)
        if value is not None and first.setdefault(value, row.line) != row.line:
            yield _Fault(row.line, f"{column}: {value!r} stands in line {first[value]} too")


def _rows_of(file: Path, kind: _Kind) -> list[_Row]:
    """The rows of a file that have a value."""
    try:
        with file.open(encoding="utf-8-sig", newline="") as opened:
            header = opened.readline()
            names = _columns_of(header, file, kind)
            separator = _separator_of(header)
            rows = []
            reader = csv.reader(opened, delimiter=separator, strict=True)
            for values in reader:
                if any(value.strip() for value in values):
                    rows.append(_row_of(values, names, reader.line_num + 1, file, kind))
                if len(rows) > _MOST_ROWS:
                    fail(f"{file} has more than the limit of {_MOST_ROWS} rows")
    except OSError as error:
        fail(f"{file} cannot be read: {error.strerror}")
    except (UnicodeDecodeError, csv.Error) as error:
        fail(f"{file} is no CSV file in UTF-8: {error}")
    if not rows:
        fail(f"{file} has no rows below its column names")
    return rows


def _separator_of(header: str) -> str:
    return max(_SEPARATORS, key=header.count)


def _columns_of(header: str, file: Path, kind: _Kind) -> list[str]:
    names = [name.strip() for name in next(csv.reader([header], delimiter=_separator_of(header)))]
    known = (*kind.required, *kind.optional)
    wrong = [name for name in names if name not in known or names.count(name) > 1]
    missing = [name for name in kind.required if name not in names]
    if wrong or missing:
        fault = f"column {wrong[0]!r} is not known or stands twice" if wrong else ""
        fault = fault or f"column {missing[0]!r} is missing"
        fail(f"{file}, line 1: {fault}; the columns are {', '.join(known)}")
    return names


def _row_of(
    values: Sequence[str], names: Sequence[str], line: int, file: Path, kind: _Kind
) -> _Row:
    if len(values) != len(names):
        fail(f"{file}, line {line}: {len(values)} values for {len(names)} columns")
    members: dict[str, Any] = {}
    for name, text in zip(names, values, strict=True):
        value: str | float = text.strip()
        if value and name in kind.numbers:
            try:
                value = float(value)
            except ValueError:
                fail(f"{file}, line {line}, {name}: {text!r} is no number")
        if value != "":
            members[name] = value
    return _Row(line, members)

"""`skyway schedule`: what drones and pads will do, drawn as text.

The drawing is a Gantt: rows of bars on one axis of fleet time, in plain characters.
"""

import json
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import call_gateway, fail, list_items
from skyway.cli.providers import drone_labels, provider_path

#: The characters of a mission's service that its drone knows, of one that waits, and of standby.
_SERVICE, _QUEUED, _STANDBY, _PAD = "#", "=", ".", "#"

_LEGEND: Final = (
    f"fleet time, UTC   {_SERVICE} service   {_QUEUED} service, queued   {_STANDBY} standby"
)

_PAD_LEGEND: Final = f"fleet time, UTC   {_PAD} reserved"

#: Columns of the bars in a narrow terminal.
_LEAST_COLUMNS: Final = 40

#: Columns for ids and notes beside the bars.
_BESIDE: Final = 76

#: Distances between two marks of the axis, the shortest first.
_MARKS: Final = tuple(
    timedelta(minutes=minutes) for minutes in (1, 5, 15, 30, 60, 120, 180, 360, 720, 1440, 2880)
)

#: Characters between two marks, at least: a mark's text is 11 characters long.
_MARK_CHARACTERS: Final = 13


@dataclass(frozen=True, slots=True)
class Bar:
    """A span of a row, drawn with one character; later bars cover earlier ones."""

    start_at: datetime
    end_at: datetime
    character: str


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the Gantt: its label, its bars, and a note behind them."""

    label: str
    bars: tuple[Bar, ...]
    note: str = ""


def schedule_command(
    drone: Annotated[str | None, typer.Option(metavar="ID", help="Only this drone.")] = None,
    provider: Annotated[
        str | None,
        typer.Option(metavar="ID", help="Only the drones of this provider, by id or by name."),
    ] = None,
    station: Annotated[
        str | None, typer.Option(metavar="ID", help="The pads of this station instead.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the gateway's answer as JSON.")
    ] = False,
    data: DataOption = None,
) -> None:
    """Draw the calendars of drones, or of a station's pads: a line for each, in fleet time."""
    if sum(each is not None for each in (drone, provider, station)) > 1:
        fail("give only one of --drone, --provider and --station")
    folder = data_folder(data)
    if station is not None:
        items = [*list_items(folder, f"/v1/stations/{quote(station, safe='')}/reservations")]
        rows, legend = _pad_rows(items), _PAD_LEGEND
    else:
        items, labels = _drone_schedules(folder, drone, provider, has_labels=not as_json)
        rows, legend = [_drone_row(each, labels) for each in items], _LEGEND
    if as_json:
        is_one = drone is not None
        typer.echo(json.dumps(items[0] if is_one else {"items": items}, indent=2))
        return
    for line in _drawn(rows, legend):
        typer.echo(line)


def _drone_schedules(
    folder: DataFolder, drone: str | None, provider: str | None, *, has_labels: bool
) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """The schedules of one drone, of one provider's drones, or of all; and the drones' labels."""
    if drone is not None:
        path = f"/v1/drones/{quote(drone, safe='')}/schedule"
        return [call_gateway("GET", path, folder=folder)], {}
    if provider is not None:
        paths = [provider_path(folder, provider)]
    else:
        listed = list_items(folder, "/v1/providers")
        paths = [f"/v1/providers/{each['provider_id']}" for each in listed]
    schedules = [one for path in paths for one in list_items(folder, f"{path}/schedule")]
    labels: dict[str, str] = {}
    for path in paths if has_labels else ():
        labels |= drone_labels(folder, path)
    return schedules, labels


def _drone_row(schedule: dict[str, Any], labels: Mapping[str, str]) -> Row:
    """A drone's line; a service covers the standby before it."""
    entries = schedule["entries"]
    standbys = [
        Bar(_moment(each["service"]["served_at"]), _moment(each["standby"]["until_at"]), _STANDBY)
        for each in entries
    ]
    services = [
        Bar(
            _moment(each["service"]["start_at"]),
            _moment(each["service"]["served_at"]),
            _QUEUED if each["state"] == "QUEUED" else _SERVICE,
        )
        for each in entries
    ]
    drone_id = schedule["drone_id"]
    return Row(labels.get(drone_id, drone_id), (*standbys, *services), _free(schedule))


def _free(schedule: dict[str, Any]) -> str:
    free = schedule["free_from"]
    if free is None:
        return "" if schedule["entries"] else "free"
    return f"free {_moment(free['at']):%m-%d %H:%M} {free['station_id']} {free['soc']:.0%}"


def _pad_rows(reservations: list[dict[str, Any]]) -> list[Row]:
    pads = sorted({each["pad"] for each in reservations})
    return [
        Row(
            f"pad {pad}",
            tuple(
                Bar(_moment(each["start_at"]), _moment(each["end_at"]), _PAD)
                for each in reservations
                if each["pad"] == pad
            ),
        )
        for pad in pads
    ]


def _drawn(rows: list[Row], legend: str) -> list[str]:
    bars = [bar for row in rows for bar in row.bars]
    if not bars:
        return [*(f"{row.label} {row.note}" for row in rows), "nothing is planned"]
    columns = max(_LEAST_COLUMNS, shutil.get_terminal_size().columns - _BESIDE)
    lines = gantt_lines(
        rows,
        start_at=min(bar.start_at for bar in bars),
        end_at=max(bar.end_at for bar in bars),
        columns=columns,
    )
    return [legend, *lines]


def _moment(text: str) -> datetime:
    return datetime.fromisoformat(text)


def gantt_lines(
    rows: Sequence[Row], *, start_at: datetime, end_at: datetime, columns: int
) -> list[str]:
    """The axis and one line for each row; bars are at most `columns` characters wide.

    A bar has at least one character. Bars outside the axis are left out.
    """
    span = max(end_at - start_at, timedelta(minutes=1))
    axis = _Axis(start_at, span, columns)
    width = max((len(row.label) for row in rows), default=0)
    return [
        f"{'':{width}} {axis.marks()}".rstrip(),
        *(f"{row.label:{width}} {axis.drawn(row.bars)} {row.note}".rstrip() for row in rows),
    ]


@dataclass(frozen=True, slots=True)
class _Axis:
    """Columns of equal duration from `start_at` on."""

    start_at: datetime
    span: timedelta
    columns: int

    def _column(self, moment: datetime) -> int:
        return int((moment - self.start_at) / self.span * self.columns)

    def drawn(self, bars: Iterable[Bar]) -> str:
        """The bars as one text."""
        cells = [" "] * self.columns
        for bar in bars:
            if bar.end_at < self.start_at or bar.start_at > self.start_at + self.span:
                continue
            first = min(max(0, self._column(bar.start_at)), self.columns - 1)
            last = min(max(first + 1, self._column(bar.end_at)), self.columns)
            cells[first:last] = bar.character * (last - first)
        return "".join(cells)

    def marks(self) -> str:
        """Moments above their columns, as "03-01 12:30"."""
        least = self.span * _MARK_CHARACTERS / self.columns
        apart = next((each for each in _MARKS if each >= least), _MARKS[-1])
        midnight = self.start_at.replace(hour=0, minute=0, second=0, microsecond=0)
        mark_at = midnight + apart * -((midnight - self.start_at) // apart)
        text = ""
        while (column := self._column(mark_at)) < self.columns:
            if not text or column >= len(text) + 2:
                text = f"{text:{column}}{mark_at:%m-%d %H:%M}"
            mark_at += apart
        return text

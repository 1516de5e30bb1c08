"""The screen of `skyway top`: drones, missions, deliveries and alarms until Ctrl-C."""

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from types import TracebackType
from typing import Any, Final, Self

import httpx
from rich.columns import Columns
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from skyway.errors import SkywayError


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm that nobody has acknowledged; `about` is a drone, mission or station."""

    at: str
    level: str
    code: str
    about: str
    detail: str


@dataclass(frozen=True, slots=True)
class Picture:
    """The numbers of one read; rates are None in the first."""

    url: str
    at: str
    drones: Mapping[str, int]
    missions: Mapping[str, int]
    deliveries: Mapping[str, int]
    #: Requests that wait for a drone, by how long they have waited.
    waiting: Mapping[str, int]
    #: When the next busy drone can begin another mission; None if that is not known.
    next_free_at: str | None
    alarms: tuple[Alarm, ...]
    lag_mean_s: float | None
    lag_max_s: float | None
    states_per_s: float | None
    samples_per_s: float | None
    recompositions: int | None  # unknown without the metrics key
    unsent: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class MessageCounts:
    """How many messages drones had sent at a moment of the machine's monotonic clock."""

    at_s: float
    states: int
    samples: int

    def states_since(self, earlier: "MessageCounts") -> float:
        """States per second; never negative, although a restarted agent counts from 1 again."""
        return max(0, self.states - earlier.states) / (self.at_s - earlier.at_s)

    def samples_since(self, earlier: "MessageCounts") -> float:
        """Samples per second."""
        return max(0, self.samples - earlier.samples) / (self.at_s - earlier.at_s)


#: Wall seconds for an answer, and how many alarms are shown.
_TIMEOUT_S: Final = 10.0
_ALARMS: Final = 8

#: Wall seconds between two reads of a day's deliveries, which take longer than everything else.
_DELIVERIES_EVERY_S: Final = 5.0

_EVENTS: Final = "skyway_delivery_events_total"
_REPLANNED: Final = 'type="delivery.replanned"'


class NoAnswer(SkywayError):
    """The gateway does not answer, or answers with a problem."""


class TopReader:
    """Reads one picture after another; rates come from the last two."""

    def __init__(
        self,
        url: str,
        *,
        key: str,
        metrics_key: str | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self._url = url
        self._metrics_key = metrics_key
        self._client = httpx.Client(
            base_url=url,
            headers={"Authorization": f"Bearer {key}"},
            timeout=_TIMEOUT_S,
            transport=transport,
        )
        self._deliveries: Mapping[str, int] = {}
        self._waiting: Mapping[str, int] = {}
        self._deliveries_due_s = 0.0
        self._before: MessageCounts | None = None

    def __enter__(self) -> Self:
        self._client.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._client.close()

    def read(self) -> Picture:
        """The numbers of this moment.

        Raises
        ------
        NoAnswer
            The gateway cannot be reached, or refuses.
        """
        fleets = self._ask("/v1/stats/fleets").json()
        counts = MessageCounts(time.monotonic(), states=fleets["states"], samples=fleets["samples"])
        before, self._before = self._before, counts
        missions = self._ask("/v1/stats/missions").json()
        self._read_deliveries()
        alarms = self._ask(f"/v1/alarms?state=OPEN&limit={_ALARMS}").json()["items"]
        return Picture(
            url=self._url,
            at=fleets["at"],
            drones=fleets["by_state"],
            missions=missions["by_state"],
            deliveries=self._deliveries,
            waiting=self._waiting,
            next_free_at=fleets["next_free_at"],
            alarms=tuple(_alarm(alarm) for alarm in alarms),
            lag_mean_s=fleets["lag_mean_s"],
            lag_max_s=fleets["lag_max_s"],
            states_per_s=None if before is None else counts.states_since(before),
            samples_per_s=None if before is None else counts.samples_since(before),
            recompositions=self._recompositions(),
            unsent=missions["unsent"],
        )

    def _read_deliveries(self) -> None:
        """Read deliveries and waiting requests again if they were read long ago."""
        now_s = time.monotonic()
        if now_s >= self._deliveries_due_s:
            found = self._ask("/v1/stats/deliveries").json()
            self._deliveries = found["by_state"]
            # Only operators and customers see what waits: nobody's drone has it yet.
            self._waiting = _by_age(found["waiting"]["by_age"]) if found["waiting"] else {}
            self._deliveries_due_s = now_s + _DELIVERIES_EVERY_S

    def _recompositions(self) -> int | None:
        if self._metrics_key is None:
            return None
        headers = {"Authorization": f"Bearer {self._metrics_key}"}
        return _replanned(self._ask("/metrics", headers=headers).text)

    def _ask(self, path: str, headers: Mapping[str, str] | None = None) -> httpx.Response:
        try:
            answer = self._client.get(path, headers=headers)
        except (httpx.TransportError, httpx.InvalidURL) as error:
            why = f"no answer from {self._url}: {error}. Is `skyway up` running?"
            raise NoAnswer(why) from error
        if not answer.is_success:
            raise NoAnswer(f"GET {path} was answered {answer.status_code}: {answer.text}")
        return answer


def _by_age(ages: Sequence[Mapping[str, Any]]) -> Mapping[str, int]:  # ages as JSON
    """The number of requests of each age, in words; the last age has no end."""
    words, longest_min = {}, 0.0
    for age in ages:
        if age["up_to_s"] is not None:
            longest_min = age["up_to_s"] / 60
            words[f"up to {longest_min:g} min"] = age["requests"]
        else:
            words[f"over {longest_min:g} min"] = age["requests"]
    return words


def _alarm(row: Mapping[str, Any]) -> Alarm:  # an alarm as JSON
    return Alarm(
        at=row["at"],
        level=row["level"],
        code=row["code"],
        about=row["drone_id"] or row["mission_id"] or row["station_id"] or "",
        detail=row["detail"],
    )


def _replanned(metrics: str) -> int:
    """How many replans were announced to customers since the gateway's start."""
    replanned = [
        float(line.rpartition(" ")[2])
        for line in metrics.splitlines()
        if line.startswith(_EVENTS) and _REPLANNED in line
    ]
    return int(sum(replanned))


#: Wall seconds between two reads.
_EVERY_S = 1.0

_LEVELS: Final = {"CRITICAL": "bold red", "URGENT": "red", "WARNING": "yellow"}

#: The order of states on the screen; other states come last.
_ORDERS: Final = {
    "drones": (
        "AVAILABLE",
        "RESERVED",
        "ON_MISSION",
        "RECHARGING",
        "OFFLINE",
        "MAINTENANCE",
        "GROUNDED",
        "REGISTERED",
    ),
    "missions": ("BOOKED", "ACCEPTED", "ACTIVE"),
    "deliveries, 24 h": (
        "SCHEDULED",
        "REQUESTED",
        "PLANNED",
        "DISPATCHED",
        "LOADING",
        "IN_PROGRESS",
        "COMPLETED",
        "PARTIALLY_COMPLETED",
        "CANCELLED",
        "FAILED",
        "REJECTED",
    ),
}


def watch(reader: TopReader, *, once: bool) -> None:
    """Show the screen until Ctrl-C; or once, the second of two reads, because rates need two."""
    reader.read()
    if once:
        time.sleep(_EVERY_S)
        console = Console()
        console.print(TopScreen(console).shown(reader.read()))
        return
    with suppress(KeyboardInterrupt), TopScreen(Console()) as screen:
        while True:
            due_s = time.monotonic() + _EVERY_S
            try:
                screen.show(reader.read())
            except NoAnswer as error:
                screen.show_silence(str(error))
            time.sleep(max(0.0, due_s - time.monotonic()))


class TopScreen:
    """A live screen in a terminal; otherwise one picture after another."""

    def __init__(self, console: Console) -> None:
        self._live = Live(console=console, auto_refresh=False, screen=console.is_terminal)
        self._last: RenderableType = ""

    def __enter__(self) -> "TopScreen":
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, picture: Picture) -> None:
        """Show this picture instead of the previous one."""
        self._last = self.shown(picture)
        self._live.update(self._last, refresh=True)

    def show_silence(self, why: str) -> None:
        """Keep the last picture, and show why there is no new one."""
        self._live.update(Group(Text(why, style="bold red"), self._last), refresh=True)

    def shown(self, picture: Picture) -> RenderableType:
        """The whole screen."""
        heading = Text.assemble(
            ("Skyway ", "bold"), f"{picture.url}  fleet time {_clock(picture.at)}"
        )
        free = ""
        if picture.next_free_at is not None:
            free = f"next busy drone free in {_between(picture.at, picture.next_free_at)}"
        counts = {
            "drones": picture.drones,
            "missions": picture.missions,
            "deliveries, 24 h": picture.deliveries,
            "requests that wait": picture.waiting,
        }
        tables = [_count_table(name, counted) for name, counted in counts.items()]
        return Group(
            heading,
            free,
            "",
            Columns([*tables, _message_table(picture)], padding=(0, 3)),
            "",
            _alarm_list(picture.alarms),
        )


def _count_table(name: str, counted: Mapping[str, int]) -> Table:
    table = Table(box=None, header_style="bold", padding=(0, 1))
    table.add_column(name)
    table.add_column(f"{sum(counted.values()):,}", justify="right")
    order = _ORDERS.get(name, tuple(counted))
    for state in (*order, *sorted(counted.keys() - set(order))):
        if counted.get(state):
            table.add_row(state, f"{counted[state]:,}")
    return table


def _message_table(picture: Picture) -> Table:
    table = Table(box=None, header_style="bold", padding=(0, 1))
    table.add_column("messages of drones")
    table.add_column("", justify="right")
    table.add_row("states per second", _number(picture.states_per_s))
    table.add_row("samples per second", _number(picture.samples_per_s))
    table.add_row("lag of the newest, mean", _seconds(picture.lag_mean_s))
    table.add_row("lag of the newest, max", _seconds(picture.lag_max_s))
    if picture.recompositions is not None:
        table.add_row("recompositions", f"{picture.recompositions:,}")
    for channel, number in sorted(picture.unsent.items()) or [("all", 0)]:
        table.add_row(f"waiting to leave, {channel}", f"{number:,}")
    return table


def _alarm_list(alarms: tuple[Alarm, ...]) -> RenderableType:
    """Two lines for each alarm, so that long ids and details fit on a narrow screen."""
    if not alarms:
        return Text("no open alarms", style="dim")
    lines: list[RenderableType] = [Text(" newest alarms", style="bold")]
    for alarm in alarms:
        level = (alarm.level, _LEVELS.get(alarm.level, ""))
        words = Text.assemble(_clock(alarm.at), "  ", level, f"  {alarm.code}  {alarm.about}")
        lines += [Padding(words, (0, 1)), Padding(alarm.detail, (0, 1, 0, 11))]
    return Group(*lines)


def _clock(moment: str) -> str:
    return datetime.fromisoformat(moment).strftime("%H:%M:%S")


def _between(start: str, end: str) -> str:
    """The time between two moments, as hours, minutes and seconds."""
    span_s = (datetime.fromisoformat(end) - datetime.fromisoformat(start)).total_seconds()
    whole_s = max(0, round(span_s))
    return f"{whole_s // 3600}:{whole_s % 3600 // 60:02}:{whole_s % 60:02}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:,.1f}"


def _seconds(value_s: float | None) -> str:
    return "" if value_s is None else f"{value_s:.2f} s"

"""The screen of `skyway top`: drones, missions, deliveries and alarms until Ctrl-C."""

import time
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from typing import Final

from rich.columns import Columns
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from skyway.cli.top_reader import Alarm, NoAnswer, Picture, TopReader

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

"""How far a delivery is: one line that people see at a terminal below the delivery's events."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from rich.console import Console
from rich.text import Text

_MINUTE_S: Final = 60.0


def progress_text(delivery: Mapping[str, Any], now: datetime) -> str:
    """What the delivery does, how much is delivered, and when the next package comes.

    `delivery` is the delivery as the gateway shows it to its customer; `now` is fleet time.
    """
    packages = delivery["packages"]
    delivered = sum(each["delivered_at"] is not None for each in packages)
    doing = (delivery["activity"] or delivery["state"]).replace("_", " ").lower()
    text = f"{doing}, {delivered} of {len(packages)} delivered"
    expected = [
        (datetime.fromisoformat(each["eta_at"]), each["package_id"])
        for each in packages
        if each["eta_at"] and not each["delivered_at"]
    ]
    if not expected:
        return text
    eta_at, package_id = min(expected)
    return f"{text}; {package_id} comes at {eta_at:%H:%M:%S}, {_left(eta_at, now)}"


def _left(eta_at: datetime, now: datetime) -> str:
    left_s = (eta_at - now).total_seconds()
    if left_s < -_MINUTE_S:
        return f"{-left_s / _MINUTE_S:.0f} min overdue"
    if left_s < 0:
        return "any moment now"
    if left_s < _MINUTE_S:
        return f"in {left_s:.0f} s"
    return f"in {left_s / _MINUTE_S:.0f} min"


@dataclass(slots=True)
class ProgressLine:
    """The line at a terminal, which counts down by itself; `show` takes another delivery."""

    now: Callable[[], datetime]
    _delivery: Mapping[str, Any] | None = None

    def show(self, delivery: Mapping[str, Any]) -> None:
        """Show this delivery from now on."""
        self._delivery = delivery

    def __rich__(self) -> Text:
        """The line, as rich asks for it several times a second."""
        return Text("" if self._delivery is None else progress_text(self._delivery, self.now()))


@contextmanager
def progress_line(console: Console, now: Callable[[], datetime]) -> Iterator[ProgressLine]:
    """The line, below all that is printed while the block lasts."""
    line = ProgressLine(now)
    with console.status(line):
        yield line

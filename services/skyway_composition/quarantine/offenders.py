"""Offenders: senders whose messages had to be set aside, and what follows.

Each set-aside message adds to the level of its sender, and the level falls with time. Above the
first limit the sender is slowed: its set-aside messages are counted and not kept. Above the second
limit it is put out: none of its messages is read for `PUT_OUT_FOR`. After that its level is zero.
This is kept in memory: a restart of the process pardons everybody.
"""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final, Literal

#: Provider and drone, as a topic names them.
Sender = tuple[str, str]

Standing = Literal["NORMAL", "SLOWED", "PUT_OUT"]

#: The levels above which a sender is slowed and put out. Our own choice: a drone with one faulty
#: message in each of its states stays below the first.
SLOWED_ABOVE: Final = 10.0
PUT_OUT_ABOVE: Final = 100.0
#: By how much a level falls in one second of wall time.
_FALL_PER_S: Final = 1 / 30
#: Wall time for which no message of a sender is read.
PUT_OUT_FOR: Final = timedelta(minutes=10)
#: The most senders that are remembered; the longest-known ones are forgotten first.
_MOST_SENDERS: Final = 20_000


@dataclass(frozen=True, slots=True)
class _Record:
    level: float
    at: datetime

    def level_at(self, now: datetime) -> float:
        return max(0.0, self.level - _FALL_PER_S * (now - self.at).total_seconds())


class Offenders:
    """The levels of all senders of which a message was set aside; moments are wall time."""

    def __init__(self) -> None:
        self._records: dict[Sender, _Record] = {}
        self._put_out: dict[Sender, datetime] = {}

    def note(self, sender: Sender, weight: float, *, now: datetime) -> Standing:
        """Add a set-aside message; the result is the standing of the sender from now on."""
        known = self._records.pop(sender, None)
        level = weight + (0.0 if known is None else known.level_at(now))
        if level > PUT_OUT_ABOVE:
            self._put_out[sender] = now
            return "PUT_OUT"
        self._records[sender] = _Record(level, now)
        while len(self._records) > _MOST_SENDERS:
            del self._records[next(iter(self._records))]
        return "SLOWED" if level > SLOWED_ABOVE else "NORMAL"

    def is_put_out(self, sender: Sender, *, now: datetime) -> bool:
        """Whether no message of this sender is read now."""
        since = self._put_out.get(sender)
        if since is None:
            return False
        if now - since < PUT_OUT_FOR:
            return True
        del self._put_out[sender]
        return False

    def put_out(self, *, now: datetime) -> list[Sender]:
        """The senders of which no message is read now."""
        return [each for each in [*self._put_out] if self.is_put_out(each, now=now)]

    def pardon(self, sender: Sender) -> None:
        """Read the messages of a sender again, as if nothing of it had been set aside."""
        self._put_out.pop(sender, None)
        self._records.pop(sender, None)

"""What all viewers of one scope share: its part of the picture, and the last changes as frames."""

import asyncio
from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from skyway_gateway.live.picture import Change, Key, Kind, Picture, Tick, as_json
from skyway_gateway.live.scope import Scope

#: Wall seconds between two looks.
LOOK_EVERY_S: Final = 0.3
#: Wall seconds for which changes are kept for viewers who were away or are slow.
_KEPT_S: Final = 60.0
#: The looks of this time; a look makes one frame at most.
KEPT_LOOKS: Final = round(_KEPT_S / LOOK_EVERY_S)
#: The size of the frames that are kept, at most.
_MOST_BYTES: Final = 2 * 2**20


class TooSlow(Exception):
    """A viewer is further behind than the frames that are kept."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A server-sent event, with the number of its tick."""

    number: int
    content: bytes


@dataclass(slots=True)
class View:
    """The part of the picture in one scope; `epoch` names the run of this process.

    Ids of events are `epoch-number`, so numbers of an earlier run are recognised.
    """

    scope: Scope
    epoch: str
    viewers: int = 0
    #: Set by the next frame, and replaced by another one.
    changed: asyncio.Event = field(default_factory=asyncio.Event)
    _visible: set[Key] = field(default_factory=set)
    _frames: deque[Frame] = field(default_factory=deque)
    _bytes: int = 0
    _complete_since: int = 0
    _snapshot: Frame | None = None

    @property
    def size(self) -> int:
        """How many items are visible."""
        return len(self._visible)

    def begin(self, picture: Picture) -> None:
        """Show the picture as it is; earlier numbers cannot be resumed."""
        self._visible = set(self.scope.part_of(picture))
        self._complete_since = picture.number

    def apply(self, tick: Tick) -> None:
        """Make the frame of these changes, if any of them is in this scope, and wake viewers."""
        self._snapshot = None  # a view may be one of hundreds
        members: dict[Kind, list[str]] = defaultdict(list)
        for change in self.scope.changes_in(tick):
            member = self._member(change)
            if member is not None:
                members[change.key.kind].append(member)
        if not members:
            return
        self._append(Frame(tick.number, _event("change", self.epoch, tick.number, members)))
        earlier, self.changed = self.changed, asyncio.Event()
        earlier.set()

    def has_snapshot(self, picture: Picture) -> bool:
        """Whether the snapshot of the present picture is made already."""
        return self._snapshot is not None and self._snapshot.number == picture.number

    def snapshot(self, picture: Picture) -> Frame:
        """The whole view as one event, made once for all who come between two ticks."""
        if self._snapshot is None or self._snapshot.number != picture.number:
            members: dict[Kind, list[str]] = defaultdict(list)
            for key, item in self.scope.part_of(picture).items():
                members[key.kind].append(Change(key, None, item).whole)
            content = _event("snapshot", self.epoch, picture.number, members)
            self._snapshot = Frame(picture.number, content)
        return self._snapshot

    def frames_after(self, number: int) -> list[Frame]:
        """The frames of all later ticks.

        Raises
        ------
        TooSlow
            Some of them are kept no more.
        """
        if number < self._complete_since:
            raise TooSlow
        return [frame for frame in self._frames if frame.number > number]

    def can_resume(self, epoch: str, number: int, *, latest: int) -> bool:
        """Whether a viewer who has seen this number can go on from there."""
        return epoch == self.epoch and self._complete_since <= number <= latest

    def _member(self, change: Change) -> str | None:
        was_visible = change.key in self._visible
        if change.after is not None and self.scope.sees(change.key, change.after):
            if was_visible:
                return change.patch
            self._visible.add(change.key)
            return change.whole
        if was_visible:
            self._visible.discard(change.key)
            return change.removal
        return None

    def _append(self, frame: Frame) -> None:
        self._frames.append(frame)
        self._bytes += len(frame.content)
        while len(self._frames) > KEPT_LOOKS or (
            self._bytes > _MOST_BYTES and len(self._frames) > 1
        ):
            oldest = self._frames.popleft()
            self._bytes -= len(oldest.content)
            self._complete_since = oldest.number


def _event(name: str, epoch: str, number: int, members: dict[Kind, list[str]]) -> bytes:
    kinds: Iterable[str] = (
        f"{as_json(kind)}:{{{','.join(texts)}}}" for kind, texts in members.items()
    )
    return f"id: {epoch}-{number}\nevent: {name}\ndata: {{{','.join(kinds)}}}\n\n".encode()

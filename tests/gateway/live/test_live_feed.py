"""The feed reads only while anybody looks, and goes on when a service is away."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any

from pydantic_core import to_jsonable_python
from skyway_gateway.live.feed import LiveFeed
from skyway_gateway.live.picture import OPERATORS, Item, Key, Picture
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.view import KEPT_LOOKS, View
from skyway_gateway.live.viewer_frames import ViewerFrames, event_seen

from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.identity import Caller
from tests.gateway.live.merged import event_of, shown_after

SCOPE = Scope.of(Caller("operator", "op"), kinds=None, bbox=None)
OTHER_SCOPE = Scope.of(Caller("operator", "op"), kinds="drones", bbox=None)

#: A minute and a little more.
LOOKS_UNTIL_FORGOTTEN = KEPT_LOOKS + 10


@dataclass
class Counter:
    """A source with one item, which changes with each look unless it is steady."""

    name: str = "registry"
    drone_id: str = "drn_1"
    is_steady: bool = False
    is_away: bool = False
    looks: int = 0
    forgotten: int = 0

    async def read(self, picture: Picture) -> None:
        if self.is_away:
            raise ServiceUnavailable(self.name, "it is away in this test")
        self.looks += 1
        looks = 1 if self.is_steady else self.looks
        shown = Key("drones", self.drone_id), Item({"looks": looks}, OPERATORS)
        picture.put([shown])

    def forget(self) -> None:
        self.forgotten += 1


@dataclass
class Viewer:
    """A viewer who reads its events one by one."""

    feed: LiveFeed
    view: View
    last_event_id: str | None = None
    is_known: bool = True
    frames: list[bytes] = field(default_factory=list)

    def __post_init__(self) -> None:
        frames = ViewerFrames(
            self.feed, event_seen(self.last_event_id), self._may_read, check_s=0.01
        )
        self._events = frames.of(self.view)

    async def _may_read(self) -> bool:
        return self.is_known

    async def read(self) -> tuple[str, str, Any]:
        """The next event."""
        self.frames.append(await anext(self._events))
        return event_of(self.frames[-1])


@asynccontextmanager
async def viewed(feed: LiveFeed) -> AsyncIterator[View]:
    """A view after the first look, while the block lasts."""
    viewing = feed.viewing(SCOPE)
    opened = asyncio.create_task(viewing.__aenter__())
    await asyncio.sleep(0)
    await feed.step()
    yield await opened
    await viewing.__aexit__(None, None, None)


async def test_nothing_is_read_without_viewers() -> None:
    source = Counter()
    feed = LiveFeed((source,))

    await feed.step()
    assert source.looks == 0
    async with asyncio.TaskGroup() as group:
        group.create_task(feed.step())
        async with feed.viewing(SCOPE):
            pass
    await feed.step()

    assert source.looks >= 1


async def test_the_picture_is_forgotten_a_minute_after_the_last_viewer() -> None:
    source = Counter()
    feed = LiveFeed((source,))
    async with viewed(feed):
        pass

    for _ in range(LOOKS_UNTIL_FORGOTTEN):
        await feed.step()
    looks = source.looks
    await feed.step()

    assert (source.looks, source.forgotten) == (looks, 1)
    async with viewed(feed) as view:
        viewer = Viewer(feed, view)
        assert (await viewer.read())[2]["drones"] == {"drn_1": {"looks": looks + 1}}


async def test_a_viewer_gets_a_snapshot_and_then_each_change() -> None:
    feed = LiveFeed((Counter(),))
    async with viewed(feed) as view:
        viewer = Viewer(feed, view)
        first = await viewer.read()
        await feed.step()
        second = await viewer.read()

    assert [first[1], second[1]] == ["snapshot", "change"]
    assert second[2] == {"drones": {"drn_1": {"looks": 2}}}


async def test_a_viewer_who_comes_back_misses_and_repeats_nothing() -> None:
    feed = LiveFeed((Counter(),))
    async with viewed(feed) as view:
        viewer = Viewer(feed, view)
        number, _, _ = await viewer.read()
    await feed.step()
    await feed.step()

    async with feed.viewing(SCOPE) as view:
        again = Viewer(feed, view, last_event_id=number)
        events = [await again.read() for _ in range(2)]

    assert [event[1] for event in events] == ["change", "change"]
    assert shown_after(viewer.frames + again.frames)["drones"] == {"drn_1": {"looks": 3}}


async def test_a_viewer_who_comes_back_to_a_forgotten_picture_gets_a_snapshot() -> None:
    source = Counter(is_steady=True)
    feed = LiveFeed((source,))
    async with viewed(feed) as view:
        viewer = Viewer(feed, view)
        number, _, _ = await viewer.read()
    for _ in range(LOOKS_UNTIL_FORGOTTEN):
        await feed.step()
    assert source.forgotten == 1
    source.drone_id = "drn_2"

    async with viewed(feed) as view:
        again = Viewer(feed, view, last_event_id=number)
        await again.read()

    assert set(shown_after(viewer.frames + again.frames)["drones"]) == {"drn_2"}


async def test_a_new_viewer_wakes_the_feed_only_until_the_picture_is_complete() -> None:
    feed = LiveFeed((Counter(),))
    async with viewed(feed):
        assert await feed.wake.wait(timeout_s=0.0)

        async with feed.viewing(OTHER_SCOPE):
            assert not await feed.wake.wait(timeout_s=0.0)


async def test_a_viewer_of_an_earlier_run_gets_a_snapshot() -> None:
    feed = LiveFeed((Counter(),))
    async with viewed(feed) as view:
        viewer = Viewer(feed, view, last_event_id="00000000-1")

        assert (await viewer.read())[1] == "snapshot"


async def test_events_end_when_the_key_ends() -> None:
    feed = LiveFeed((Counter(),))
    async with viewed(feed) as view:
        viewer = Viewer(feed, view)
        await viewer.read()
        viewer.is_known = False

        ended = [each async for each in viewer._events]

    assert ended == []


async def test_a_service_that_is_away_is_named_and_its_part_stays() -> None:
    source, other = Counter(), Counter(name="composition")
    since = datetime(2026, 3, 1, 12, tzinfo=UTC)
    clock = ManualClock(since)
    feed = LiveFeed((source, other), now=clock.now)
    async with viewed(feed) as view:
        viewer = Viewer(feed, view)
        await viewer.read()
        source.is_away = other.is_away = True
        await feed.step()
        _, _, away = await viewer.read()
        clock.advance(timedelta(minutes=1))
        await feed.step()
        source.is_away = other.is_away = False
        await feed.step()
        await viewer.read()

    assert away == {
        "services": {
            name: {"is_answering": False, "silent_since_at": to_jsonable_python(since)}
            for name in ("registry", "composition")
        }
    }
    shown = shown_after(viewer.frames)
    assert shown["services"]["registry"] == {"is_answering": True}

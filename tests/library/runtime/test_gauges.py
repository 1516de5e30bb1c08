"""What a service reads when somebody asks for its metrics."""

import asyncio
from dataclasses import dataclass, field

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.gauges import Gauge, Gauges, GaugeSource
from skyway.runtime.metrics import COUNTERS


@dataclass
class Store:
    """A database that counts how often it is read."""

    reads: int = 0
    is_away: bool = False
    answers: asyncio.Event = field(default_factory=asyncio.Event)

    def __post_init__(self) -> None:
        self.answers.set()

    async def read(self) -> list[Gauge]:
        self.reads += 1
        await self.answers.wait()
        if self.is_away:
            raise ServiceUnavailable("database", "it is away in this test")
        return [Gauge("skyway_tests_reads", "reads", self.reads)]


@dataclass
class Seconds:
    now_s: float = 1000.0

    def __call__(self) -> float:
        return self.now_s


def gauges_of(store: Store, now: Seconds, *, within_s: float = 60.0) -> Gauges:
    gauges = Gauges(within_s=within_s, now=now)
    gauges.show(GaugeSource("store", store.read, kept_s=5.0))
    return gauges


def unread() -> float:
    return COUNTERS.value("skyway_gauges_unread", source="store")


async def test_frequent_scrapes_share_what_was_read() -> None:
    store, now = Store(), Seconds()
    gauges = gauges_of(store, now)

    for later_s in (0.0, 2.0, 2.9):
        now.now_s += later_s
        assert [reading.value for reading in await gauges.read()] == [1]
    now.now_s += 0.1

    assert [reading.value for reading in await gauges.read()] == [2]


async def test_scrapes_at_the_same_time_read_once() -> None:
    store = Store()
    gauges = gauges_of(store, Seconds())

    await asyncio.gather(*(gauges.read() for _ in range(5)))

    assert store.reads == 1


async def test_a_source_that_is_away_is_left_out_and_counted() -> None:
    store, now, before = Store(is_away=True), Seconds(), unread()
    gauges = gauges_of(store, now)

    assert await gauges.read() == ()
    assert unread() == before + 1
    store.is_away = False

    assert len(await gauges.read()) == 1


async def test_old_numbers_are_not_shown_when_a_source_has_gone_away() -> None:
    store, now = Store(), Seconds()
    gauges = gauges_of(store, now)
    await gauges.read()
    store.is_away, now.now_s = True, now.now_s + 6.0

    assert await gauges.read() == ()


async def test_a_source_that_hangs_does_not_keep_a_scrape_waiting() -> None:
    store, before = Store(), unread()
    store.answers.clear()

    assert await gauges_of(store, Seconds(), within_s=0.01).read() == ()
    assert unread() == before + 1

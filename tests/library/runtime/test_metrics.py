"""What a process counts."""

import asyncio
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field

import pytest
from prometheus_client import CollectorRegistry, Metric, generate_latest
from prometheus_client.registry import Collector

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.metrics_routes import exposition
from skyway.runtime.metrics import (
    COUNTERS,
    DURATIONS,
    Counters,
    Durations,
    Gauge,
    Gauges,
    GaugeSource,
    count,
    timed,
)


def test_a_counter_grows_for_each_set_of_labels() -> None:
    counters = Counters()

    counters.add("skyway_tests", "tests", channel="a")
    counters.add("skyway_tests", "tests", 2.0, channel="a")
    counters.add("skyway_tests", "tests", channel="b")

    assert counters.value("skyway_tests", channel="a") == 3.0
    assert counters.value("skyway_tests", channel="b") == 1.0
    assert counters.value("skyway_tests") == 0.0


def test_counters_are_exposed() -> None:
    count("skyway_exposed_tests", "tests that expose themselves", kind="unit")

    body, content_type = exposition()

    assert b'skyway_exposed_tests_total{kind="unit"} 1.0' in body
    assert b"# HELP skyway_exposed_tests_total tests that expose themselves" in body
    assert content_type.startswith("text/plain")


def test_counting_does_not_load_prometheus() -> None:
    script = "import sys, skyway.runtime.loops; print('prometheus_client' in sys.modules)"

    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)

    assert done.stdout.strip() == b"False"


class _Shown(Collector):
    def __init__(self, durations: Durations) -> None:
        self._durations = durations

    def collect(self) -> Iterable[Metric]:
        return self._durations.collect()


def text_of(durations: Durations) -> str:
    registry = CollectorRegistry()
    registry.register(_Shown(durations))
    return generate_latest(registry).decode()


def test_each_duration_counts_in_its_bucket_and_all_larger_ones() -> None:
    durations = Durations()
    for duration_s in (0.004, 0.005, 0.3, 100.0):
        durations.add("skyway_tests_seconds", "tests", duration_s, kind="unit")

    text = text_of(durations)

    assert 'skyway_tests_seconds_bucket{kind="unit",le="0.0025"} 0.0' in text
    assert 'skyway_tests_seconds_bucket{kind="unit",le="0.005"} 2.0' in text
    assert 'skyway_tests_seconds_bucket{kind="unit",le="0.5"} 3.0' in text
    assert 'skyway_tests_seconds_bucket{kind="unit",le="60.0"} 3.0' in text
    assert 'skyway_tests_seconds_bucket{kind="unit",le="+Inf"} 4.0' in text
    assert 'skyway_tests_seconds_count{kind="unit"} 4.0' in text
    assert 'skyway_tests_seconds_sum{kind="unit"} 100.309' in text
    assert durations.count_of("skyway_tests_seconds", kind="unit") == 4
    assert durations.count_of("skyway_tests_seconds") == 0


def test_a_clock_that_was_set_back_makes_no_negative_duration() -> None:
    durations = Durations()

    durations.add("skyway_tests_seconds", "tests", -3600.0)

    text = text_of(durations)
    assert "skyway_tests_seconds_sum 0.0" in text
    assert 'skyway_tests_seconds_bucket{le="0.001"} 1.0' in text


def test_a_block_is_timed_also_when_it_fails() -> None:
    with pytest.raises(ValueError, match="broken"), timed("skyway_block_seconds", "blocks"):
        raise ValueError("broken")

    assert DURATIONS.count_of("skyway_block_seconds") == 1


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

"""How long things take in a process."""

from collections.abc import Iterable

import pytest
from prometheus_client import CollectorRegistry, Metric, generate_latest
from prometheus_client.registry import Collector

from skyway.runtime.durations import DURATIONS, Durations, timed


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

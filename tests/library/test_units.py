from datetime import UTC, datetime, timedelta

from hypothesis import given
from hypothesis import strategies as st

from skyway.units import kmh_to_mps, minutes_to_s, moment_to_ms, ms_to_moment, wh_to_j


def test_the_paper_s_figures_are_converted() -> None:
    assert kmh_to_mps(82.8) == 23.0
    assert wh_to_j(548) == 1_972_800
    assert minutes_to_s(55) == 3_300


@given(st.integers(min_value=0, max_value=10**14))
def test_whole_milliseconds_convert_both_ways(moment_ms: int) -> None:
    assert moment_to_ms(ms_to_moment(moment_ms)) == moment_ms


def test_a_moment_within_a_millisecond_counts_as_its_start() -> None:
    moment = datetime(2026, 3, 1, tzinfo=UTC)

    assert moment_to_ms(moment + timedelta(microseconds=999)) == moment_to_ms(moment)

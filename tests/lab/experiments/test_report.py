import math

import pytest
from skyway_lab.experiments.report import duration, estimated, markdown_table, percent
from skyway_lab.experiments.sample import Estimate


@pytest.mark.parametrize(
    ("value_s", "text"),
    [
        (0.000_12, "120 µs"),
        (0.0123, "12.3 ms"),
        (2.5, "2.5 s"),
        (600.0, "10 min"),
        (9_000.0, "2.50 h"),
        (math.inf, "never"),
    ],
)
def test_a_duration_is_shown_in_the_unit_that_reads_best(value_s, text):
    assert duration(value_s) == text


def test_a_censored_value_says_that_it_is_at_least():
    assert estimated(Estimate(2.0, 1.0, 3.0, is_at_least=True), duration) == "≥ 2 s"


def test_a_rounding_error_counts_as_zero():
    assert percent(-4.7e-17) == "0 %"


def test_a_table_aligns_its_numbers_to_the_right():
    assert markdown_table(("who", "s"), [("exact", "1")]).splitlines() == [
        "| who | s |",
        "| --- | ---: |",
        "| exact | 1 |",
    ]

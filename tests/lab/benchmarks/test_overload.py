"""What the overload benchmark says about its stages."""

from skyway_lab.benchmarks.overload.__main__ import table_of
from skyway_lab.benchmarks.overload.stages import Finding, Stage


def stage(factor: float, done_per_s: float) -> Stage:
    return Stage(
        name=f"{factor:g}",
        factor=factor,
        offered_per_s=10 * factor,
        accepted_per_s=done_per_s,
        refused={"503": 7} if factor > 1 else {},
        done_per_s=done_per_s,
        accept_p50_s=0.01,
        accept_p99_s=0.05,
        planned_p50_s=None,
        planned_p99_s=None,
        late=0,
        sent_late_p99_s=0.0,
    )


def test_throughput_past_the_capacity_is_compared_with_the_most() -> None:
    stages = [stage(0.5, 5.0), stage(1, 10.0), stage(2, 9.0), stage(10, 8.5)]

    table = table_of(Finding(10.0, stages, {}, "0 violations in 3 databases"))

    assert table.remarks == [
        "least done past the capacity: 85% of the most",
        "left over after the fall: nothing",
        "0 violations in 3 databases",
    ]
    assert table.rows[2] == ("2", "20.00", "9.00", "7 503", "9.00", "0.01 / 0.05", "none", "0")

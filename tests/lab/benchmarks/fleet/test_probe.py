"""What counts as the lag of a newest message."""

from skyway_lab.benchmarks.fleet.probe import Lag


def test_only_what_is_new_counts() -> None:
    lag = Lag()

    lag.notice("drn_1", "7/1", age_s=20.0)  # was there before the first look
    lag.notice("drn_1", "7/1", age_s=20.1)
    lag.notice("drn_1", "7/2", age_s=0.3)
    lag.notice("drn_2", "7/9", age_s=5.0)

    assert lag.seconds == [0.3]

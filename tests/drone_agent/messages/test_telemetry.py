"""Samples go out when they say something, and now and then in any case."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.analysis.analysis import Analysis, Assessment
from skyway_drone_agent.link.uplink import Envelope
from skyway_drone_agent.messages.telemetry import TelemetryThinning, telemetry_of
from skyway_drone_agent.simulated.disturbances import UNDISTURBED
from skyway_lab.benchmarks.telemetry_thinning.flown import START, Flown
from skyway_lab.benchmarks.telemetry_thinning.round_trip import round_trip

from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import Position
from skyway.ids import DroneId


@pytest.fixture
def in_flight() -> Assessment:
    """An assessment in the middle of a flight."""
    model = DJI_MATRICE_300_RTK
    steps = round_trip(model, start_at=START)
    moments = Flown(model, steps, UNDISTURBED, drone_id=DroneId("drn_1")).moments(every_s=20.0)
    moment = next(one for one in moments if one.run.step.kind == "FLY" and one.true_soc < 0.98)
    return Analysis(model).assess(moment.reading, moment.logbook)


def later(assessment: Assessment, seconds: float, **changes: Any) -> Assessment:
    """The drone so much later, straight on."""
    here, degree_m = assessment.position, 111_195.0
    east, north = assessment.velocity_mps
    narrowing = 0.866  # of a degree of longitude at 30 degrees
    on = Position(
        here.longitude_deg + east * seconds / degree_m / narrowing,
        here.latitude_deg + north * seconds / degree_m,
    )
    at = assessment.at + timedelta(seconds=seconds)
    return replace(assessment, at=at, position=on, **changes)


def is_news(sent: Assessment, now: Assessment) -> bool:
    thinning = TelemetryThinning()
    assert thinning.is_news(sent, wall_at=sent.at)
    thinning.sent(sent, wall_at=sent.at)
    return thinning.is_news(now, wall_at=now.at)


def test_straight_on_is_no_news_for_ten_seconds(in_flight: Assessment) -> None:
    assert not is_news(in_flight, later(in_flight, 9.0))
    assert is_news(in_flight, later(in_flight, 10.0))


@pytest.mark.parametrize(
    ("name", "within", "beyond"),
    [("soc", 0.004, 0.006), ("power_w", 30.0, 60.0), ("temperature_c", 0.9, 1.1)],
)
def test_a_change_beyond_the_dead_band_is_sent(
    in_flight: Assessment, name: str, within: float, beyond: float
) -> None:
    value = getattr(in_flight, name)

    for sign in (-1, 1):
        assert not is_news(in_flight, later(in_flight, 1.0, **{name: value + sign * within}))
        assert is_news(in_flight, later(in_flight, 1.0, **{name: value + sign * beyond}))


def test_another_speed_is_news(in_flight: Assessment) -> None:
    east, north = in_flight.velocity_mps
    faster = (1.1 * east, 1.1 * north)

    assert is_news(in_flight, later(in_flight, 1.0, velocity_mps=faster))


def test_a_drone_beside_its_course_is_news(in_flight: Assessment) -> None:
    straight = later(in_flight, 1.0)
    twenty, thirty = (
        straight.position._replace(latitude_deg=straight.position.latitude_deg + metres / 111_195)
        for metres in (20, 30)
    )

    assert not is_news(in_flight, replace(straight, position=twenty))
    assert is_news(in_flight, replace(straight, position=thirty))


def test_slow_changes_add_up_until_they_are_sent(in_flight: Assessment) -> None:
    thinning, sent = TelemetryThinning(), 0

    for count in range(9):
        now = later(in_flight, count, soc=in_flight.soc - 0.002 * count)
        if thinning.is_news(now, wall_at=now.at):
            thinning.sent(now, wall_at=now.at)
            sent += 1

    assert sent == 3


def test_a_sample_shows_the_assessment(in_flight: Assessment) -> None:
    envelope = Envelope(message_id="msg_1", sent_at=in_flight.at, session=1, seq=1)

    sample = telemetry_of(in_flight, envelope=envelope)

    assert (sample.at, sample.position, sample.soc) == (
        in_flight.at,
        in_flight.position,
        in_flight.soc,
    )
    assert sample.speed_mps == pytest.approx(23.0)
    assert sample.range_m == pytest.approx(in_flight.range_m, abs=0.5)

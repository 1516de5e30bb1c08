"""Values from outside: what is refused, and what is shortened."""

import json
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from skyway.bounds import (
    EARLIEST,
    LATEST,
    MOST_TEXT,
    Amperes,
    Celsius,
    Count,
    Joules,
    Kilograms,
    Metres,
    MetresPerSecond,
    Moment,
    SmallObject,
    Volts,
    Watts,
    WindComponent,
    Words,
)
from skyway.units import moment_to_ms, ms_to_moment

MOMENT = TypeAdapter[datetime](Moment)
WORDS = TypeAdapter[str](Words)
OBJECT = TypeAdapter[dict[str, Any]](SmallObject)
COUNT = TypeAdapter[int](Count)
MEASUREMENTS = (
    *(Volts, Amperes, Watts, Joules, Celsius, Kilograms),
    *(Metres, MetresPerSecond, WindComponent),
)


@pytest.mark.parametrize(
    "text",
    [
        "9999-12-31T23:59:59-12:00",
        "9999-12-31T23:59:59Z",
        "0001-01-01T00:00:00+14:00",
        "1969-12-31T23:59:59Z",
    ],
)
def test_a_moment_at_the_edge_of_the_calendar_is_refused_with_the_limits(text: str) -> None:
    with pytest.raises(ValidationError, match="between 1970-01-01 and 9000-01-01"):
        MOMENT.validate_json(f'"{text}"')


@pytest.mark.parametrize(
    "text",
    [
        '"2026-11-23T10:00:00"',
        '"2026-11-23T10:00Z"',
        '"2026-11-23 10:00:00Z"',
        '"2026-11-23"',
        '"20261123T100000Z"',
        '"2026-W48-1T10:00:00Z"',
        '"2026-11-23T10:00:00+0100"',
        '"1795428000"',
        '"1.5"',
        "1795428000",
        "1.5",
        "true",
    ],
)
def test_only_rfc_3339_is_a_moment(text: str) -> None:
    with pytest.raises(ValidationError, match="must be a moment like 2026-03-02T09:16:00Z"):
        MOMENT.validate_json(text)
    with pytest.raises(ValidationError, match="must be a moment like 2026-03-02T09:16:00Z"):
        MOMENT.validate_python(json.loads(text))


@pytest.mark.parametrize("moment", [EARLIEST, LATEST, datetime(2026, 11, 23, 10, tzinfo=UTC)])
def test_every_accepted_moment_can_be_stored_and_moved_by_a_day(moment: datetime) -> None:
    read = MOMENT.validate_json(f'"{moment.isoformat()}"')

    assert ms_to_moment(moment_to_ms(read)) == moment
    assert read - timedelta(days=1) < read < read + timedelta(days=1)


def test_a_whole_number_that_some_reader_of_json_would_round_is_refused() -> None:
    assert COUNT.validate_json(str(2**53 - 1)) == 2**53 - 1
    for text in (str(2**53), str(2**63), "-1", "1e30"):
        with pytest.raises(ValidationError):
            COUNT.validate_json(text)


@pytest.mark.parametrize("kind", MEASUREMENTS)
def test_a_measurement_that_no_drone_makes_is_refused(kind: Any) -> None:
    measured = TypeAdapter[float](kind)

    assert measured.validate_python(1.0) == 1.0
    for value in (1e13, -1e13, float("inf"), float("-inf"), float("nan")):
        with pytest.raises(ValidationError):
            measured.validate_python(value)


def test_control_characters_of_a_text_become_spaces() -> None:
    assert WORDS.validate_python("low\x1b[2J\r\nbattery\x00\x9b31m") == "low [2J battery 31m"


def test_a_long_text_is_shortened() -> None:
    shortened = WORDS.validate_python("x" * 10_000)

    assert len(shortened) == MOST_TEXT
    assert shortened.endswith("…")


def test_a_number_is_no_text() -> None:
    with pytest.raises(ValidationError, match="string"):
        WORDS.validate_python(7)


def test_a_large_object_is_replaced_by_a_note_of_its_size() -> None:
    assert OBJECT.validate_python({"need_j": 1.5}) == {"need_j": 1.5}
    assert OBJECT.validate_python({"x": "y" * 5_000}) == {"left_out": "5009 characters"}

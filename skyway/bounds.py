"""The bounds of values that come from outside: moments, whole numbers, texts and open objects.

A value within its bounds can be stored, compared, added to and shown everywhere in Skyway.
"""

import math
import re
from datetime import UTC, datetime
from typing import Annotated, Any, Final

from pydantic import AfterValidator, AwareDatetime, BeforeValidator, Field
from pydantic_core import PydanticCustomError

#: The first and the last moment that Skyway accepts. A day can be added to both, and subtracted,
#: in every time zone; both are exact in milliseconds in JSON and in every column.
EARLIEST: Final = datetime(1970, 1, 1, tzinfo=UTC)
LATEST: Final = datetime(9000, 1, 1, tzinfo=UTC)

#: A moment as JSON has it: date, time with seconds, and the distance from UTC.
_RFC_3339: Final = re.compile(
    r"\d{4}-\d\d-\d\d[Tt]\d\d:\d\d:\d\d(\.\d+)?([Zz]|[+-]\d\d:\d\d)", re.ASCII
)
NO_MOMENT: Final = "must be a moment like 2026-03-02T09:16:00Z, with its distance from UTC"

#: The most characters of a text that a drone writes, and of an open object as JSON-like text.
MOST_TEXT: Final = 500
MOST_OBJECT: Final = 4_000

#: Characters that a terminal obeys instead of showing them: C0, DEL and C1.
_CONTROL: Final = re.compile(r"[\x00-\x1f\x7f-\x9f]+")


def _as_rfc_3339(value: object) -> object:
    """The value, if it is a moment or its text; numbers and other forms of ISO 8601 are refused."""
    if isinstance(value, datetime) or (isinstance(value, str) and _RFC_3339.fullmatch(value)):
        return value
    raise PydanticCustomError("moment_form", NO_MOMENT)


def _within_calendar(moment: datetime) -> datetime:
    if not EARLIEST <= moment <= LATEST:
        raise PydanticCustomError(
            "moment_out_of_range",
            "must be between {earliest} and {latest}",
            {"earliest": f"{EARLIEST:%Y-%m-%d}", "latest": f"{LATEST:%Y-%m-%d}"},
        )
    return moment


def _stays(value: object) -> object:
    if value is None:
        raise PydanticCustomError("null", "may be left out, but not null")
    return value


def printable(text: object) -> object:
    """The text without control characters, and at most `MOST_TEXT` characters of it.

    Words of a drone are shortened instead of refused: an event with a long detail must not stop
    the drone's mission. What is not a text is returned as it is.
    """
    if not isinstance(text, str):
        return text
    text = _CONTROL.sub(" ", text)
    return text if len(text) <= MOST_TEXT else f"{text[: MOST_TEXT - 1]}…"


def _small(data: dict[str, Any]) -> dict[str, Any]:
    """The object, or only a note of its size if it is larger than `MOST_OBJECT` characters.

    JSON has no NaN and no infinity, but readers of JSON make them of `NaN` and `1e999`.
    """
    if not _is_finite(data):
        raise PydanticCustomError("finite_numbers", "has a number that is infinite")
    size = len(repr(data))
    return data if size <= MOST_OBJECT else {"left_out": f"{size} characters"}


def _is_finite(value: object) -> bool:
    """Whether no number in this value of JSON is NaN or infinite."""
    match value:
        case float():
            return math.isfinite(value)
        case dict():
            return all(map(_is_finite, value.values()))
        case list() | tuple():
            return all(map(_is_finite, value))
        case _:
            return True


#: A moment with its offset from UTC.
Moment = Annotated[AwareDatetime, BeforeValidator(_as_rfc_3339), AfterValidator(_within_calendar)]

#: Of a member of a PATCH that may be left out, so its type has null, but not removed.
NotNull: Final = BeforeValidator(_stays)

#: A whole number that every reader of JSON and every database holds exactly.
Count = Annotated[int, Field(ge=0, le=2**53 - 1)]

#: Words of a drone for people or programs, cut to their length and without control characters.
Words = Annotated[str, BeforeValidator(printable)]

#: An object of any members, with finite numbers and its size bounded.
SmallObject = Annotated[dict[str, Any], AfterValidator(_small)]

#: Measurements of a drone. The limits are far outside of what any drone measures; within them sums
#: and products stay finite.
Volts = Annotated[float, Field(ge=0, le=1e5)]
Amperes = Annotated[float, Field(ge=-1e6, le=1e6)]
Watts = Annotated[float, Field(ge=-1e9, le=1e9)]
Joules = Annotated[float, Field(ge=-1e12, le=1e12)]
Celsius = Annotated[float, Field(ge=-273.15, le=1e4)]
Kilograms = Annotated[float, Field(ge=0, le=1e5)]
Metres = Annotated[float, Field(ge=0, le=1e9)]
#: A speed has no direction; a component of the wind has one.
MetresPerSecond = Annotated[float, Field(ge=0, le=1_000)]
WindComponent = Annotated[float, Field(ge=-1_000, le=1_000)]

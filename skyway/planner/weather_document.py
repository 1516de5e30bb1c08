"""The weather of a problem in its JSON form, its limits, and what contradicts itself in it."""

from collections.abc import Iterator, Mapping, Sequence, Sized
from itertools import islice, pairwise
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from skyway.errors import FieldFault
from skyway.json_model import JsonModel
from skyway.planner.kernels.memory import Longs
from skyway.planner.problem_parts import Seconds

#: The least and the largest factor. Beyond them no drone of today flies on. Our own choice.
LEAST_FACTOR: Final = 0.2
LARGEST_FACTOR: Final = 10.0

#: The most periods: two weeks of hours. The most factors of one document, of time and of energy.
MAX_PERIODS: Final = 336
MAX_FACTORS: Final = 500_000

#: The most faults reported for one document.
MAX_FAULTS: Final = 50


#: The name of a station; the network knows which there are.
_Name = Annotated[str, Field(max_length=64)]
_Ends = Annotated[tuple[_Name, ...], Field(min_length=2, max_length=2)]

Factor = Annotated[float, Field(ge=LEAST_FACTOR, le=LARGEST_FACTOR)]


def _few(value: Any) -> Any:  # any JSON value; counted before a million are read
    if isinstance(value, Sized) and len(value) > MAX_FACTORS:
        raise PydanticCustomError(
            "too_many",
            "{count} entries exceed the limit of {limit}",
            {"count": len(value), "limit": MAX_FACTORS},
        )
    return value


class WeatherPeriod(JsonModel):
    """The factors of the named segments in [start_s, end_s), in the order of `segments`."""

    start_s: Seconds
    end_s: Annotated[
        Seconds | None, Field(description="The end; null in the last period: without an end.")
    ] = None
    time_factors: Annotated[
        tuple[Factor | None, ...],
        Field(
            json_schema_extra={"maxItems": MAX_FACTORS},
            description="What flights take, as multiples of the time in still air; null: no drone "
            "of this model flies the segment.",
        ),
        BeforeValidator(_few),
    ]
    energy_factors: Annotated[
        tuple[Factor, ...],
        Field(
            json_schema_extra={"maxItems": MAX_FACTORS},
            description="The energy of these flights, as multiples of power times time; without "
            "them 1.",
        ),
        BeforeValidator(_few),
    ] = ()


class WeatherDocument(JsonModel):
    """The weather of a problem in its JSON form."""

    segments: Annotated[
        tuple[_Ends, ...],
        Field(
            json_schema_extra={"maxItems": MAX_FACTORS},
            description="The segments, each by the stations that it leads from and to.",
        ),
        BeforeValidator(_few),
    ]
    # At least one is checked below: pydantic would count only those that are themselves valid.
    periods: Annotated[
        tuple[WeatherPeriod, ...],
        Field(
            max_length=MAX_PERIODS,
            json_schema_extra={"minItems": 1},
            description="The periods in order of time, each beginning where the last one ends.",
        ),
    ]


def refuse_too_many_factors(value: Any) -> None:  # any JSON value
    """Raise pydantic's own error for a document with too many factors, before they are read."""
    periods = value.get("periods") if isinstance(value, Mapping) else None
    if not isinstance(periods, Sequence) or isinstance(periods, str):
        return
    lists = (
        period.get(name)
        for period in islice(periods, MAX_PERIODS)
        if isinstance(period, Mapping)
        for name in ("time_factors", "energy_factors")
    )
    count = sum(len(one) for one in lists if isinstance(one, Sized))
    if count > MAX_FACTORS:
        raise PydanticCustomError(
            "too_many",
            "{count} factors exceed the limit of {limit}",
            {"count": count, "limit": MAX_FACTORS},
        )


def contradictions(document: WeatherDocument, segment: Longs) -> Iterator[FieldFault]:
    """Each contradiction, by its path in a problem; `segment` holds the rows, -1 if unknown."""
    for number in np.flatnonzero(segment < 0)[:MAX_FAULTS].tolist():
        from_id, to_id = (name[:100] for name in document.segments[number])
        yield FieldFault(
            f"weather.segments.{number}", f"no segment leads from {from_id!r} to {to_id!r}"
        )
    order = np.argsort(segment, kind="stable")
    again = order[1:][(np.diff(segment[order]) == 0) & (segment[order][1:] >= 0)]
    for number in np.sort(again)[:MAX_FAULTS].tolist():
        yield FieldFault(f"weather.segments.{number}", "is named twice")
    for number, period in enumerate(document.periods):
        for name in ("time_factors", "energy_factors"):
            factors = getattr(period, name)
            is_left_out = name == "energy_factors" and not factors
            if len(factors) != len(segment) and not is_left_out:
                yield FieldFault(
                    f"weather.periods.{number}.{name}",
                    f"{len(factors)} factors for {len(segment)} segments",
                )
    if not document.periods:
        yield FieldFault("weather.periods", "0 periods, at least 1 is needed")
    yield from _of_times(document.periods)


def _of_times(periods: Sequence[WeatherPeriod]) -> Iterator[FieldFault]:
    """Periods that are reversed, over, or do not follow one another."""
    for number, period in enumerate(periods):
        field = f"weather.periods.{number}.end_s"
        if period.end_s is None:
            if number < len(periods) - 1:
                yield FieldFault(field, "is missing: only the last period may have no end")
        elif period.end_s <= period.start_s:
            yield FieldFault(field, f"{period.end_s:g} is not after start_s {period.start_s:g}")
        elif period.end_s <= 0:
            yield FieldFault(field, f"{period.end_s:g}: the period is over when the plan starts")
    for number, (before, after) in enumerate(pairwise(periods), start=1):
        if before.end_s is not None and after.start_s != before.end_s:
            what = "leaves a hole after" if after.start_s > before.end_s else "overlaps"
            yield FieldFault(
                f"weather.periods.{number}.start_s",
                f"{after.start_s:g} {what} the period before, which ends at {before.end_s:g}",
            )

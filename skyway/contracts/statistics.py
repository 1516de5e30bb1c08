"""The span of fleet time that statistics look at, the same in every service's query."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Annotated, Final

from pydantic import Field

from skyway.bounds import EARLIEST
from skyway.contracts.message import FleetMoment
from skyway.errors import InvalidInput
from skyway.ids import ProviderId
from skyway.json_model import QueryModel
from skyway.units import moment_to_ms, ms_to_moment

#: How far back statistics look by default.
_DEFAULT_SPAN: Final = timedelta(hours=24)


@dataclass(frozen=True, slots=True)
class Span:
    """[start_ms, end_ms) of fleet time, milliseconds since 1970."""

    start_ms: int
    end_ms: int

    @property
    def duration_s(self) -> float:
        """How long it lasts."""
        return (self.end_ms - self.start_ms) / 1000

    @property
    def from_at(self) -> datetime:
        """Its first moment."""
        return ms_to_moment(self.start_ms)

    @property
    def to_at(self) -> datetime:
        """The first moment after it."""
        return ms_to_moment(self.end_ms)


def span_between(from_at: datetime, to_at: datetime, *, longest: timedelta | None = None) -> Span:
    """The span of these moments.

    Raises
    ------
    InvalidInput
        It would end before it begins, or it is too long.
    """
    if from_at >= to_at:
        raise InvalidInput(
            "from", f"{from_at.isoformat()} must be before `to`, {to_at.isoformat()}"
        )
    if longest is not None and to_at - from_at > longest:
        days, most = ((each / timedelta(days=1)) for each in (to_at - from_at, longest))
        raise InvalidInput("to", f"the span is {days:.1f} days long; the limit is {most:g} days")
    return Span(moment_to_ms(from_at), moment_to_ms(to_at))


class SpanQuery(QueryModel):
    """``?from=&to=&provider_id=``; by default the day up to now."""

    from_at: Annotated[FleetMoment | None, Field(alias="from")] = None
    to_at: Annotated[FleetMoment | None, Field(alias="to")] = None
    provider_id: ProviderId | None = None

    def span(self, now: datetime) -> Span:
        """The requested span.

        Raises
        ------
        InvalidInput
            It would end before it begins.
        """
        to_at = self.to_at or now
        return span_between(self.from_at or max(EARLIEST, to_at - _DEFAULT_SPAN), to_at)

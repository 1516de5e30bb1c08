"""The span of fleet time that a schedule shows."""

from datetime import datetime, timedelta
from typing import Annotated, Final

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.contracts.statistics import Span
from skyway.errors import InvalidInput
from skyway.json_model import JsonModel
from skyway.runtime.http.paging import PageQuery
from skyway.units import moment_to_ms

#: The longest span that one call shows; our own choice.
LONGEST_SPAN: Final = timedelta(days=31)


class FutureSpanQuery(JsonModel):
    """``?from=&to=``: from now on, and 31 days, unless said otherwise."""

    from_at: Annotated[
        FleetMoment | None,
        Field(alias="from", description="Start of the span, fleet time; without it now."),
    ] = None
    to_at: Annotated[
        FleetMoment | None,
        Field(
            alias="to",
            description="End of the span, fleet time; without it 31 days after the start. "
            "A span is at most 31 days long.",
        ),
    ] = None

    def span(self, now: datetime) -> Span:
        """The span that is meant.

        Raises
        ------
        InvalidInput
            It ends before it begins, or it is too long.
        """
        from_at = self.from_at or now
        try:
            to_at = self.to_at or from_at + LONGEST_SPAN
        except OverflowError as error:
            raise InvalidInput("from", f"{from_at.isoformat()} is too late a moment") from error
        if from_at >= to_at:
            raise InvalidInput(
                "from", f"{from_at.isoformat()} must be before `to`, {to_at.isoformat()}"
            )
        if to_at - from_at > LONGEST_SPAN:
            days = (to_at - from_at) / timedelta(days=1)
            raise InvalidInput(
                "to", f"the span is {days:.1f} days long; the limit is {LONGEST_SPAN.days} days"
            )
        return Span(moment_to_ms(from_at), moment_to_ms(to_at))


class ScheduleQuery(FutureSpanQuery, PageQuery):
    """A span, and a page of the drones that have missions in it."""

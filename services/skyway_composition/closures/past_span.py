"""The span of a replay: an hour up to now, unless said otherwise."""

from datetime import datetime, timedelta
from typing import Annotated, Final

from pydantic import Field

from skyway.bounds import EARLIEST
from skyway.contracts.message import FleetMoment
from skyway.contracts.statistics import Span, span_between
from skyway.json_model import QueryModel

#: The longest span of one call. Our own choice.
LONGEST_REPLAY: Final = timedelta(days=1)

_DEFAULT: Final = timedelta(hours=1)


class PastSpanQuery(QueryModel):
    """``?from=&to=``: up to now, and an hour, unless said otherwise."""

    from_at: Annotated[
        FleetMoment | None,
        Field(alias="from", description="Start of the span, fleet time; without it an hour."),
    ] = None
    to_at: Annotated[
        FleetMoment | None,
        Field(
            alias="to",
            description="End of the span, fleet time; without it now. A span is at most a day.",
        ),
    ] = None

    def span(self, now: datetime) -> Span:
        """The span that is meant.

        Raises
        ------
        InvalidInput
            It ends before it begins, or it is too long.
        """
        to_at = self.to_at or now
        from_at = self.from_at or max(EARLIEST, to_at - _DEFAULT)
        return span_between(from_at, to_at, longest=LONGEST_REPLAY)

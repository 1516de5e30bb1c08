"""Gateway to customer: a month of the ledger is closed, and what the customer pays for it."""

from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.contracts.message import FleetMoment, Message
from skyway.delivery.offer import Currency
from skyway.ids import EventId
from skyway.json_model import WireModel

Month = Annotated[
    str,
    Field(
        pattern=r"^[0-9]{4}-(0[1-9]|1[0-2])$",
        max_length=7,
        description="A month in UTC, fleet time, as 2026-03.",
    ),
]

StatementEventType = Literal["statement.closed"]

STATEMENT_CLOSED: Final[StatementEventType] = "statement.closed"


class ClosedTotal(WireModel):
    """What a customer pays for a closed month in one currency."""

    currency: Currency
    amount: Annotated[int, Field(description="Minor units of the currency.")]
    lines: Annotated[int, Field(ge=1, description="How many lines of the ledger it sums up.")]


class StatementData(WireModel):
    """The totals of the customer's month, which never change any more."""

    month: Month
    closed_at: FleetMoment
    totals: Annotated[
        tuple[ClosedTotal, ...], Field(description="The totals, one for each currency.")
    ]


class StatementClosed(Message):
    """A month is closed. It has the members of delivery events, but is about no delivery."""

    event_id: EventId
    type: Annotated[StatementEventType, Field(description="The type of the event.")] = (
        STATEMENT_CLOSED
    )
    delivery_id: Annotated[None, Field(description="Always null: it is about no delivery.")] = None
    livemode: Annotated[bool, Field(description="Always true: test months are not closed.")] = True
    sequence: Annotated[int, Field(ge=1, le=1, description="Always 1.")] = 1
    occurred_at: FleetMoment
    data: Annotated[StatementData, Field(description="What the event says.")]

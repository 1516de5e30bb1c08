"""A statement: the sum of a party's lines of the ledger in a month, in one currency."""

from datetime import datetime
from typing import Annotated, Literal, Self

from pydantic import Field, computed_field

from skyway.contracts.message import FleetMoment
from skyway.contracts.statement_event import Month
from skyway.delivery.offer import Currency
from skyway.ids import DeliveryId, SubjectId, is_live_account, is_live_id
from skyway.json_model import JsonModel
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway_gateway.ledger.line import month_of

PartyRole = Literal["customer", "provider"]

_Amount = Annotated[int, Field(description="Minor units of the currency.")]


class MonthQuery(PageQuery):
    """The query of a month."""

    month: Annotated[Month | None, Field(description="The month; without it, the present one.")] = (
        None
    )

    def month_at(self, moment: datetime) -> str:
        """The month that is asked for at this moment of fleet time."""
        return self.month or month_of(moment)


class StatementQuery(MonthQuery):
    """The query of statements: a month, and whose; callers see only their own."""

    role: Annotated[
        PartyRole | None, Field(description="Only statements of customers, or of providers.")
    ] = None
    party_id: Annotated[
        SubjectId | None, Field(description="Only statements of this customer or provider.")
    ] = None

    def seen_by(self, caller: Caller) -> Self:
        """The query without what is not the caller's; operators see all statements."""
        if caller.role == "operator":
            return self
        own = {"role": caller.role, "party_id": caller.subject_id}
        return self.model_copy(update=own)


class LineQuery(StatementQuery):
    """The query of lines: as that of statements."""

    delivery_id: Annotated[
        DeliveryId | None, Field(description="Only the lines of this delivery.")
    ] = None


class StatementItems(JsonModel):
    """The sums of the lines by kind; what customers get back is negative."""

    base: _Amount
    distance: _Amount
    mass: _Amount
    recharging: _Amount
    minimum: _Amount
    priority: _Amount
    pooled: _Amount
    cancellation: _Amount
    failure: _Amount
    lateness: _Amount
    waiting: _Amount
    correction: _Amount


class Statement(JsonModel):
    """What a customer pays, or a provider gets, for a month in one currency."""

    month: Month
    role: Annotated[PartyRole, Field(description="Whether the party pays or is paid.")]
    party_id: Annotated[SubjectId, Field(description="The customer or the provider.")]
    currency: Currency
    amount: Annotated[
        int,
        Field(description="The sum of all lines: customers pay it, providers get it."),
    ]
    deliveries: Annotated[int, Field(description="How many deliveries have lines.")]
    lines: Annotated[int, Field(description="How many lines it sums up.")]
    items: Annotated[StatementItems, Field(description="The sums by kind of line.")]
    closed_at: Annotated[
        FleetMoment | None,
        Field(description="When the month was closed; null while it is open."),
    ]

    @computed_field(  # type: ignore[prop-decorator]
        description="False for what belongs to a test account."
    )
    @property
    def livemode(self) -> bool:
        """Whether it is real."""
        return is_live_account(self.party_id) and is_live_id(self.party_id)


class Correction(JsonModel):
    """A line that an operator adds for a mission; it counts in the present month."""

    mission_id: Annotated[str, Field(min_length=1, max_length=100, description="The mission.")]
    amount: Annotated[
        int,
        Field(
            ge=-(10**12),
            le=10**12,
            description="Minor units of the mission's currency, not 0; negative: the customer gets "
            "it back. The sum of a mission's lines stays between 0 and 10^12.",
        ),
    ]
    note: Annotated[str, Field(min_length=1, max_length=500, description="Why, for both parties.")]

"""A line of the ledger: an amount that a customer pays and a provider gets, or both less."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import Field, computed_field

from skyway.contracts.message import FleetMoment
from skyway.contracts.statement_event import Month
from skyway.delivery.line_items import LineKind
from skyway.delivery.offer import Currency
from skyway.ids import DeliveryId, MissionId, ProviderId, SubjectId, is_live_account
from skyway.json_model import JsonModel


class LedgerLine(JsonModel):
    """A line of the ledger. A line names both parties, so the sums of both sides agree."""

    mission_id: Annotated[MissionId, Field(description="The mission that is paid.")]
    number: Annotated[int, Field(ge=1, description="The number of the line within its mission.")]
    delivery_id: Annotated[DeliveryId, Field(description="The delivery of the mission.")]
    customer_id: Annotated[SubjectId, Field(description="The customer, who pays.")]
    provider_id: Annotated[ProviderId, Field(description="The provider, who is paid.")]
    kind: Annotated[
        LineKind | Literal["CORRECTION"],
        Field(description="As in the mission's line items; CORRECTION: by an operator, later."),
    ]
    amount: Annotated[
        int,
        Field(
            ge=-(10**12),
            le=10**12,
            description="Minor units of the currency; negative if the customer gets it back.",
        ),
    ]
    currency: Currency
    note: Annotated[str | None, Field(description="Why an operator made a correction.")] = None
    at: FleetMoment
    month: Month

    @computed_field(  # type: ignore[prop-decorator]
        description="False for what belongs to a test account."
    )
    @property
    def livemode(self) -> bool:
        """Whether it is real."""
        return is_live_account(self.customer_id)


def month_of(moment: datetime) -> str:
    """The month of a moment of fleet time, in UTC."""
    return f"{moment:%Y-%m}"

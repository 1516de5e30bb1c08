"""What providers earned in a month by day, drone or route: sums of the lines of the ledger."""

from datetime import date
from typing import Annotated, Literal, Self

from pydantic import Field

from skyway.delivery.offer import Currency
from skyway.ids import DroneId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.http.identity import Caller
from skyway_gateway.ledger.statement import MonthQuery

By = Literal["day", "drone", "route"]


class EarnedQuery(MonthQuery):
    """The query of earnings: a month, whose, and by what they are summed."""

    by: Annotated[By, Field(description="One sum for each day, drone or route.")] = "day"
    provider_id: Annotated[ProviderId | None, Field(description="Only of this provider.")] = None

    def seen_by(self, caller: Caller) -> Self:
        """The query without what is not the caller's; operators see all earnings."""
        if caller.role == "operator":
            return self
        return self.model_copy(update={"provider_id": caller.subject_id})


class Earned(JsonModel):
    """What a provider earned in a month with one day, drone or route, in one currency."""

    provider_id: Annotated[ProviderId, Field(description="The provider.")]
    currency: Currency
    day: Annotated[
        date | None, Field(description="The day in UTC on which the lines were written.")
    ] = None
    drone_id: Annotated[
        DroneId | None, Field(description="The drone; null if its mission is archived.")
    ] = None
    from_station_id: Annotated[
        StationId | None, Field(description="The pickup as requested; null if it is archived.")
    ] = None
    to_station_id: Annotated[
        StationId | None,
        Field(description="Where the first package of the request goes; null if it is archived."),
    ] = None
    deliveries: Annotated[int, Field(description="How many deliveries have lines.")]
    missions: Annotated[int, Field(description="How many missions have lines.")]
    amount: Annotated[
        int, Field(description="Minor units; the sum over all is the amount of the statement.")
    ]

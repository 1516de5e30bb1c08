"""What the gateway asks of the other services: the two faces, and their REST implementations."""

from typing import Annotated, Final, Protocol

from pydantic import Field

from skyway.contracts.candidate import CandidateQuery, PayloadLimit, PayloadLimitQuery
from skyway.contracts.drone_key import DroneKeyAnswer, DroneKeyQuery
from skyway.contracts.mission import (
    Booking,
    BookMissions,
    Cancellation,
    CancelMissions,
    ClosedDelivery,
)
from skyway.contracts.quote import QuoteAnswer, QuoteQuery
from skyway.contracts.shortlist import Candidates
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.contracts.track import Track
from skyway.ids import DeliveryId, DroneId, SubjectId
from skyway.json_model import WireModel
from skyway.runtime.http.client import ServiceClient

#: Composing may take a while; the same PUT again is answered the same, so this may be cut short.
_COMPOSING_S: Final = 20.0

#: Where composition is asked, or told, to stop carrying packages.
CANCELLATIONS_PATH: Final = "/internal/deliveries/{delivery_id}/cancellations"


class Registry(Protocol):
    """The provider registry, as the gateway needs it."""

    async def candidates(self, query: CandidateQuery) -> Candidates:
        """The drones that could fly a request now, and why the other providers have none."""
        ...

    async def payload_limit(self, query: PayloadLimitQuery) -> PayloadLimit:
        """The heaviest payload that any admitted provider's drones can lift, busy or not."""
        ...


class Composition(Protocol):
    """Composition, as the gateway needs it."""

    async def check_stations(self, query: StationCheckQuery) -> StationCheck:
        """Whether stations exist, where they are, and whether a path leads to them."""
        ...

    async def quote(self, query: QuoteQuery) -> QuoteAnswer:
        """What each provider could offer now, the best first; nothing is reserved."""
        ...

    async def book(self, delivery_id: DeliveryId, wanted: BookMissions) -> Booking:
        """Book the best plan; asked again for the same attempt, the answer is the same."""
        ...

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Have nothing booked for a delivery from now on."""
        ...

    async def cancel(self, delivery_id: DeliveryId, wanted: CancelMissions) -> Cancellation:
        """Have packages left at the pickup, or brought back, as far as that is possible."""
        ...

    async def track(self, delivery_id: DeliveryId) -> Track:
        """Where the delivery's drones have been, are and will be."""
        ...


class _BrokerPassword(WireModel):
    password: Annotated[str, Field(repr=False)]


class RestRegistry:
    """The registry over REST; also opens and closes customers' broker accounts."""

    def __init__(self, client: ServiceClient) -> None:
        self._client = client

    async def candidates(self, query: CandidateQuery) -> Candidates:
        """The drones that could fly a request now, and why the other providers have none."""
        return await self._client.call(
            "POST", "/internal/candidates", body=query, answer=Candidates
        )

    async def payload_limit(self, query: PayloadLimitQuery) -> PayloadLimit:
        """The heaviest payload that any admitted provider's drones can lift, busy or not."""
        return await self._client.call(
            "POST", "/internal/payload-limit", body=query, answer=PayloadLimit
        )

    async def open_account(self, user_name: SubjectId, *, password: str) -> None:
        """Open a broker account, or give it another password."""
        body = _BrokerPassword(password=password)
        await self._client.call("PUT", f"/internal/broker-accounts/{user_name}", body=body)

    async def drone_of(self, key_hash: str) -> DroneId | None:
        """The drone whose key this is; None when it is nobody's, or not any more."""
        query = DroneKeyQuery(key_hash=key_hash)
        answer = await self._client.call(
            "POST", "/internal/drone-keys", body=query, answer=DroneKeyAnswer
        )
        return answer.drone_id

    async def close_account(self, user_name: SubjectId) -> None:
        """Close a broker account; one that is not there is closed already."""
        await self._client.call("DELETE", f"/internal/broker-accounts/{user_name}")


class RestComposition:
    """Composition over REST."""

    def __init__(self, client: ServiceClient) -> None:
        self._client = client

    async def check_stations(self, query: StationCheckQuery) -> StationCheck:
        """Whether stations exist, where they are, and whether a path leads to them."""
        return await self._client.call(
            "POST", "/internal/station-checks", body=query, answer=StationCheck
        )

    async def quote(self, query: QuoteQuery) -> QuoteAnswer:
        """What each provider could offer now, the best first; nothing is reserved."""
        return await self._client.call(
            "POST", "/internal/quotes", body=query, answer=QuoteAnswer, timeout_s=_COMPOSING_S
        )

    async def book(self, delivery_id: DeliveryId, wanted: BookMissions) -> Booking:
        """Book the best plan; asked again for the same attempt, the answer is the same."""
        return await self._client.call(
            "PUT",
            f"/internal/deliveries/{delivery_id}/missions",
            body=wanted,
            answer=Booking,
            timeout_s=_COMPOSING_S,
        )

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Have nothing booked for a delivery from now on."""
        path = f"/internal/deliveries/{delivery_id}/closed"
        return await self._client.call("PUT", path, answer=ClosedDelivery)

    async def cancel(self, delivery_id: DeliveryId, wanted: CancelMissions) -> Cancellation:
        """Have packages left at the pickup, or brought back, as far as that is possible."""
        path = CANCELLATIONS_PATH.format(delivery_id=delivery_id)
        return await self._client.call("POST", path, body=wanted, answer=Cancellation)

    async def track(self, delivery_id: DeliveryId) -> Track:
        """Where the delivery's drones have been, are and will be."""
        path = f"/internal/deliveries/{delivery_id}/track"
        return await self._client.call("GET", path, answer=Track)

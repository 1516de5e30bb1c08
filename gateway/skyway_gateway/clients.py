"""What the gateway asks of registry and composition: two protocols, and the registry's client."""

from http import HTTPStatus
from typing import Annotated, Final, Protocol

from pydantic import Field

from skyway.contracts.broker_rules import AccountRole
from skyway.contracts.candidate import (
    CandidateQueries,
    CandidateQuery,
    PayloadLimit,
    PayloadLimitQuery,
)
from skyway.contracts.drones import DroneKeyAnswer, DroneKeyQuery, DroneQuota
from skyway.contracts.forgotten_deliveries import ForgetDeliveries, KeptDeliveries
from skyway.contracts.mission import (
    Booking,
    BookMissions,
    Cancellation,
    CancelMissions,
    ClosedDelivery,
)
from skyway.contracts.quote import KeepOffer, KeptOffer, QuoteAnswer, QuoteQuery
from skyway.contracts.shortlist import CandidateLists, Candidates
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.contracts.track import Track
from skyway.ids import DeliveryId, DroneId, HoldId, ProviderId, StationId, SubjectId
from skyway.json_model import WireModel
from skyway.runtime.errors import RemoteProblem
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import Caller

#: Where composition is asked to cancel packages.
CANCELLATIONS_PATH: Final = "/internal/deliveries/{delivery_id}/cancellations"


class Registry(Protocol):
    """The provider registry, as the gateway needs it."""

    async def candidates(self, query: CandidateQuery) -> Candidates:
        """The drones that could fly a request now, and why the other providers have none."""
        ...

    async def candidate_lists(self, asked: CandidateQueries) -> CandidateLists:
        """The drones that could fly each of several requests, by one state of the fleets."""
        ...

    async def payload_limit(self, query: PayloadLimitQuery) -> PayloadLimit:
        """The heaviest payload that any admitted provider's drones can lift, busy or not."""
        ...


class Composition(Protocol):
    """Composition, as the gateway needs it."""

    async def must_accept(self, pickup: StationId) -> None:
        """Go on only if the network of this pickup accepts new requests."""
        ...

    async def check_stations(self, query: StationCheckQuery) -> StationCheck:
        """Whether stations exist, where they are, and whether a path leads to them."""
        ...

    async def quote(self, query: QuoteQuery) -> QuoteAnswer:
        """The offers of all providers now, the best first; some are held if the query asks."""
        ...

    async def keep(self, asked: KeepOffer) -> KeptOffer:
        """Hold an offer until it is booked, or say why it cannot be kept."""
        ...

    async def release(self, hold_id: HoldId) -> None:
        """Give up what a hold keeps."""
        ...

    async def book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        """Book the best plan; asked again for the same attempt, the answer is the same."""
        ...

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Refuse all further bookings of a delivery."""
        ...

    async def cancel(self, delivery_id: DeliveryId, requested: CancelMissions) -> Cancellation:
        """Leave packages at the pickup, or bring them back, as far as possible."""
        ...

    async def track(self, delivery_id: DeliveryId) -> Track:
        """Where the delivery's drones have been, are and will be."""
        ...

    async def forget(self, asked: ForgetDeliveries) -> KeptDeliveries:
        """Delete deliveries that ended long ago, except those that are still needed."""
        ...


class _BrokerPassword(WireModel):
    password: Annotated[str, Field(repr=False)]


#: Where the registry keeps the broker accounts of each role.
_ACCOUNTS: Final[dict[AccountRole, str]] = {
    "customer": "broker-accounts",
    "operator": "operator-accounts",
}


class RestRegistry:
    """The registry over REST, which also keeps the broker accounts of people."""

    def __init__(self, client: ServiceClient) -> None:
        self._client = client

    async def candidates(self, query: CandidateQuery) -> Candidates:
        """The drones that could fly a request now, and why the other providers have none."""
        return await self._client.call(
            "POST", "/internal/candidates", body=query, answer=Candidates
        )

    async def candidate_lists(self, asked: CandidateQueries) -> CandidateLists:
        """The drones that could fly each of several requests, by one state of the fleets."""
        return await self._client.call(
            "POST", "/internal/candidate-lists", body=asked, answer=CandidateLists
        )

    async def payload_limit(self, query: PayloadLimitQuery) -> PayloadLimit:
        """The heaviest payload that any admitted provider's drones can lift, busy or not."""
        return await self._client.call(
            "POST", "/internal/payload-limit", body=query, answer=PayloadLimit
        )

    async def drone_quota(self, provider_id: ProviderId) -> DroneQuota:
        """How many drones a provider may have, and has."""
        path = f"/internal/providers/{provider_id}/drone-quota"
        return await self._client.call("GET", path, answer=DroneQuota)

    async def has_provider(self, provider_id: ProviderId, *, caller: Caller) -> bool:
        """Whether this provider is registered, as far as the caller may know."""
        try:
            await self._client.call("GET", f"/v1/providers/{provider_id}", caller=caller)
        except RemoteProblem as problem:
            if problem.status == HTTPStatus.NOT_FOUND:
                return False
            raise
        return True

    async def open_account(self, role: AccountRole, name: SubjectId, *, password: str) -> None:
        """Open a broker account, or give it another password."""
        body = _BrokerPassword(password=password)
        await self._client.call("PUT", f"/internal/{_ACCOUNTS[role]}/{name}", body=body)

    async def drone_of(self, key_hash: str) -> DroneId | None:
        """The drone with this key; None when the key is unknown or no longer valid."""
        query = DroneKeyQuery(key_hash=key_hash)
        answer = await self._client.call(
            "POST", "/internal/drone-keys", body=query, answer=DroneKeyAnswer
        )
        return answer.drone_id

    async def close_account(self, role: AccountRole, name: SubjectId) -> None:
        """Close a broker account; an account that does not exist is closed already."""
        await self._client.call("DELETE", f"/internal/{_ACCOUNTS[role]}/{name}")

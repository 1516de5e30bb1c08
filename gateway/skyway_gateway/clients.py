"""What the gateway asks of registry and composition: two protocols, and their clients over REST.

Each call to composition goes to the server that serves its network.
"""

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Annotated, Final, Protocol

from pydantic import Field

from skyway.announced_networks import CachedNetworks, check_stations
from skyway.cells import CellClients, ask_all
from skyway.contracts.broker_rules import AccountRole
from skyway.contracts.candidate import (
    CANDIDATE_LISTS,
    CandidateQueries,
    CandidateQuery,
    PayloadLimit,
    PayloadLimitQuery,
)
from skyway.contracts.drones import DroneKeyAnswer, DroneKeyQuery, DroneQuota
from skyway.contracts.forgotten_deliveries import (
    FORGOTTEN_PATH,
    ForgetDeliveries,
    KeptDeliveries,
)
from skyway.contracts.mission import (
    Booking,
    BookMissions,
    Cancellation,
    CancelMissions,
    ClosedDelivery,
    WithdrawMissions,
)
from skyway.contracts.quote import KeepOffer, KeptOffer, QuoteAnswer, QuoteQuery
from skyway.contracts.shortlist import CandidateLists, Candidates
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.contracts.track import Track
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, DroneId, HoldId, NetworkId, ProviderId, StationId, SubjectId
from skyway.json_model import WireModel
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Database
from skyway_gateway import network_store

log = logging.getLogger(__name__)

#: Why a proof comes too late: another try cannot succeed.
_TOO_LATE: Final = ("NOT_AWAITED", "MISSION_OVER")

#: Where composition is asked to cancel packages.
CANCELLATIONS_PATH: Final = "/internal/deliveries/{delivery_id}/cancellations"

#: Where composition is notified that the proof of a package is there.
PROOFS_PATH: Final = "/internal/deliveries/{delivery_id}/proofs"


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


class DeliveryComposition(Protocol):
    """Composition, as far as it is asked about deliveries that exist."""

    async def book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        """Book the best plan; asked again for the same attempt, the answer is the same."""
        ...

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Refuse all further bookings of a delivery."""
        ...

    async def cancel(self, delivery_id: DeliveryId, requested: CancelMissions) -> Cancellation:
        """Leave packages at the pickup, or bring them back, as far as possible."""
        ...

    async def withdraw(self, delivery_id: DeliveryId, requested: WithdrawMissions) -> None:
        """Give up the missions of a delivery whose request changes, if no drone has one."""
        ...

    async def track(self, delivery_id: DeliveryId) -> Track:
        """Where the delivery's drones have been, are and will be."""
        ...

    async def forget(self, asked: ForgetDeliveries) -> KeptDeliveries:
        """Delete deliveries that ended long ago, except those that are still needed."""
        ...


class Composition(DeliveryComposition, Protocol):
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
        return await self._client.call("POST", CANDIDATE_LISTS, body=asked, answer=CandidateLists)

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


#: How long composing may take, wall seconds. A repeated PUT gets the same answer.
_COMPOSING_S: Final = 20.0


@dataclass(frozen=True, slots=True)
class NetworkFinder:
    """Finds the network of a station or a delivery; without cells it asks no server."""

    servers: CellClients
    networks: CachedNetworks
    db: Database

    async def of_station(self, station_id: StationId) -> NetworkId | None:
        """The network of a station; None if no server knows it. A silent server may know it."""
        if not self.servers.needs_networks:
            return None
        cached = self.networks.network_of(station_id) or self.networks.last_network_of(station_id)
        if cached is not None:
            return cached
        query = StationCheckQuery(station_ids=(station_id,))
        return (await check_stations(self.servers, query)).network_ids.get(station_id)

    async def of_delivery(self, delivery_id: DeliveryId) -> NetworkId | None:
        """The network of a delivery; None if the gateway does not know the delivery."""
        return (await self.of_deliveries({delivery_id})).get(delivery_id)

    async def of_deliveries(
        self, delivery_ids: Collection[DeliveryId]
    ) -> Mapping[DeliveryId, NetworkId | None]:
        """The network of each of these deliveries that the gateway knows."""
        if not self.servers.cells:
            return dict.fromkeys(delivery_ids)
        async with self.db.read() as connection:
            found = await network_store.networks_of(connection, delivery_ids)
        return {
            delivery_id: network_id or await self.of_station(pickup)
            for delivery_id, (network_id, pickup) in found.items()
        }


@dataclass(frozen=True, slots=True)
class RoutedComposition:
    """`Composition` over REST, at the servers of all networks.

    The error of a silent server names its cell. A closed network gets no new quotes and bookings.
    """

    servers: CellClients
    find: NetworkFinder

    async def must_accept(self, pickup: StationId) -> None:
        """Go on only if the network of this pickup accepts new requests."""
        self.servers.open_for(await self.find.of_station(pickup))

    async def check_stations(self, query: StationCheckQuery) -> StationCheck:
        """Whether stations exist, where they are, and whether a path leads to them."""
        return await check_stations(self.servers, query)

    async def quote(self, query: QuoteQuery) -> QuoteAnswer:
        """The offers of all providers now, the best first; some are held if the query asks."""
        server = await self._open_at(query.request)
        return await server.call(
            "POST", "/internal/quotes", body=query, answer=QuoteAnswer, timeout_s=_COMPOSING_S
        )

    async def keep(self, asked: KeepOffer) -> KeptOffer:
        """Hold an offer until it is booked, or say why it cannot be held."""
        server = await self._open_at(asked.request)
        return await server.call("POST", "/internal/offers", body=asked, answer=KeptOffer)

    async def release(self, hold_id: HoldId) -> None:
        """Release a hold, at the server that has the hold."""

        async def ask(client: ServiceClient) -> None:
            await client.call("DELETE", f"/internal/holds/{hold_id}")

        (await ask_all(self.servers.every(), ask)).must_be_whole()

    async def book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        """Book the best plan; a repeated call for the same attempt has the same answer."""
        server = await self._open_at(requested.request)
        path = f"/internal/deliveries/{delivery_id}/missions"
        return await server.call(
            "PUT", path, body=requested, answer=Booking, timeout_s=_COMPOSING_S
        )

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Refuse all further bookings of a delivery."""
        path = f"/internal/deliveries/{delivery_id}/closed"
        return await (await self._server_of(delivery_id)).call("PUT", path, answer=ClosedDelivery)

    async def cancel(self, delivery_id: DeliveryId, requested: CancelMissions) -> Cancellation:
        """Leave packages at the pickup, or bring them back, as far as possible."""
        server, path = await self._server_of(delivery_id), CANCELLATIONS_PATH
        return await server.call(
            "POST", path.format(delivery_id=delivery_id), body=requested, answer=Cancellation
        )

    async def withdraw(self, delivery_id: DeliveryId, requested: WithdrawMissions) -> None:
        """Give up the missions of a delivery whose request changes, if no drone has one."""
        path = f"/internal/deliveries/{delivery_id}/withdrawals"
        await (await self._server_of(delivery_id)).call("POST", path, body=requested)

    async def track(self, delivery_id: DeliveryId) -> Track:
        """Where the delivery's drones have been, are and will be."""
        path = f"/internal/deliveries/{delivery_id}/track"
        return await (await self._server_of(delivery_id)).call("GET", path, answer=Track)

    async def forget(self, asked: ForgetDeliveries) -> KeptDeliveries:
        """Delete deliveries that ended long ago; those of a silent cell are kept."""
        networks = await self.find.of_deliveries(asked.delivery_ids)
        kept: list[DeliveryId] = []
        for network_id in dict.fromkeys(networks.values()):
            some = tuple(each for each, found in networks.items() if found == network_id)
            body, server = ForgetDeliveries(delivery_ids=some), self.servers.of(network_id)
            try:
                answer = await server.call("POST", FORGOTTEN_PATH, body=body, answer=KeptDeliveries)
            except ServiceUnavailable:
                if len(some) == len(networks):
                    raise
                kept += some
            else:
                kept += answer.kept
        return KeptDeliveries(kept=tuple(sorted(kept)))

    async def _open_at(self, request: DeliveryRequest) -> ServiceClient:
        return self.servers.open_for(await self.find.of_station(request.pickup.station_id))

    async def _server_of(self, delivery_id: DeliveryId) -> ServiceClient:
        return self.servers.of(await self.find.of_delivery(delivery_id))


@dataclass(frozen=True, slots=True)
class DeliveryReports:
    """`ServicePort` of the outbox: each message about a delivery goes to the delivery's server."""

    servers: CellClients
    find: NetworkFinder

    async def call(self, method: str, path: str, *, body: bytes) -> None:
        """Call the server with JSON. A proof that comes too late for its drone is dropped."""
        # Every path is below /internal/deliveries/{delivery_id}.
        delivery_id = DeliveryId(path.split("/")[3])
        network_id = await self.find.of_delivery(delivery_id)
        try:
            await self.servers.of(network_id).call(method, path, body=body)
        except RemoteProblem as refusal:
            if not path.endswith("/proofs") or refusal.problem.get("code") not in _TOO_LATE:
                raise
            # Composition is notified again when a drone waits again.
            log.info("proof came too late", extra={"delivery_id": delivery_id})

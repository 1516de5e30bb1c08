"""The gateway's calls to composition: each call goes to the server that serves its network."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from skyway.announced_networks import CachedNetworks, check_stations
from skyway.cells import CellClients, ask_all
from skyway.contracts.forgotten_deliveries import ForgetDeliveries, KeptDeliveries
from skyway.contracts.mission import (
    Booking,
    BookMissions,
    Cancellation,
    CancelMissions,
    ClosedDelivery,
)
from skyway.contracts.quote import KeepOffer, KeptOffer, QuoteAnswer, QuoteQuery
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.contracts.track import Track
from skyway.ids import DeliveryId, HoldId, NetworkId, StationId
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.sql.database import Database
from skyway_gateway import network_store
from skyway_gateway.clients import RestComposition


@dataclass(frozen=True, slots=True)
class NetworkFinder:
    """Finds the network of a station or of a delivery; without cells it asks no server."""

    servers: CellClients
    networks: CachedNetworks
    db: Database

    async def of_station(self, station_id: StationId) -> NetworkId | None:
        """The network of a station; None if no server knows the station.

        Raises
        ------
        ServiceUnavailable
            A server does not answer, and may have the station.
        """
        if not self.servers.has_cells:
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
        if not self.servers.has_cells:
            return dict.fromkeys(delivery_ids)
        async with self.db.read() as connection:
            found = await network_store.networks_of(connection, delivery_ids)
        return {
            delivery_id: network_id or await self.of_station(pickup)
            for delivery_id, (network_id, pickup) in found.items()
        }


@dataclass(frozen=True, slots=True)
class RoutedComposition:
    """`Composition` at the servers of all networks.

    A call raises `ServiceUnavailable` with the name of the cell if the cell's server does not
    answer. A closed cell gets no new quotes and bookings.
    """

    servers: CellClients
    find: NetworkFinder

    async def must_accept(self, pickup: StationId) -> None:
        """Go on only if the network of this pickup accepts new requests."""
        self.servers.must_be_open(await self.find.of_station(pickup))

    async def check_stations(self, query: StationCheckQuery) -> StationCheck:
        """Whether stations exist, where they are, and whether a path leads to them."""
        if not self.servers.has_cells:
            return await RestComposition(self.servers.default).check_stations(query)
        return await check_stations(self.servers, query)

    async def quote(self, query: QuoteQuery) -> QuoteAnswer:
        """The offers of all providers now, the best first; some are held if the query asks."""
        return await (await self._open_at(query.request.pickup.station_id)).quote(query)

    async def keep(self, asked: KeepOffer) -> KeptOffer:
        """Hold an offer until it is booked, or say why it cannot be held."""
        return await (await self._open_at(asked.request.pickup.station_id)).keep(asked)

    async def release(self, hold_id: HoldId) -> None:
        """Release a hold, at the server that has the hold."""

        async def ask(client: ServiceClient) -> None:
            await RestComposition(client).release(hold_id)

        (await ask_all(self.servers.every(), ask)).must_be_whole()

    async def book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        """Book the best plan; a repeated call for the same attempt has the same answer."""
        server = await self._open_at(requested.request.pickup.station_id)
        return await server.book(delivery_id, requested)

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Refuse all further bookings of a delivery."""
        return await (await self._server_of(delivery_id)).close(delivery_id)

    async def cancel(self, delivery_id: DeliveryId, requested: CancelMissions) -> Cancellation:
        """Leave packages at the pickup, or bring them back, as far as possible."""
        return await (await self._server_of(delivery_id)).cancel(delivery_id, requested)

    async def track(self, delivery_id: DeliveryId) -> Track:
        """Where the delivery's drones have been, are and will be."""
        return await (await self._server_of(delivery_id)).track(delivery_id)

    async def forget(self, asked: ForgetDeliveries) -> KeptDeliveries:
        """Delete deliveries that ended long ago; those of a silent cell are kept."""
        networks = await self.find.of_deliveries(asked.delivery_ids)
        kept: list[DeliveryId] = []
        for network_id in dict.fromkeys(networks.values()):
            some = [each for each, found in networks.items() if found == network_id]
            try:
                server = RestComposition(self.servers.of(network_id))
                answer = await server.forget(ForgetDeliveries(delivery_ids=tuple(some)))
            except ServiceUnavailable:
                if len(some) == len(networks):
                    raise
                kept += some
            else:
                kept += answer.kept
        return KeptDeliveries(kept=tuple(sorted(kept)))

    async def _open_at(self, pickup: StationId) -> RestComposition:
        return RestComposition(self.servers.open_for(await self.find.of_station(pickup)))

    async def _server_of(self, delivery_id: DeliveryId) -> RestComposition:
        return RestComposition(self.servers.of(await self.find.of_delivery(delivery_id)))


@dataclass(frozen=True, slots=True)
class DeliveryReports:
    """`ServicePort` of the outbox: each message about a delivery goes to the delivery's server."""

    servers: CellClients
    find: NetworkFinder

    async def call(self, method: str, path: str, *, body: bytes) -> None:
        """Call the server with JSON."""
        # Every path is below /internal/deliveries/{delivery_id}.
        network_id = await self.find.of_delivery(DeliveryId(path.split("/")[3]))
        await self.servers.of(network_id).call(method, path, body=body)

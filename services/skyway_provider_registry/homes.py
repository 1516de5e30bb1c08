"""The homes of drones, as composition knows them, and what would never fly from one."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple, Protocol

from skyway.announced_networks import check_stations
from skyway.cells import CellClients
from skyway.contracts.business_faults import BusinessFaultCode
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.delivery.offer import Tariff
from skyway.drone.model import DroneModel
from skyway.ids import NetworkId, StationId


class StationLookup(Protocol):
    """Answers which stations exist, and what drones with homes there meet."""

    async def check(self, station_ids: Iterable[StationId]) -> StationCheck:
        """The positions of the existing stations among these, and the unknown station ids."""
        ...


class CompositionStations:
    """`StationLookup` that asks composition, at every server that it has."""

    def __init__(self, servers: CellClients) -> None:
        self._servers = servers

    async def check(self, station_ids: Iterable[StationId]) -> StationCheck:
        """The positions of the existing stations among these, and the unknown station ids."""
        query = StationCheckQuery(station_ids=tuple(dict.fromkeys(station_ids)), as_homes=True)
        return await check_stations(self._servers, query)


class HomeFault(NamedTuple):
    """Why a drone with this home gets no deliveries: the field at fault, and a sentence."""

    code: BusinessFaultCode
    field: str
    detail: str


def home_faults(
    station_id: StationId, model: DroneModel | None, tariff: Tariff, check: StationCheck
) -> Iterator[HomeFault]:
    """The faults of a home for a drone of this model and provider."""
    if station_id in check.unknown:
        detail = f"no station is called {station_id!r}"
        yield HomeFault("HOME_UNKNOWN", "home_station_id", detail)
        return
    if station_id in check.isolated:
        detail = f"no segment begins at {station_id}: a drone cannot leave it"
        yield HomeFault("HOME_ISOLATED", "home_station_id", detail)
    if station_id not in check.network_ids:
        return
    network_id = check.network_ids[station_id]
    if (other := currency_fault(tariff, check, station_id)) is not None:
        yield HomeFault("OTHER_CURRENCY", "home_station_id", other)
    facts = check.networks.get(network_id)
    connector = None if model is None else model.connector
    if facts is None or connector is None or facts.connectors is None:
        return
    if connector not in facts.connectors:
        known = ", ".join(sorted(facts.connectors))
        detail = f"its connector {connector} fits no pad of network {network_id}, which has {known}"
        yield HomeFault("OTHER_CONNECTOR", "model_id", detail)


def currency_fault(tariff: Tariff, check: StationCheck, station_id: StationId) -> str | None:
    """Why drones with this tariff get no deliveries at this station; None if they get some."""
    network_id = check.network_ids[station_id]
    facts = check.networks.get(network_id)
    if facts is None or facts.currency == tariff.currency:
        return None
    return (
        f"prices in network {network_id}, where {station_id} is, are in {facts.currency}, and the "
        f"provider's tariff is in {tariff.currency}: its drones would get no deliveries"
    )


def price_fault(tariff: Tariff, check: StationCheck, network_id: NetworkId) -> str | None:
    """Why the cheapest delivery costs too much for the network; None if it does not.

    Prices in another currency are not compared: `currency_fault` names them.
    """
    facts, least = check.networks.get(network_id), max(tariff.base, tariff.minimum)
    if facts is None or facts.price_ceiling is None or facts.currency != tariff.currency:
        return None
    if least <= facts.price_ceiling:
        return None
    return (
        f"requests without max_price get no offer above {facts.price_ceiling} in network "
        f"{network_id}, its price_ceiling, and each delivery costs {least} or more by the tariff, "
        f"both in minor units of {tariff.currency}: lower the tariff's base and minimum"
    )

"""Tells composition which settings of providers get no deliveries, since something else changed.

A home, a model or a tariff that would get none is refused when it is set. A network may change
later: its currency, its pads, its stations, its price ceiling.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

from skyway.cells import CellClients, ask_all
from skyway.contracts.business_faults import (
    BUSINESS_FAULTS,
    MOST_FAULTS,
    BusinessFault,
    BusinessFaultCode,
    BusinessFaults,
)
from skyway.contracts.station_check import StationCheck
from skyway.drone.model import DroneModel
from skyway.ids import DroneModelId, NetworkId, ProviderId
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.sql.database import Database
from skyway_provider_registry.fleets.store import every_model
from skyway_provider_registry.homes import StationLookup, home_faults, price_fault
from skyway_provider_registry.providers.store import DroneKind, kinds_of_drones

log = logging.getLogger(__name__)

#: The most homes of one question to composition.
_MOST_HOMES: Final = 2_000

_Key = tuple[ProviderId, NetworkId, BusinessFaultCode]


@dataclass(frozen=True, slots=True)
class BusinessAnnouncer:
    """Posts all faults to each server of composition, which raises and ends the alarms."""

    db: Database
    stations: StationLookup
    servers: CellClients

    async def step(self) -> bool:
        """Step of a loop: look at the settings of all providers; always False.

        Raises
        ------
        ServiceUnavailable
            A server of composition is away; the next step posts the same again.
        """
        faults = await self._faults()

        async def post(client: ServiceClient) -> None:
            own = [each for each in faults if self.servers.url_of(each.network_id) == client.url]
            if len(own) > MOST_FAULTS:
                about = {"server": client.name, "faults": len(own), "most": MOST_FAULTS}
                log.warning("business faults left out", extra=about)
            report = BusinessFaults(faults=tuple(own[:MOST_FAULTS]))
            await client.call("POST", BUSINESS_FAULTS, body=report)

        (await ask_all(self.servers.every(), post)).must_be_whole()
        return False

    async def _faults(self) -> Sequence[BusinessFault]:
        """The first fault of each code that a provider has in a network, sorted by provider."""
        async with self.db.read() as connection:
            kinds = await kinds_of_drones(connection)
            models = await every_model(connection)
        homes = sorted({kind.home_station_id for kind in kinds})
        found: dict[_Key, BusinessFault] = {}
        for first in range(0, len(homes), _MOST_HOMES):
            asked = homes[first : first + _MOST_HOMES]
            check, among = await self.stations.check(asked), set(asked)
            for kind in kinds:
                if kind.home_station_id in among:
                    for fault in business_faults(kind, models, check):
                        key = fault.provider_id, fault.network_id, fault.code
                        found.setdefault(key, fault)
        return [found[key] for key in sorted(found)]


def business_faults(
    kind: DroneKind, models: Mapping[DroneModelId, DroneModel], check: StationCheck
) -> Iterator[BusinessFault]:
    """Why drones of this kind get no deliveries in the network of their home."""
    network_id = check.network_ids.get(kind.home_station_id, kind.network_id)
    fault = partial(BusinessFault, provider_id=kind.provider_id, network_id=network_id)
    model = models.get(kind.model_id)
    for code, _, why in home_faults(kind.home_station_id, model, kind.tariff, check):
        detail = (
            f"drones of model {kind.model_id} with the home {kind.home_station_id} get no "
            f"deliveries: {why}; {_CHANGES[code]}"
        )
        yield fault(code=code, detail=detail)
    if (dear := price_fault(kind.tariff, check, network_id)) is not None:
        yield fault(code="ABOVE_PRICE_CEILING", detail=dear)


#: What a provider changes to get deliveries again.
_CHANGES: Final[Mapping[BusinessFaultCode, str]] = {
    "HOME_UNKNOWN": "give these drones another home",
    "HOME_ISOLATED": "give these drones another home",
    "OTHER_CURRENCY": "set a tariff in the currency of the network, or move these drones",
    "OTHER_CONNECTOR": "use a model with another connector, or move these drones",
}

"""Where drones are at home: composition knows which stations there are."""

from collections.abc import Iterable
from typing import Protocol

from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.ids import StationId
from skyway.runtime.http.client import ServiceClient


class StationLookup(Protocol):
    """Who can say which stations exist, and where."""

    async def check(self, station_ids: Iterable[StationId]) -> StationCheck:
        """The known ones of these stations with their positions, and the unknown ones."""
        ...


class CompositionStations:
    """`StationLookup` by asking composition."""

    def __init__(self, composition: ServiceClient) -> None:
        self._composition = composition

    async def check(self, station_ids: Iterable[StationId]) -> StationCheck:
        """The known ones of these stations with their positions, and the unknown ones."""
        query = StationCheckQuery(station_ids=tuple(dict.fromkeys(station_ids)))
        return await self._composition.call(
            "POST", "/internal/station-checks", body=query, answer=StationCheck
        )

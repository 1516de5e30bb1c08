"""Looks up home stations: composition owns the networks and their stations."""

from collections.abc import Iterable
from typing import Protocol

from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.ids import StationId
from skyway.runtime.http.client import ServiceClient


class StationLookup(Protocol):
    """Answers which stations exist, and their positions."""

    async def check(self, station_ids: Iterable[StationId]) -> StationCheck:
        """The positions of the existing stations among these, and the unknown station ids."""
        ...


class CompositionStations:
    """`StationLookup` that asks composition."""

    def __init__(self, composition: ServiceClient) -> None:
        self._composition = composition

    async def check(self, station_ids: Iterable[StationId]) -> StationCheck:
        """The positions of the existing stations among these, and the unknown station ids."""
        query = StationCheckQuery(station_ids=tuple(dict.fromkeys(station_ids)))
        return await self._composition.call(
            "POST", "/internal/station-checks", body=query, answer=StationCheck
        )

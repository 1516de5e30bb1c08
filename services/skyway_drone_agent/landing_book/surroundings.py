"""The stations around a flight, as far as they are known."""

from typing import Final

from skyway.contracts.flight_step import FlyStep
from skyway.geo import point_between
from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.landing_book.extract import Extract

#: So many places of a flight are looked at, its ends among them, and so many landings of each.
_PLACES: Final = 8
_LANDINGS: Final = 4


class Surroundings:
    """What is known around a flight; `edition` is another number when that has changed."""

    __slots__ = ("_extract", "edition")

    def __init__(self, extract: Extract) -> None:
        self.edition = 0
        self._extract = extract

    def landings_along(self, flight: FlyStep) -> tuple[Landing, ...]:
        """The open stations of this flight's network that are nearest to places along it."""
        start, end = flight.from_position, flight.to_position
        station = self._extract.station(Landing(flight.to_id, end)) or self._extract.station(
            Landing(flight.from_id, start)
        )
        if station is None:
            return ()
        found: dict[Landing, None] = {}
        for place in range(_PLACES):
            here = point_between(start, end, fraction=place / (_PLACES - 1))
            for one in self._extract.nearest(here, count=_LANDINGS):
                if one.network_id == station.network_id:
                    found[one.landing] = None
        return tuple(found)

    def is_closed(self, landing: Landing) -> bool:
        """Whether this station was closed when its surroundings were read."""
        station = self._extract.station(landing)
        return station is not None and station.is_closed

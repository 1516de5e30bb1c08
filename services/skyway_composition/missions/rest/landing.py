"""The nearest station where a drone in trouble can land: open, and in reach above the reserve."""

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from typing import Self

from skyway.delivery.plan import Fly
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway.network.network import Network
from skyway_composition.missions.rest.anchor import Anchor
from skyway_composition.missions.rest.closed_ahead import ClosedAhead


@dataclass(frozen=True, slots=True)
class Landing:
    """Where a drone lands, after these flights; seconds count from the anchor's moment."""

    station_id: StationId
    at_s: float
    soc: float
    flights: tuple[Fly, ...] = ()

    def landed(self, model: DroneModel) -> Self:
        """The same with what it takes to land there, in the last flight as in plans."""
        at_s, soc = self.at_s + model.stop_s, self.soc - model.stop_j / model.battery_j
        *others, last = self.flights
        landing = last.model_copy(
            update={"end_s": at_s, "energy_j": last.energy_j + model.stop_j, "soc_end": soc}
        )
        return type(self)(self.station_id, at_s, soc, (*others, landing))


@dataclass(frozen=True, slots=True)
class LandingSearch:
    """Where a drone could land; `model` has the margin that flights are planned with."""

    network: Network
    closed: ClosedAhead
    model: DroneModel
    load_kg: float

    def nearest(self, anchor: Anchor) -> Landing | None:
        """The landing with the smallest flight time from the anchor; None when none is in reach.

        A drone that can stand at the anchor stays there. Time and energy both grow with the length
        flown, so that the first landing found is the best.
        """
        start = self.here(anchor)
        if not anchor.is_in_the_air:
            return start
        order = count()
        ahead = [(0.0, next(order), start)]
        seen: set[StationId] = set()
        while ahead:
            _, _, here = heappop(ahead)
            if here.station_id in seen:
                continue
            seen.add(here.station_id)
            if here.flights and self._is_safe(here.landed(self.model), anchor):
                return here.landed(self.model)
            for following in self._flown_on(here, anchor):
                heappush(ahead, (following.at_s, next(order), following))
        return None

    def here(self, anchor: Anchor) -> Landing:
        """The anchor itself, open or not."""
        return Landing(anchor.station_id, 0.0, anchor.soc)

    def _is_safe(self, landed: Landing, anchor: Anchor) -> bool:
        at_ms = anchor.at_ms + landed.at_s * 1000
        is_open = not self.closed.closes_landing(landed.station_id, at_ms)
        return is_open and landed.soc >= self.model.reserve_soc

    def _flown_on(self, here: Landing, anchor: Anchor) -> Iterator[Landing]:
        if here.station_id not in self.network.stations:
            return
        model, load_kg = self.model, self.load_kg
        for segment in self.network.segments_from(here.station_id):
            length_m = segment.length_m
            at_s = here.at_s + flight_time_s(model, length_m=length_m, load_kg=load_kg)
            energy_j = flight_energy_j(model, length_m=length_m, load_kg=load_kg)
            soc = here.soc - energy_j / model.battery_j
            is_closed = self.closed.closes_segment(
                segment.from_id,
                segment.to_id,
                start_ms=anchor.at_ms + here.at_s * 1000,
                end_ms=anchor.at_ms + at_s * 1000,
            )
            if is_closed or soc < model.reserve_soc:
                continue
            flight = Fly(
                from_id=segment.from_id,
                to_id=segment.to_id,
                start_s=here.at_s,
                end_s=at_s,
                load_kg=load_kg,
                energy_j=energy_j,
                soc_end=soc,
            )
            yield Landing(segment.to_id, at_s, soc, (*here.flights, flight))

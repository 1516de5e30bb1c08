"""A day in virtual time: a real composition and real agents on a clock that is moved.

`python -m tests.composition.virtual_day --days stormy --deliveries 12 --drones 12` has the options
of the benchmark `days`. It has no gateway, registry or broker, and the same seed gives the same day
on every machine. Links fail as in the scenario. Wall time moves with the clock, at the clock rate.
"""

import json
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from datetime import datetime, timedelta
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

from skyway_composition.missions.mission.store import MissionFilter, page
from skyway_composition.networks.change_weather import WeatherChanges
from skyway_composition.networks.measure_wind import MeasuredWinds
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.networks.publish import read_content
from skyway_composition.networks.station_store import replace_stations
from skyway_composition.networks.store import VersionRow, add_version
from skyway_drone_agent.simulated.disturbances import changed, read_scenario
from skyway_drone_agent.simulated.link_loss import has_outages, outages
from skyway_lab.benchmarks.days.__main__ import main
from skyway_lab.benchmarks.days.day import Trial, connected, requests_in
from skyway_lab.benchmarks.days.figures import SENSOR_ERROR_SOC, Day
from skyway_lab.benchmarks.days.forecast import forecast_of

from skyway.contracts.flight_step import FlyStep
from skyway.contracts.mission_reports import MissionReport
from skyway.contracts.weather import ForecastDocument
from skyway.delivery.lateness import later_by_s
from skyway.delivery.request import DeliveryRequest
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.network.bundled import texas_corridor
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.migrations import migrate
from tests.composition.busy_network import NETWORK_ID
from tests.composition.busy_world import BusyWorld
from tests.composition.flown_drone import FlownDrone

#: The day ends when all missions are over, at the latest so long after the last request.
_OVER_WITHIN: Final = timedelta(hours=30)

_STRIDE: Final = timedelta(minutes=20)


async def fly_virtually(trial: Trial) -> Day:
    """Fly all deliveries of a day in virtual time, and measure them."""
    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite:///{Path(folder) / 'day.db'}"
        await migrate(url, "skyway_composition")
        async with DayWorld(url, trial) as world:
            await world.fly()
            return await world.measured()


class DayWorld(BusyWorld):
    """The bundled corridor on a day of the simulator."""

    flight_stride = timedelta(seconds=30)

    def __init__(self, url: str, trial: Trial) -> None:
        super().__init__(url, rate=trial.clock_rate)
        self.trial = trial
        self.network = texas_corridor()
        self.chance = random.Random(trial.seed)
        self.day = changed(read_scenario(trial.scenario), {"seed": trial.seed})
        #: When each package comes by the plan of its booking, and its P90 as the gateway makes it
        #: before it has learned any lateness. Without a forecast both moments are the same.
        self.promised: dict[str, datetime] = {}
        self.due: dict[str, datetime] = {}
        self._waiting: list[str] = []

    async def add_network(self, tx: Tx) -> None:
        """Add the bundled corridor."""
        content = await read_content(self.trial.document(self.network))
        row = VersionRow(NETWORK_ID, 1, content.sha256, self.now_ms)
        await add_version(tx, row, content=content.geojson)
        await replace_stations(tx, NETWORK_ID, content.network.stations.values())

    def restart(self) -> None:
        """With the loop that makes weather of what drones measure."""
        super().restart()
        self.sweeps = (*self.sweeps, MeasuredWinds(self.db, self.clock, Wake()))

    def make_drones(self) -> Iterator[FlownDrone]:
        """The drones at homes all over the corridor."""
        homes = self.chance.choices(connected(self.network), k=self.trial.drones)
        for number, home in enumerate(homes, 1):
            drone = FlownDrone(
                f"drn_{number}",
                model=DJI_MATRICE_300_RTK,
                home=home,
                position=self.network.stations[home].position,
                clock=self.clock,
            )
            drone.disturbances = self.day
            yield drone

    async def settle(self) -> None:
        """Let the agents run, those in an outage without a link."""
        for drone in self.drones:
            is_up = not self._is_out(drone)
            if drone.has_reception != is_up:
                drone.set_reception(is_up)
        await super().settle()

    def _is_out(self, drone: FlownDrone) -> bool:
        """Whether the drone's link is down now."""
        if not has_outages(self.day, drone.drone_id):
            return False
        by_wall = self.day.link.seconds == "wall"
        now = self.clock.wall_now() if by_wall else self.clock.now()
        return next(outages(now, disturbed=self.day, drone_id=drone.drone_id)).from_at <= now

    async def fly(self) -> None:
        """Request the deliveries one after the other, and fly until all missions are over."""
        began_at = self.clock.now()
        await self._forecast(began_at)
        bodies = requests_in(self.network, self.trial.deliveries, self.chance)
        for number, body in enumerate(bodies):
            at = began_at + timedelta(seconds=number * self.trial.every_s)
            await self.pass_time(max(timedelta(0), at - self.clock.now()))
            body["packages"][0]["package_id"] = f"p{number}"
            self.requests[f"dlv{number}"] = DeliveryRequest.model_validate(body)
            self._waiting.append(f"dlv{number}")
            await self._book_waiting()
        until = self.clock.now() + _OVER_WITHIN
        while (self._waiting or await self.planned()) and self.clock.now() < until:
            await self.pass_time(_STRIDE)
            await self._book_waiting()

    async def _forecast(self, now: datetime) -> None:
        error_mps, seed = self.trial.error_mps, self.trial.seed
        if error_mps is None:
            return
        body = forecast_of(self.day, self.network, from_at=now, error_mps=error_mps, seed=seed)
        networks, impact = PreparedNetworks(self.db, self.clock), self.closings.impact
        changes = WeatherChanges(self.db, networks, impact, self.clock, calendars=Wake())
        await changes.put(NETWORK_ID, ForecastDocument.model_validate_json(json.dumps(body)))

    async def _book_waiting(self) -> None:
        """Book what waits for a drone, in the order of the requests."""
        for delivery_id in self._waiting:
            request = self.requests[delivery_id]
            outcome = await self.book(delivery_id, request, loading="AUTOMATIC")
            if outcome != "BOOKED":
                break
            async with self.db.read() as connection:
                records = await page(connection, MissionFilter(), before=None, limit=10_000)
            for record in records:
                share = record.mission.margins.late_share or 0.0
                for each in record.mission.packages:
                    if each.package_id not in self.promised:
                        planned_s = (each.eta_at - record.mission.start_at).total_seconds()
                        later = timedelta(seconds=later_by_s(planned_s, share))
                        self.promised[each.package_id] = each.eta_at
                        self.due[each.package_id] = each.eta_at + later
            await self.keep_calendars()
        booked = self.promised.keys()
        self._waiting = [
            each
            for each in self._waiting
            if self.requests[each].packages[0].package_id not in booked
        ]

    async def measured(self) -> Day:
        """The figures of the day."""
        reports = await self.reports()
        async with self.db.read() as connection:
            records = await page(connection, MissionFilter(), before=None, limit=10_000)
        delivered = {
            package_id: each.at
            for each in reports
            if each.kind == "DELIVERED"
            for package_id in each.package_ids
        }
        socs = [soc for drone in self.drones for soc in _socs_at_landings(drone)]
        least_soc = DJI_MATRICE_300_RTK.reserve_soc - SENSOR_ERROR_SOC
        return Day(
            states=Counter(each.mission.state for each in records)
            + Counter({"WAITING": len(self._waiting)}),
            late_min=[
                (at - self.promised[package_id]).total_seconds() / 60
                for package_id, at in delivered.items()
            ],
            late_of_due_min=[
                (at - self.due[package_id]).total_seconds() / 60
                for package_id, at in delivered.items()
            ],
            by_p90=[
                at <= self.due[package_id]
                for package_id, at in delivered.items()
                if self.due[package_id] != self.promised[package_id]
            ],
            new_plans=[
                each.mission.revision - 1 for each in records if each.mission.state != "REFUSED"
            ],
            refused=sum(each.mission.state == "REFUSED" for each in records),
            landings=len(socs),
            landings_below_reserve=sum(soc < least_soc for soc in socs),
            down=sum(drone.logbook.is_down for drone in self.drones),
            replanned_by=_codes(reports, "REPLANNED"),
            ended_by=_codes(reports, "ENDED"),
        )


def _codes(reports: list[MissionReport], kind: str) -> Counter[str]:
    """How often reports of this kind have each code."""
    return Counter(each.code for each in reports if each.kind == kind and each.code is not None)


def _socs_at_landings(drone: FlownDrone) -> Iterator[float]:
    """The charge after each flight that ended at a station and was followed by no other flight."""
    events: list[Any] = [each for each in drone.journal.happened if each.event != "ALARM"]
    for event, following in zip_longest(events, events[1:]):
        is_flight = event.step_kind == FlyStep.model_fields["kind"].default
        flies_on = (
            following is not None
            and following.step_kind == event.step_kind
            and following.started_at == event.ended_at
        )
        if is_flight and event.energy_j > 0 and event.station_id is not None and not flies_on:
            yield event.soc


if __name__ == "__main__":
    sys.exit(main(fly_virtually))

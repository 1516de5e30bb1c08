"""A new forecast closes the way of a drone in flight: the drone waits, or flies another way.

The drone flies from a to b, loads there and delivers at c. There is also a way from b over a to c.
"""

from collections.abc import Iterator
from datetime import datetime, timedelta

import pytest
from skyway_composition.networks.change_weather import WeatherChanges
from skyway_composition.networks.prepared import PreparedNetworks

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.weather import ForecastDocument
from skyway.delivery.request import DeliveryRequest
from skyway.runtime.loops import Wake
from tests.composition.busy_network import MODEL, NETWORK_ID, PLACES
from tests.composition.busy_world import BusyWorld
from tests.composition.flown_drone import FlownDrone

pytestmark = pytest.mark.databases("sqlite")


class WindyWorld(BusyWorld):
    """One drone, at a, that does not fly in more than 15 m/s."""

    def make_drones(self) -> Iterator[FlownDrone]:
        yield FlownDrone(
            "drn_1",
            model=MODEL.model_copy(update={"max_wind_mps": 15.0}),
            home="a",
            position=PLACES["a"],
            clock=self.clock,
        )

    async def put_wind(self, mps: dict[str, float], *, from_at: datetime, for_: timedelta) -> None:
        """Put the forecast of wind at these stations; before and after it the air is still."""
        changes = (self.clock.now(), 0.0), (from_at, 1.0), (from_at + for_, 0.0)
        reports = [
            {
                "station_id": station_id,
                "valid_at": at.isoformat(),
                "wind_speed_mps": share * mps.get(station_id, 0.0),
                "wind_from_deg": 270,
            }
            for at, share in changes
            for station_id in PLACES
        ]
        body = {"source": "test", "issued_at": self.clock.now().isoformat(), "reports": reports}
        networks, impact = PreparedNetworks(self.db, self.clock), self.closings.impact
        weather = WeatherChanges(self.db, networks, impact, self.clock, calendars=Wake())
        await weather.put(NETWORK_ID, ForecastDocument.model_validate(body))
        await self.converse()

    @property
    def flights(self) -> list[DroneEvent]:
        """The flights that have ended."""
        events = self.drones[0].journal.happened
        return [each for each in events if each.step_kind == "FLY" and each.event == "STEP_ENDED"]


async def in_flight(world: WindyWorld) -> None:
    """Book a delivery from b to c; the drone flies to b."""
    request = DeliveryRequest.model_validate(
        {
            "pickup": {"station_id": "b"},
            "packages": [
                {"package_id": "p", "mass_kg": 0.5, "destination": {"station_id": "c"}},
            ],
        }
    )
    assert await world.book("dlv1", request, loading="AUTOMATIC") == "BOOKED"
    await world.keep_calendars()
    await world.pass_time(timedelta(minutes=4))
    assert world.drones[0].logbook.is_airborne


async def new_plans(world: WindyWorld) -> list[str | None]:
    return [each.code for each in await world.reports() if each.kind == "REPLANNED"]


async def test_wind_that_will_pass_is_waited_out_at_a_station(migrated_url: str) -> None:
    async with WindyWorld(migrated_url) as world:
        await in_flight(world)
        closed_at = world.clock.now() + timedelta(minutes=8)

        everywhere = dict.fromkeys(PLACES, 25.0)
        await world.put_wind(everywhere, from_at=closed_at, for_=timedelta(hours=2))
        await world.end()

        first, loaded = world.flights[:2]
        assert (first.station_id, loaded.station_id) == ("b", "c")
        assert loaded.started_at is not None
        wait = loaded.started_at - (closed_at + timedelta(hours=2))
        assert timedelta(0) <= wait < timedelta(minutes=1)
        assert await new_plans(world) == ["WEATHER_AHEAD"]
        assert len(await world.handed_over()) == 1


@pytest.mark.parametrize(
    ("closed_for", "way"),
    [(timedelta(minutes=20), ["b", "c"]), (timedelta(hours=9), ["b", "a", "c"])],
)
async def test_a_drone_flies_around_wind_only_if_that_is_faster_than_waiting(
    migrated_url: str, closed_for: timedelta, way: list[str]
) -> None:
    async with WindyWorld(migrated_url) as world:
        await in_flight(world)

        # In the middle between b and c it is stronger than between them and a.
        wind = {"b": 20.0, "c": 20.0}
        closed_at = world.clock.now() + timedelta(minutes=8)
        await world.put_wind(wind, from_at=closed_at, for_=closed_for)
        await world.end()

        assert [each.station_id for each in world.flights][: len(way)] == way
        assert await new_plans(world) == ["WEATHER_AHEAD"]
        assert len(await world.handed_over()) == 1


async def test_a_drone_that_waits_goes_on_when_the_wind_ends_sooner(migrated_url: str) -> None:
    async with WindyWorld(migrated_url) as world:
        await in_flight(world)
        closed_at = world.clock.now() + timedelta(minutes=8)
        everywhere = dict.fromkeys(PLACES, 25.0)
        await world.put_wind(everywhere, from_at=closed_at, for_=timedelta(hours=12))
        await world.pass_time(timedelta(hours=4))
        assert world.drones[0].logbook.is_airborne is False

        soon, ends_at = (world.clock.now() + timedelta(minutes=each) for each in (1, 60))
        await world.put_wind(everywhere, from_at=soon, for_=ends_at - soon)
        await world.end()

        loaded = world.flights[1]
        assert loaded.station_id == "c"
        assert loaded.started_at is not None
        assert timedelta(0) <= loaded.started_at - ends_at < timedelta(minutes=1)
        assert await new_plans(world) == ["WEATHER_AHEAD", "CONDITIONS_CHANGED"]
        assert len(await world.handed_over()) == 1

"""Escapes to stations that are on no step of the mission: the landing book knows of them."""

from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.analysis.landings import Landing, NoLandings
from skyway_drone_agent.landing_book.book import LandingBook, StationReader
from skyway_drone_agent.landing_book.station_cache import CachedStation, StationCacheFile
from skyway_drone_agent.landing_book.tiles import tile_of
from skyway_drone_agent.simulated.disturbances import Disturbances

from skyway.contracts.world import NetworkVersion
from skyway.geo import Position
from skyway.ids import NetworkId, StationId

TEXAS = NetworkId("texas")

#: Near home, and nearer to where a drone on its way to the farm finds its battery short.
BARN = Position(-97.991, 30.002)
FARM = Position(-97.7, 30.0)


def book_with(folder: Path, **stations: tuple[Position, bool]) -> LandingBook:
    """The landing book that an earlier flight here has left on the disk."""
    file = StationCacheFile(folder / "landing-book.json")
    by_tile: dict[Any, tuple[CachedStation, ...]] = {}
    for name, (position, is_closed) in stations.items():
        station = CachedStation(TEXAS, Landing(StationId(name), position), is_closed)
        by_tile[tile_of(position)] = (*by_tile.get(tile_of(position), ()), station)
    file.write((TEXAS, tile, found) for tile, found in by_tile.items())
    return LandingBook(StationReader(()), file)


async def fly_short(world: Any, cloud: Any, steps: Any) -> Any:
    """Towards the farm, with a battery that is empty before it; the event of the flight's end."""
    trip = steps().pick_up("home", p1=1.0).fly("home", "farm", length_m=28_890, duration_s=2000)
    world.clock.rate = 40.0
    world.disturbances = Disturbances.model_validate({"flight_energy_factor": 1.4})
    await world.start()
    await world.send(cloud.mission(trip.deliver("farm", "p1").made))
    await world.pass_until(lambda: any(one.event == "STEP_FAILED" for one in world.events))
    return next(one for one in world.events if one.event == "STEP_FAILED")


@pytest.mark.parametrize(
    ("stations", "landed_at"),
    [
        ({}, "home"),
        ({"farm": (FARM, False), "barn": (BARN, False)}, "barn"),
        ({"farm": (FARM, False), "barn": (BARN, True)}, "home"),
        # No network is known for it, so it counts as another network's.
        ({"barn": (BARN, False)}, "home"),
    ],
    ids=["unknown", "known", "closed", "elsewhere"],
)
async def test_a_short_battery_takes_the_drone_to_a_station_that_no_step_names(
    world: Any, cloud: Any, steps: Any, tmp_path: Path, stations: Any, landed_at: str
) -> None:
    world.book = book_with(tmp_path, **stations)

    failed = await fly_short(world, cloud, steps)

    assert (failed.step_id, failed.code, failed.station_id) == (2, "BATTERY_SHORT", landed_at)


class Listener(NoLandings):
    """A book that only listens."""

    uses_versions = True

    def __init__(self) -> None:
        self.noted: list[int] = []

    def note_version(self, version: NetworkVersion) -> None:
        self.noted.append(version.version)


async def test_the_book_gets_each_version_of_the_network(world: Any) -> None:
    world.book = Listener()
    await world.start()

    for number in (1, 2):
        world.link.deliver_version(
            NetworkVersion(
                message_id=f"msg_{number}",
                sent_at=world.clock.now(),
                network_id=TEXAS,
                version=number,
                sha256=f"hash {number}",
                href="",
            )
        )
    await world.settle()

    assert world.book.noted == [1, 2]


async def test_after_a_failure_the_clouds_new_plan_is_flown(
    world: Any, cloud: Any, steps: Any, tmp_path: Path
) -> None:
    world.book = book_with(tmp_path, farm=(FARM, False), barn=(BARN, False))
    failed = await fly_short(world, cloud, steps)

    again = steps(at=world.clock.now(), first_step=3)
    again.recharge("barn", until_soc=1.0, duration_s=9000)
    await world.send(cloud.mission(again.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert failed.position == BARN
    assert (world.acks[-1].status, world.acks[-1].code) == ("ACCEPTED", None)
    assert (world.states[-1].station_id, world.states[-1].soc) == ("barn", pytest.approx(1.0))


async def test_an_escape_to_such_a_station_goes_on_after_a_crash_without_the_book(
    world: Any, cloud: Any, steps: Any, tmp_path: Path
) -> None:
    world.book = book_with(tmp_path, farm=(FARM, False), barn=(BARN, False))
    trip = steps().pick_up("home", p1=1.0).fly("home", "farm", length_m=28_890, duration_s=2000)
    world.clock.rate = 40.0
    world.disturbances = Disturbances.model_validate({"flight_energy_factor": 1.4})
    await world.start()
    await world.send(cloud.mission(trip.deliver("farm", "p1").made))
    await world.pass_until(lambda: bool(world.states) and world.states[-1].failsafe is not None)

    await world.kill()
    world.book = None
    await world.start()
    await world.pass_until(lambda: any(one.event == "STEP_FAILED" for one in world.events))

    assert world.states[-1].station_id == "barn"

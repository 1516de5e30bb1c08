"""One run of one size: fly a delivery, stop, copy it, start again, load, measure."""

import asyncio
from dataclasses import replace
from typing import Final

from skyway_lab.benchmarks.growth.seed import seed
from skyway_lab.benchmarks.growth.sizes import Size
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.figures import Outcome
from skyway_lab.benchmarks.load.run import data_folder, measured, pids_of
from skyway_lab.benchmarks.load.send import send
from skyway_lab.benchmarks.load.statements import SERVER_OPTIONS
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.load.world import World, populate, start_again

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import running_system
from skyway.errors import SkywayError

#: How fast the first deliveries are flown, and within how many wall seconds.
_FIRST_RATE: Final = 120.0
_FLOWN_WITHIN_S: Final = 120.0

#: The first deliveries: so many a second, for so many seconds.
_FIRST_PER_S: Final = 5.0
_FIRST_S: Final = 2.0

_OVER: Final = ("COMPLETED", "ABORTED", "CANCELLED", "REFUSED")

_PORTS: Final = Ports(gateway=0, broker=0)


async def run(size: Size, load: Burst) -> Outcome:
    """What the load costs in a system of this size."""
    # As many stations are served at each size, else the drones of a larger network fly longer.
    served = load.stations
    profile = None if load.profile is None else load.profile / size.name
    load = replace(load, stations=size.stations, profile=profile)
    options = () if profile is None else SERVER_OPTIONS
    city = City.of(stations=size.stations, seed=load.seed, served=served)
    with (
        data_folder() as folder,
        storage_pair(load.storage, folder, postgresql_options=options) as servers,
    ):
        world, flown = await _fly_some(folder, city, replace(load, clock_rate=_FIRST_RATE))
        await seed(folder, size, fleet=load.drones)
        async with running_system(folder, rate=load.clock_rate, ports=_PORTS, say=print) as system:
            key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
            async with GatewayApi(system.urls["gateway"]) as api:
                # Those that have flown may still recharge.
                ready = load.drones - flown
                await start_again(system, api, world, operator_key=key, ready=ready)
            pids = pids_of(system, world) | {name: one.pid for name, one in servers.items()}
            return await measured(
                system, world, city, burst=load, pids=pids, check=lambda _: "not checked"
            )


async def _fly_some(folder: DataFolder, city: City, first: Burst) -> tuple[World, int]:
    """Fly a few deliveries to their end; who is there, and how many they were."""
    async with running_system(folder, rate=first.clock_rate, ports=_PORTS, say=print) as system:
        key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
        async with GatewayApi(system.urls["gateway"]) as api:
            world = await populate(system, api, city, operator_key=key, burst=first)
            requests = city.requests(rate_per_s=_FIRST_PER_S, seconds=_FIRST_S, seed=first.seed)
            sent = await send(system.urls["gateway"], world, requests)
            try:
                async with asyncio.timeout(_FLOWN_WITHIN_S):
                    await _until_over(api, key)
            except TimeoutError as error:
                raise SkywayError("the first missions did not end") from error
    return world, 2 * len(sent.asked_at)


async def _until_over(api: GatewayApi, key: str) -> None:
    """Wait until missions have begun, and all of them are over."""
    while True:
        missions = (await api.call("GET", "/v1/missions", key=key))["items"]
        if missions and all(each["state"] in _OVER for each in missions):
            return
        await asyncio.sleep(1.0)  # asked of another process: there is nothing to wait on

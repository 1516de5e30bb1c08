"""One run of one size: fly a delivery, stop, copy it, start again, load, measure."""

import asyncio
from dataclasses import replace

from benchmarks.growth.seed import seed
from benchmarks.growth.sizes import Size
from benchmarks.load.burst import Burst
from benchmarks.load.city import City
from benchmarks.load.figures import Outcome
from benchmarks.load.follow import following
from benchmarks.load.run import data_folder, measured, pids_of
from benchmarks.load.send import send
from benchmarks.load.storage_pair import storage_pair
from benchmarks.load.world import populate
from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import running_system
from skyway.contracts.delivery_event import DeliveryEventType
from skyway.errors import SkywayError

#: The system in which the first delivery is flown: small and fast.
_FIRST_DRONES = 10
_FIRST_RATE = 120.0
_FLOWN_WITHIN_S = 120.0


async def run(size: Size, load: Burst) -> Outcome:
    """What the load costs in a system of this size."""
    load = replace(load, stations=size.stations)
    city = City.of(stations=size.stations, seed=load.seed)
    with data_folder() as folder, storage_pair(load.storage, folder) as servers:
        await _fly_one(folder, city, replace(load, drones=_FIRST_DRONES, clock_rate=_FIRST_RATE))
        await seed(folder, size)
        ports = Ports(gateway=0, broker=0)
        async with running_system(folder, rate=load.clock_rate, ports=ports, say=print) as system:
            key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
            async with GatewayApi(system.urls["gateway"]) as api:
                world = await populate(system, api, city, operator_key=key, burst=load)
            pids = pids_of(system, world) | {name: one.pid for name, one in servers.items()}
            return await measured(
                system, world, city, burst=load, pids=pids, check=lambda _: "not checked"
            )


async def _fly_one(folder: DataFolder, city: City, first: Burst) -> None:
    """Fly deliveries until one is completed."""
    ports = Ports(gateway=0, broker=0)
    async with running_system(folder, rate=first.clock_rate, ports=ports, say=print) as system:
        key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
        async with GatewayApi(system.urls["gateway"]) as api:
            world = await populate(system, api, city, operator_key=key, burst=first)
        requests = city.requests(rate_per_s=5.0, seconds=2.0, seed=first.seed)
        async with following(world, mqtt_url=system.mqtt_url) as followed:
            sent = await send(system.urls["gateway"], world, requests)
            try:
                async with asyncio.timeout(_FLOWN_WITHIN_S):
                    while len(followed.ended) < len(sent.asked_at):  # noqa: ASYNC110
                        await asyncio.sleep(0.5)  # there is no one event to wait for
            except TimeoutError as error:
                if not followed.of(DeliveryEventType.COMPLETED):
                    raise SkywayError("no delivery was completed") from error

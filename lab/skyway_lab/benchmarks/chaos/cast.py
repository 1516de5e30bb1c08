"""Everything that takes part in a run: the system, its people, and those who collect evidence."""

import asyncio
import random
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from typing import Final

import aiohttp
from skyway_lab.benchmarks.chaos.customers import Customers
from skyway_lab.benchmarks.chaos.faults.stage import Stage
from skyway_lab.benchmarks.chaos.journals import Journals
from skyway_lab.benchmarks.chaos.people import add_webhooks, read_drones, register_rogue
from skyway_lab.benchmarks.chaos.small_disk import SmallDisk
from skyway_lab.benchmarks.chaos.streams import Streams
from skyway_lab.benchmarks.chaos.system import ChaosSystem
from skyway_lab.benchmarks.chaos.trial import Trial
from skyway_lab.benchmarks.chaos.webhooks import WebhookServer
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.world import populate

from skyway.cli.gateway import GatewayApi, read_keys

_READ_JOURNALS_EVERY_S: Final = 0.2


@dataclass(frozen=True, slots=True)
class Cast:
    """Everything that takes part in a run."""

    trial: Trial
    city: City
    running: ChaosSystem
    stage: Stage
    customers: Customers
    streams: Streams
    webhooks: WebhookServer
    #: Webhooks' ids by customers' keys.
    webhook_ids: Mapping[str, str]
    journals: Journals
    operator_key: str
    client: aiohttp.ClientSession


@asynccontextmanager
async def cast_for(
    trial: Trial, running: ChaosSystem, webhooks: WebhookServer, disk: SmallDisk | None
) -> AsyncIterator[Cast]:
    """Register all people, start the drones, and collect evidence while the block lasts."""
    city = City.of(stations=trial.stations, seed=trial.seed)
    system = running.system
    operator_key = read_keys(system.folder)["SKYWAY_OPERATOR_KEY"]
    async with GatewayApi(system.urls["gateway"]) as api:
        world = await populate(system, api, city, operator_key=operator_key, burst=trial.as_burst())
        url = f"http://127.0.0.1:{running.wires['gateway to webhooks'].port}"
        webhook_ids = await add_webhooks(api, world, webhooks, url=url)
        rogue = await register_rogue(api, city, operator_key=operator_key)
    streams = Streams(running.customers_url)
    chance = random.Random(trial.seed)
    customers = Customers(running.customers_url, world.customers, streams, chance=chance)
    journals = Journals(system.folder.journals)
    drones = read_drones(system.folder, world)
    stage = Stage(running, drones, rogue, journals, disk)
    connector = aiohttp.TCPConnector(limit=0)
    async with aiohttp.ClientSession(connector=connector) as client:
        reading = asyncio.create_task(_read_again_and_again(journals))
        try:
            yield Cast(
                trial=trial,
                city=city,
                running=running,
                stage=stage,
                customers=customers,
                streams=streams,
                webhooks=webhooks,
                webhook_ids=webhook_ids,
                journals=journals,
                operator_key=operator_key,
                client=client,
            )
        finally:
            reading.cancel()
            with suppress(asyncio.CancelledError):
                await reading
            await streams.stop()
            journals.close()


async def _read_again_and_again(journals: Journals) -> None:
    while True:
        journals.read()
        await asyncio.sleep(_READ_JOURNALS_EVERY_S)

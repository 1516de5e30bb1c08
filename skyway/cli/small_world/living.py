"""Registers the shops and the fleets of the small world, and keeps it going.

A file in the data folder keeps who lives there, so a restart goes on.
"""

import asyncio
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random
from typing import Any, Final, Never

from skyway.broker_setup.private_file import write_private
from skyway.cli.demo.fleets import NETWORK_ID, RegisteredFleet, register_fleet
from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world.customers import LEAST_IDLE, REQUEST_EVERY_S, Customers
from skyway.cli.small_world.fleets import MODELS, PROVIDERS
from skyway.cli.small_world.requests import RequestDraw
from skyway.cli.small_world.shops import OWN_SHOP, SHOPS, Shop
from skyway.cli.small_world.story import StoryOfTheDay
from skyway.cli.system.niceness import SIMULATES
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import keep_provider_key, read_secret
from skyway.network.bundled import texas_corridor
from skyway.network.geojson import write_network
from skyway.network.network import Network
from skyway.runtime.clock import load_clock

#: All chance of the small world follows from it.
_SEED: Final = 2026


@dataclass(slots=True)
class Inhabitants:
    """The fleets and the customers' keys that are registered so far, by their names."""

    file: Path
    fleets: dict[str, RegisteredFleet] = field(default_factory=dict)
    customer_keys: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path) -> "Inhabitants":
        """Those in the file; nobody without a file."""
        if not file.exists():
            return cls(file)
        kept: dict[str, Any] = json.loads(file.read_text())
        fleets = {name: RegisteredFleet(**fleet) for name, fleet in kept["fleets"].items()}
        return cls(file, fleets, kept["customer_keys"])

    def keep(self) -> None:
        """Write them into the file; only this user can read it."""
        fleets = {name: asdict(fleet) for name, fleet in self.fleets.items()}
        write_private(
            self.file, json.dumps({"fleets": fleets, "customer_keys": self.customer_keys})
        )

    @property
    def drones(self) -> list[dict[str, Any]]:
        """All drones with their credentials, as JSON."""
        return [drone for fleet in self.fleets.values() for drone in fleet.drones]


async def populate(system: System, api: GatewayApi, network: Network) -> Inhabitants:
    """Publish the network, register who is missing, and start the drones.

    Raises
    ------
    SkywayError
        The gateway refuses a call.
    """
    folder, operator_key = system.folder, read_secret(system.folder, "operator_key")
    known = Inhabitants.read(folder.path / "small-world.json")
    published = await api.call("GET", "/v1/networks?limit=200", key=operator_key)
    if NETWORK_ID not in {each["network_id"] for each in published["items"]}:
        path = f"/v1/networks/{NETWORK_ID}"
        await api.call("PUT", path, key=operator_key, body=write_network(network))
    await _open_shops(system, api, known)
    for model in MODELS:
        body = model.model_dump(mode="json", exclude_none=True)
        await api.call("PUT", f"/v1/drone-models/{model.model_id}", key=operator_key, body=body)
    for provider in PROVIDERS:
        if provider["name"] not in known.fleets:
            known.fleets[provider["name"]] = await register_fleet(
                api,
                operator_key,
                provider,
                model_id=provider["model_id"],
                drones=provider["drones"].items(),
            )
            known.keep()
    keep_provider_key(folder, known.fleets[PROVIDERS[0]["name"]].key)
    fleet_file = folder.path / "small-world-fleet.json"
    write_private(fleet_file, json.dumps({"items": known.drones}))
    system.start_fleet("small-world", fleet_file, gives_way_by=SIMULATES)
    return known


async def _open_shops(system: System, api: GatewayApi, known: Inhabitants) -> None:
    """Make the keys that are missing, and give shops without a name theirs."""
    operator_key = read_secret(system.folder, "operator_key")
    for customer_id in SHOPS:
        if customer_id not in known.customer_keys:
            body = {"role": "customer", "subject_id": customer_id}
            issued = await api.call("POST", "/v1/keys", key=operator_key, body=body)
            known.customer_keys[customer_id] = issued["key"]
            known.keep()
    for key, shop in _shops(system, known).items():
        if (await api.call("GET", "/v1/branding", key=key))["name"] is None:
            await api.call("PUT", "/v1/branding", key=key, body=shop.branding)


def _shops(system: System, known: Inhabitants) -> dict[str, Shop]:
    """The shops by their keys."""
    others = {known.customer_keys[customer_id]: shop for customer_id, shop in SHOPS.items()}
    return {read_secret(system.folder, "customer_key"): OWN_SHOP, **others}


async def live_on(system: System, *, say: Callable[[str], None]) -> Never:
    """Register who is missing, start the drones, and have things happen; this never returns.

    Raises
    ------
    SkywayError
        The gateway refuses a provider, a customer or the network.
    """
    network = texas_corridor()
    async with GatewayApi(system.urls["gateway"]) as api:
        known = await populate(system, api, network)
        say(
            f"The small world: {len(known.fleets)} providers with {len(known.drones)} drones and "
            f"{len(SHOPS) + 1} shops, a request every {REQUEST_EVERY_S:g} s while at least "
            f"{LEAST_IDLE} drones are idle."
        )
        operator_key = read_secret(system.folder, "operator_key")
        customers = Customers(
            api,
            _shops(system, known),
            RequestDraw(network, Random(_SEED)),  # noqa: S311 - nothing is secret
            chance=Random(_SEED),  # noqa: S311
            operator_key=operator_key,
            say=say,
        )
        story = StoryOfTheDay(
            api,
            network,
            operator_key=operator_key,
            provider_ids=[fleet.provider_id for fleet in known.fleets.values()],
            clock=load_clock(system.folder.clock_file),
            chance=Random(_SEED),  # noqa: S311
            held_file=system.folder.path / "small-world-held.txt",
            say=say,
        )
        async with asyncio.TaskGroup() as group:
            group.create_task(customers.run(), name="customers")
            group.create_task(story.run(), name="story of the day")
        raise AssertionError("neither of them returns")

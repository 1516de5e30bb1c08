"""The small world of `skyway up --demo`: registers a few fleets and customers, and keeps it going.

A file in the data folder keeps who lives in the small world, so a restart goes on.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random
from typing import Any, Final, Never

from skyway.broker_setup.private_file import write_private
from skyway.cli.demo.fleets import NETWORK_ID, PROVIDERS, RegisteredFleet, register_fleet
from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world_customers import LEAST_IDLE, REQUEST_EVERY_S, Customers, RequestDraw
from skyway.cli.system.niceness import SIMULATES
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import keep_provider_key, read_secret
from skyway.network.bundled import texas_corridor
from skyway.network.geojson import write_network
from skyway.network.network import Network


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


#: It flies more than 50 km with the packages of the small world.
_MODEL_ID: Final = "dji-matrice-300-rtk"

#: Customers beside the one whose key is in keys.env.
_CUSTOMERS: Final = ("river-books", "city-pharmacy")


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
    for name in _CUSTOMERS:
        if name not in known.customer_keys:
            body = {"role": "customer", "subject_id": name}
            issued = await api.call("POST", "/v1/keys", key=operator_key, body=body)
            known.customer_keys[name] = issued["key"]
            known.keep()
    for provider in PROVIDERS:
        if provider["name"] not in known.fleets:
            known.fleets[provider["name"]] = await register_fleet(
                api, operator_key, provider, model_id=_MODEL_ID
            )
            known.keep()
    keep_provider_key(folder, known.fleets[PROVIDERS[0]["name"]].key)
    fleet_file = folder.path / "small-world-fleet.json"
    write_private(fleet_file, json.dumps({"items": known.drones}))
    system.start_fleet("small-world", fleet_file, gives_way_by=SIMULATES)
    return known


async def live_on(system: System, *, say: Callable[[str], None]) -> Never:
    """Register who is missing, start the drones, and request deliveries; this never returns.

    Raises
    ------
    SkywayError
        The gateway refuses a provider, a customer or the network.
    """
    network = texas_corridor()
    async with GatewayApi(system.urls["gateway"]) as api:
        known = await populate(system, api, network)
        say(
            f"The small world: {len(known.fleets)} providers with {len(known.drones)} drones, a "
            f"request every {REQUEST_EVERY_S:g} s while at least {LEAST_IDLE} drones are idle."
        )
        operator_key = read_secret(system.folder, "operator_key")
        keys = (read_secret(system.folder, "customer_key"), *known.customer_keys.values())
        chance = Random()  # noqa: S311 - nothing is secret
        customers = Customers(
            api, keys, RequestDraw(network, chance), operator_key=operator_key, say=say
        )
        await customers.run()

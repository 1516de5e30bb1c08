"""Registers who lives in the small world, unless an earlier start on this data folder did."""

import json
from typing import Final

from skyway.broker_setup.private_file import write_private
from skyway.cli.demo.fleets import NETWORK_ID, PROVIDERS, register_fleet
from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world.inhabitants import Inhabitants
from skyway.cli.system.niceness import SIMULATES
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import keep_provider_key, read_secret
from skyway.network.geojson import write_network
from skyway.network.network import Network

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

"""Who takes part beside the city's people: the customers' webhooks, and a drone that lies."""

from typing import Any, Final

from pydantic import TypeAdapter
from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone, read_fleet
from skyway_lab.benchmarks.chaos.webhooks import WebhookServer
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.world import World

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi
from skyway.drone.models import DJI_MATRICE_300_RTK

_DRONE: Final = TypeAdapter(EnrolledDrone)
_TERMS: Final[dict[str, Any]] = {  # the body's JSON
    "name": "Rogue Air",
    "tariff": {"currency": "USD", "base": 100, "per_km": 1},
}


async def add_webhooks(
    api: GatewayApi, world: World, server: WebhookServer, *, url: str
) -> dict[str, str]:
    """A webhook for each customer; returns the webhooks' ids by the customers' keys."""
    ids = {}
    for customer in world.customers:
        target = {"url": url + server.path_of(customer.name)}
        issued = await api.call("POST", "/v1/webhooks", key=customer.key, body=target)
        server.add(customer.name, issued["secret"])
        ids[customer.key] = issued["webhook_id"]
    return ids


async def register_rogue(api: GatewayApi, city: City, *, operator_key: str) -> EnrolledDrone:
    """A drone of a provider that is suspended, so that no request is offered to it."""
    provider_id = (await api.call("POST", "/v1/providers", key=operator_key, body=_TERMS))[
        "provider_id"
    ]
    path = f"/v1/providers/{provider_id}"
    home = city.network.columns.station_ids[0]
    drone = {"model_id": DJI_MATRICE_300_RTK.model_id, "home_station_id": home}
    registered = await api.call("POST", f"{path}/drones", key=operator_key, body=drone)
    await api.call("PATCH", path, key=operator_key, body={"state": "SUSPENDED"})
    return _DRONE.validate_python(registered)


def read_drones(folder: DataFolder, world: World) -> tuple[EnrolledDrone, ...]:
    """All drones that fly, with their logins, from the files of their agents."""
    return tuple(
        drone
        for number in range(len(world.agents))
        for drone in read_fleet(folder.path / f"fleet-{number}.json")
    )

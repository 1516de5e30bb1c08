"""The demo's world: the corridor, two large providers and a small one, loaders and requests."""

import asyncio
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Never

from skyway.cli.demo.fleets import COURIER, NETWORK_ID, PROVIDERS, numbered, register_fleet
from skyway.cli.gateway import GatewayApi
from skyway.drone.models import PAPER_SCENARIO
from skyway.errors import SkywayError
from skyway.network.bundled import texas_corridor
from skyway.network.geojson import write_network
from skyway.planner.compose import compose
from skyway.planner.problem import Problem

#: The paper's motivating scenario; the masses are ours, because the paper names none.
PICKUP: Final = "san-marcos"
PACKAGES: Final = (
    ("medicine", 0.5, "mcqueeney"),
    ("camera", 0.8, "bulverde"),
    ("books", 1.2, "san-antonio"),
)

#: The default of a network's settings.
_ENERGY_MARGIN: Final = 0.15

#: Requests of another customer at the same time, so that some pads are busy.
OTHER_REQUESTS: Final = (
    ("san-marcos", (("parts", 0.6, "san-antonio"),)),
    ("mcqueeney", (("flowers", 0.4, "universal-city"), ("keys", 0.1, "san-antonio"))),
    ("schertz", (("lunch", 0.9, "bulverde"),)),
    ("san-antonio", (("samples", 0.7, "seguin"),)),
)

#: Requests for the provider that has one drone: the second begins where the first ends.
CHAINED_REQUESTS: Final = (
    ("new-braunfels", (("contract", 0.4, "san-marcos"),)),
    ("san-marcos", (("signed-contract", 0.4, "new-braunfels"),)),
)


@dataclass(frozen=True, slots=True)
class World:
    """The registered participants of the demo."""

    customer_key: str
    other_customer_key: str
    courier_customer_key: str
    provider_names: dict[str, str]
    fleet_file: Path

    @property
    def courier_id(self) -> str:
        """The provider that has one drone."""
        return next(key for key, name in self.provider_names.items() if name == COURIER)


def rehearse() -> float:
    """How long the delivery takes when no other drone flies, in fleet seconds.

    The plan has a network's default energy margin, as in composition.
    """
    power_w = (1 + _ENERGY_MARGIN) * PAPER_SCENARIO.power_empty_w
    model = PAPER_SCENARIO.model_copy(update={"power_empty_w": power_w})
    problem = Problem.model_validate(
        {
            "network": texas_corridor(),
            "drone": {"model": model, "soc": 1.0},
            "source": PICKUP,
            "packages": [
                {"package_id": name, "mass_kg": mass_kg, "destination": destination}
                for name, mass_kg, destination in PACKAGES
            ],
        }
    )
    delivery_time_s = compose(problem).delivery_time_s
    if delivery_time_s is None:
        raise RuntimeError("the paper's scenario has no plan on the bundled corridor")
    return delivery_time_s


async def register(api: GatewayApi, operator_key: str, *, folder: Path) -> World:
    """As an operator, publish the corridor and register customers, providers and fleets."""

    async def operate(method: str, path: str, body: object) -> Any:
        return await api.call(method, path, key=operator_key, body=body)

    await operate("PUT", f"/v1/networks/{NETWORK_ID}", write_network(texas_corridor()))
    keys = [
        (await operate("POST", "/v1/keys", {"role": "customer", "subject_id": name}))["key"]
        for name in ("river-books", "city-pharmacy", "hill-country-law")
    ]
    names: dict[str, str] = {}
    drones: list[dict[str, Any]] = []
    for provider in PROVIDERS:
        # Its loaders weigh the packages; in the demo they are simulated.
        fleet = await register_fleet(
            api,
            operator_key,
            provider,
            model_id=PAPER_SCENARIO.model_id,
            drones=numbered(provider),
            loading="CONFIRMED",
        )
        names[fleet.provider_id] = provider["name"]
        drones += fleet.drones
    fleet_file = folder / "fleet.json"
    fleet_file.touch(mode=0o600)
    fleet_file.write_text(json.dumps({"items": drones}))
    return World(keys[0], keys[1], keys[2], names, fleet_file)


async def until_all_stand_ready(api: GatewayApi, operator_key: str, world: World) -> None:
    """Wait until all drones are AVAILABLE."""
    for provider_id in world.provider_names:
        path = f"/v1/providers/{provider_id}/drones"
        page = await api.call("GET", path, key=operator_key)
        while any(drone["state"] != "AVAILABLE" for drone in page["items"]):
            await asyncio.sleep(0.1)  # another process decides: no event can be awaited
            page = await api.call("GET", path, key=operator_key)


def delivery_request(
    pickup: str,
    packages: tuple[tuple[str, float, str], ...],
    *,
    objective: str,
    pinned: str | None = None,
) -> dict[str, Any]:
    """The JSON of a delivery request; `pinned` is the only provider that may serve."""
    return {
        "pickup": {"station_id": pickup},
        "packages": [
            {
                "package_id": package_id,
                "mass_kg": mass_kg,
                "destination": {"station_id": destination},
            }
            for package_id, mass_kg, destination in packages
        ],
        "qos": {"objective": objective, "providers": {"pinned": pinned}},
    }


#: Wall seconds between two checks for drones that wait for a loader.
_CHECK_EVERY_S: Final = 0.2


async def load_for_ever(api: GatewayApi, key: str) -> Never:
    """Simulate loaders: confirm the packages of every drone that waits for a loader.

    The measured masses are those that the customer named. This never returns.
    """
    while True:
        page = await api.call("GET", "/v1/missions?loading=AWAITED&state=ACTIVE", key=key)
        for mission in page["items"]:
            await _load(api, key, mission["mission_id"])
        await asyncio.sleep(_CHECK_EVERY_S)


async def _load(api: GatewayApi, key: str, mission_id: str) -> None:
    progress: dict[str, Any] = await api.call("GET", f"/v1/missions/{mission_id}", key=key)
    for progressed in progress["steps"]:
        step = progressed["step"]
        if step["kind"] != "PICK_UP" or progressed["status"] != "PLANNED":
            continue
        state = progress["drone_state"]
        if state is None or state["station_id"] != step["station_id"]:
            continue  # still on its way here
        try:
            body = {"packages": step["packages"]}
            await api.call("POST", f"/v1/missions/{mission_id}/loading", key=key, body=body)
        except SkywayError:
            continue  # not there yet, or confirmed a moment ago: the next check decides

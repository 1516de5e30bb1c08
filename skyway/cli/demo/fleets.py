"""The demo's providers with their fleets on the bundled network, and how a fleet is registered."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from skyway.cli.gateway import GatewayApi
from skyway.runtime.signing.key_pair import FleetKeys

NETWORK_ID: Final = "texas-corridor"

#: The provider that has one drone.
COURIER: Final = "Guadalupe Couriers"

#: The providers: tariff in US cents, and the home stations of their drones.
PROVIDERS: Final[tuple[dict[str, Any], ...]] = (
    {
        "name": "Hill Country Drones",
        "tariff": {"currency": "USD", "base": 900, "per_km": 22, "per_recharge_minute": 2},
        "homes": ("san-marcos", "san-marcos", "kyle", "mcqueeney", "schertz"),
    },
    {
        "name": "Alamo Air Delivery",
        "tariff": {"currency": "USD", "base": 600, "per_km": 30, "per_recharge_minute": 1},
        "homes": ("san-marcos", "san-antonio", "mcqueeney", "seguin", "universal-city"),
    },
    {
        "name": COURIER,
        "tariff": {"currency": "USD", "base": 1500, "per_km": 40, "per_recharge_minute": 2},
        "homes": ("new-braunfels",),
    },
)


@dataclass(frozen=True, slots=True)
class RegisteredFleet:
    """A registered provider, its API key, and its drones with their credentials as JSON."""

    provider_id: str
    key: str
    drones: list[dict[str, Any]]


def numbered(provider: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The drones of one of `PROVIDERS`: the first word of its name with a number, and the home."""
    word = provider["name"].split()[0]
    for number, home in enumerate(provider["homes"], start=1):
        yield f"{word} {number}", home


async def register_fleet(
    api: GatewayApi,
    operator_key: str,
    provider: Mapping[str, Any],
    *,
    model_id: str,
    drones: Iterable[tuple[str, str]],
    loading: str = "AUTOMATIC",
) -> RegisteredFleet:
    """Register a provider and its drones, each a name with its home station.

    `loading` is who says that a drone is loaded.

    Raises
    ------
    SkywayError
        The gateway refuses it.
    """
    terms = {"name": provider["name"], "tariff": provider["tariff"], "loading": loading}
    answer = await api.call("POST", "/v1/providers", key=operator_key, body=terms)
    provider_id = answer["provider_id"]
    own = FleetKeys(
        [{"model_id": model_id, "home_station_id": home, "name": name} for name, home in drones]
    )
    path = f"/v1/providers/{provider_id}/drones"
    registered = await api.call("POST", path, key=operator_key, body=own.bodies)
    return RegisteredFleet(provider_id, answer["key"], own.kept(registered["items"]))

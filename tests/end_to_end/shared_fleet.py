"""Drones of many stories, flown by one agent: an agent costs more than all of its drones."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from skyway.runtime.signing.key_pair import FleetKeys
from tests.end_to_end.ladder_network import QUICK_CHARGE, ladders
from tests.end_to_end.local_system import LocalSystem

_TERMS = {"name": "Test Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}}


@contextmanager
def shared_fleet(
    system: LocalSystem, providers: dict[str, dict[str, Any]], *, near: tuple[str, ...] = ()
) -> Iterator[dict[str, Any]]:
    """A provider with one drone for each network, while the block lasts.

    Each network has the name of its story, and the drone lives at its first station. `providers`
    holds what is special in each provider's terms. The stations of the networks in `near` are
    two kilometres apart, so that a delivery ends soon.
    """
    system.operate("PUT", "/v1/drone-models/quick-charge", QUICK_CHARGE)
    registered = {}
    for name, terms in providers.items():
        step_deg = 0.02 if name in near else 0.12
        system.operate("PUT", f"/v1/networks/{name}", ladders(name, step_deg=step_deg))
        registered[name] = _registered(system, f"{name}-s1", terms)
    file = system.folder.path / f"shared-{min(providers)}.json"
    drones = [drone for each in registered.values() for drone in each["drones"]]
    file.write_text(json.dumps({"items": drones}))
    process = system.run_fleet(file)
    # The stories stop only the fleets that they start.
    system.fleets.remove(process)
    try:
        for each in registered.values():
            system.until_available(each["provider_id"], drones=1)
        yield registered
    finally:
        process.terminate()
        process.wait()


def _registered(system: LocalSystem, home: str, terms: dict[str, Any]) -> dict[str, Any]:
    """A new provider with a drone that lives at this station."""
    provider = system.operate("POST", "/v1/providers", _TERMS | terms)
    keys = FleetKeys([{"model_id": "quick-charge", "home_station_id": home}])
    path = f"/v1/providers/{provider['provider_id']}/drones"
    drones = keys.kept(system.operate("POST", path, keys.bodies)["items"])
    return {**provider, "drones": drones}

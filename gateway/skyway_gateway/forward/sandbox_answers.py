"""What test keys see of networks and fleets: the sandbox alone, as registry and composition would.

Its lists are short, so each is one page.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from typing import Any, Final

from skyway.runtime.errors import AccessDenied, NotFound
from skyway_gateway.sandbox.fleets import PROVIDERS
from skyway_gateway.sandbox.network import NETWORK_ID, STATIONS, sandbox_network

_Json = dict[str, Any]  # of a JSON document

_PUBLISHED_AT: Final = "2026-01-01T00:00:00Z"


def sandbox_answer(call: str, path_params: Mapping[str, str]) -> tuple[str, str]:
    """The body and the media type of the answer to a call, as ``GET /v1/networks``.

    Raises
    ------
    NotFound
        The sandbox has no such network.
    AccessDenied
        The sandbox does not answer this call.
    """
    answer = _ANSWERS.get(call)
    if answer is None:
        calls = ", ".join(_ANSWERS)
        raise AccessDenied(f"the sandbox does not answer this call; of its kind it has {calls}")
    network_id = path_params.get("network_id", NETWORK_ID)
    if network_id != NETWORK_ID:
        raise NotFound("network", network_id)
    kind = "application/geo+json" if answer is _network else "application/json"
    return json.dumps(answer()), kind


def _page(items: list[_Json]) -> _Json:
    return {"items": items, "next_cursor": None}


def _networks() -> _Json:
    content = json.dumps(_network()).encode()
    summary = {"network_id": NETWORK_ID, "version": 1, "published_at": _PUBLISHED_AT}
    return _page([summary | {"sha256": hashlib.sha256(content).hexdigest()}])


def _network() -> _Json:
    # Imported here, as in `sandbox_network`.
    from skyway.network.geojson import write_network

    return write_network(sandbox_network())


def _stations() -> _Json:
    return _page(
        [
            {
                "station_id": each.station_id,
                "name": each.name,
                "pads": each.pads,
                "position": list(each.position),
                "is_closed": False,
            }
            for each in STATIONS.values()
        ]
    )


def _providers() -> _Json:
    return _page(
        [
            {
                "provider_id": each.provider_id,
                "name": each.name,
                "tariff": each.tariff.model_dump(mode="json"),
            }
            for each in PROVIDERS
        ]
    )


_ANSWERS: Final[Mapping[str, Callable[[], _Json]]] = {
    "GET /v1/networks": _networks,
    "GET /v1/networks/{network_id}": _network,
    "GET /v1/networks/{network_id}/stations": _stations,
    "GET /v1/providers": _providers,
}

"""Simulated loaders: a provider's people at the pickup, who weigh packages and confirm them."""

import asyncio
from typing import Any, Final, Never

from skyway.cli.api import GatewayApi
from skyway.errors import SkywayError

#: Wall seconds between two looks for drones that wait; loaders are asked of another process.
_LOOK_EVERY_S: Final = 0.2


async def load_for_ever(api: GatewayApi, key: str) -> Never:
    """Confirm what every waiting drone of this key's provider, or of all, is to take on board.

    What lies on the scale is what the customer said.
    """
    while True:
        page = await api.call("GET", "/v1/missions?loading=AWAITED&state=ACTIVE", key=key)
        for mission in page["items"]:
            await _load(api, key, mission["mission_id"])
        await asyncio.sleep(_LOOK_EVERY_S)


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
            continue  # not there yet after all, or confirmed a moment ago: the next look tells

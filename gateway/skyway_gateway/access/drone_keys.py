"""Whose a drone's key is: the registry made it, and is asked each time, so a revoked one stops."""

from typing import Protocol

from skyway.ids import DroneId
from skyway.runtime.http.identity import Caller
from skyway_gateway.access.key import secret_hash


class DroneKeyRegistry(Protocol):
    """Where keys of drones are kept: the registry."""

    async def drone_of(self, key_hash: str) -> DroneId | None:
        """The drone whose key this is; None when it is nobody's, or not any more."""
        ...


class DroneKeys:
    """Recognises keys of drones."""

    def __init__(self, registry: DroneKeyRegistry) -> None:
        self._registry = registry

    async def caller_of(self, secret: str) -> Caller | None:
        """Whose key this is; None when it is nobody's, or not any more."""
        drone_id = await self._registry.drone_of(secret_hash(secret))
        return None if drone_id is None else Caller("drone", drone_id)

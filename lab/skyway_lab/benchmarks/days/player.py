"""One caller that is operator, provider and customer of a whole Skyway, over its public API."""

import asyncio
import json
import sys
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import System, running_system
from skyway.cli.system.supervisor import Child
from skyway.errors import SkywayError
from skyway.ids import DroneModelId, StationId
from skyway.runtime.signing.key_pair import FleetKeys

_TERMINAL: Final = ("COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED")

#: Wall seconds until all drones must be ready, and until a delivery must be over.
_READY_WITHIN_S, _END_WITHIN_S = 120.0, 1_800.0


@dataclass(frozen=True, slots=True)
class Player:
    """An operator, a provider and a customer in one; `clock_rate` is that of the fleet clock."""

    system: System
    api: GatewayApi
    key: str
    clock_rate: float

    async def call(self, method: str, path: str, body: object = None) -> Any:
        """The answer of the gateway, as JSON."""
        return await self.api.call(method, path, key=self.key, body=body)

    async def now(self) -> datetime:
        """Current fleet time."""
        return datetime.fromisoformat((await self.call("GET", "/v1/clock"))["now"])

    async def until(self, moment: datetime) -> None:
        """Wait until a moment of fleet time."""
        left_s = (moment - await self.now()).total_seconds() / self.clock_rate
        await asyncio.sleep(max(0.0, left_s))

    async def start_fleet(
        self,
        homes: Sequence[StationId],
        model_id: DroneModelId,
        *,
        terms: Mapping[str, Any],
        day: Sequence[str] = (),
    ) -> None:
        """Register a provider with these terms and a drone for each home, and start the drones.

        `day` are options of the drones' simulator.

        Raises
        ------
        SkywayError
            Not all drones were ready in time.
        """
        provider_id = (await self.call("POST", "/v1/providers", terms))["provider_id"]
        own = FleetKeys([{"model_id": model_id, "home_station_id": home} for home in homes])
        registered = await self.call("POST", f"/v1/providers/{provider_id}/drones", own.bodies)
        file = self.system.folder.path / "fleet.json"
        file.touch(mode=0o600)
        file.write_text(json.dumps({"items": own.kept(registered["items"])}))
        self.system.supervisor.start(
            Child(
                name="agents",
                command=(sys.executable, "-m", "skyway_drone_agent", "--fleet", str(file), *day),
                log=self.system.folder.log("agents"),
                environment={
                    "SKYWAY_MQTT_URL": self.system.mqtt_url,
                    "SKYWAY_AGENT_JOURNAL": str(self.system.folder.journals.resolve()),
                },
            )
        )
        try:
            async with asyncio.timeout(_READY_WITHIN_S):
                while not await self._are_ready(len(homes)):  # noqa: ASYNC110
                    await asyncio.sleep(0.5)  # asked of another process
        except TimeoutError as error:
            raise SkywayError(
                f"not all {len(homes)} drones were ready within {_READY_WITHIN_S:g} s"
            ) from error

    async def _are_ready(self, drones: int) -> bool:
        fleets = await self.call("GET", "/v1/stats/fleets")
        return bool(fleets["by_state"].get("AVAILABLE", 0) >= drones)

    async def ended(self, delivery_id: str) -> dict[str, Any]:
        """The delivery when it is over.

        Raises
        ------
        SkywayError
            It was not over in time.
        """
        delivery: dict[str, Any] = {}
        try:
            async with asyncio.timeout(_END_WITHIN_S):
                while delivery.get("state") not in _TERMINAL:
                    await asyncio.sleep(0.2)  # asked of another process
                    delivery = await self.call("GET", f"/v1/deliveries/{delivery_id}")
        except TimeoutError as error:
            raise SkywayError(
                f"{delivery_id} is {delivery.get('state')} after {_END_WITHIN_S:g} s"
            ) from error
        return delivery


@asynccontextmanager
async def playing(folder: DataFolder, *, clock_rate: float) -> AsyncIterator[Player]:
    """Start a whole Skyway in this folder, and end it on leaving."""
    ports = Ports(gateway=0, broker=0)
    async with (
        running_system(folder, rate=clock_rate, ports=ports, say=print) as system,
        GatewayApi(system.urls["gateway"]) as api,
    ):
        yield Player(system, api, read_keys(folder)["SKYWAY_OPERATOR_KEY"], clock_rate)

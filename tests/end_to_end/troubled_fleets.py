"""Drones that will meet trouble, each on its own ladder, and what happened to them."""

import json
import subprocess
from datetime import datetime
from pathlib import Path
from typing import Any

from skyway_drone_agent.journal.logbook import Logbook

from tests.end_to_end.drone_journal import logbook_of
from tests.end_to_end.ladder_network import QUICK_CHARGE

_TERMS = {"name": "Trouble Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}}


class TroubledFleets:
    """One provider whose drones are named after their ladders; an agent hosts one or several."""

    def __init__(self, system: Any, reserves: dict[str, float]) -> None:
        self._system = system
        for reserve_soc in set(reserves.values()):
            model = QUICK_CHARGE | {"model_id": _model_id(reserve_soc), "reserve_soc": reserve_soc}
            system.operate("PUT", f"/v1/drone-models/{_model_id(reserve_soc)}", model)
        registered = system.operate("POST", "/v1/providers", _TERMS)
        self._provider_id = registered["provider_id"]
        drones = [
            {"model_id": _model_id(reserve_soc), "home_station_id": f"{name}-s1"}
            for name, reserve_soc in reserves.items()
        ]
        path = f"/v1/providers/{self._provider_id}/drones"
        made = system.operate("POST", path, drones)["items"]
        self._drones = dict(zip(reserves, made, strict=True))
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def drone_id(self, name: str) -> str:
        """The drone on this ladder."""
        drone_id: str = self._drones[name]["drone_id"]
        return drone_id

    def run(self, *names: str, scenario: str, mqtt_url: str | None = None) -> None:
        """Run an agent with these drones, in this scenario."""
        folder: Path = self._system.folder.path
        day, file = folder / f"{names[0]}.toml", folder / f"{names[0]}.json"
        day.write_text(scenario)
        file.write_text(json.dumps({"items": [self._drones[name] for name in names]}))
        environment = self._system.environment
        if mqtt_url is not None:
            self._system.environment = environment | {"SKYWAY_MQTT_DRONE_URL": mqtt_url}
        process = self._system.run_fleet(file, "--scenario", str(day))
        self._system.environment = environment
        self.processes |= dict.fromkeys(names, process)

    def until_available(self) -> None:
        """Return when all drones are AVAILABLE."""
        self._system.until_available(self._provider_id, drones=len(self._drones))

    def logbook(self, name: str) -> Logbook:
        """The drone's logbook from its journal; the cloud may not know all of it yet."""
        return logbook_of(self._system, self.drone_id(name))

    def take_offs(self, name: str) -> list[datetime]:
        """The take-offs of the drone that the cloud knows of; fleet time."""
        return sorted(
            datetime.fromisoformat(step["event"]["started_at"])
            for mission in self.missions(name)
            for step in mission["steps"]
            if step["event"] is not None and step["event"]["step_kind"] == "FLY"
        )

    def missions(self, name: str) -> list[dict[str, Any]]:
        """The drone's missions, the first one first."""
        path = f"/v1/missions?drone_id={self.drone_id(name)}"
        listed = self._system.operate("GET", path)["items"]
        ids = sorted(mission["mission_id"] for mission in listed)
        return [self._system.operate("GET", f"/v1/missions/{mission_id}") for mission_id in ids]

    def state(self, name: str) -> dict[str, Any]:
        """The last state of the drone in its newest mission."""
        missions = self.missions(name)
        state: dict[str, Any] | None = missions[-1]["drone_state"] if missions else None
        return state or {"activity": None, "station_id": None, "faults": []}

    def failures(self, name: str) -> set[str]:
        """The codes of the failed steps of the drone's missions."""
        return {
            step["event"]["code"]
            for mission in self.missions(name)
            for step in mission["steps"]
            if step["status"] == "FAILED"
        }

    def alarms(self, name: str) -> set[str]:
        """The codes of the alarms about this drone."""
        return {
            alarm["code"]
            for alarm in self._system.operate("GET", "/v1/alarms?limit=200")["items"]
            if alarm["drone_id"] == self.drone_id(name)
        }


def _model_id(reserve_soc: float) -> str:
    return f"keeps-{round(100 * reserve_soc)}"

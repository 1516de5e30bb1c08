"""Alarms about a mission: what its operators and its provider must look at."""

from collections.abc import Mapping
from typing import Any

from skyway.contracts.drone_health import AlarmLevel
from skyway.ids import StationId
from skyway.units import moment_to_ms
from skyway_composition.alarms import store
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.watch import Watch


async def raise_alarm(
    watch: Watch,
    record: MissionRecord,
    *,
    level: AlarmLevel,
    code: str,
    detail: str,
    station_id: StationId | None = None,
    data: Mapping[str, Any] | None = None,  # numbers behind the code
) -> None:
    """Raise an alarm about a mission and its drone, as of now."""
    await store.add(
        watch.tx,
        level=level,
        code=code,
        detail=detail,
        at_ms=moment_to_ms(watch.clock.now()),
        mint=watch.mint,
        provider_id=record.mission.provider_id,
        drone_id=record.drone_id,
        mission_id=record.mission_id,
        station_id=station_id,
        data=data,
    )

"""Closes pads that drones found occupied, for a while, as an operator would."""

from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep, RechargeStep
from skyway.ids import ClosureId
from skyway.units import moment_to_ms
from skyway_composition.closures.close import Closings
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.store import outages
from skyway_composition.missions.mission.record import MissionRecord, OccupiedPad

#: How long no drone is sent to an occupied pad. Our own choice.
_CLOSED_FOR: Final = timedelta(minutes=15)


def occupied_pad(step: FlightStep | None, event: DroneEvent) -> OccupiedPad | None:
    """The pad of a RECHARGE that failed because the pad was occupied."""
    if not isinstance(step, RechargeStep):
        return None
    until_ms = moment_to_ms(event.ended_at + _CLOSED_FOR)
    return OccupiedPad(station_id=step.station_id, pad=step.pad, until_ms=until_ms)


@dataclass(frozen=True, slots=True)
class OccupiedPads:
    """Closes occupied pads; missions that have reserved them get other plans."""

    closings: Closings

    async def close(self, record: MissionRecord) -> None:
        """Close the pad that this mission's drone found occupied, unless it is closed already.

        This needs its own transaction: closures lock a network before any drone.
        """
        occupied = None if record.stuck is None else record.stuck.occupied
        now_ms = self.closings.now_ms
        if occupied is None or occupied.until_ms <= now_ms:
            return
        async with self.closings.db.read() as connection:
            closed = await outages(connection, at_ms=now_ms, station_id=occupied.station_id)
        if any(each.pad == occupied.pad for each in closed):
            return
        await self.closings.make(
            Closure(
                closure_id=ClosureId(""),
                kind="PAD",
                network_id=record.network_id,
                station_id=occupied.station_id,
                pad=occupied.pad,
                reason=f"drone {record.drone_id} found it occupied",
                from_ms=now_ms,
                until_ms=occupied.until_ms,
                made_ms=now_ms,
            )
        )

"""Pads that drones found taken: out of order for a while, as if an operator had said so."""

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

#: How long nobody is sent to a pad on which something stands that should not. Our own choice.
_CLOSED_FOR: Final = timedelta(minutes=15)


def occupied_pad(step: FlightStep | None, event: DroneEvent) -> OccupiedPad | None:
    """The pad of a RECHARGE that failed since something stood on it."""
    if not isinstance(step, RechargeStep):
        return None
    until_ms = moment_to_ms(event.ended_at + _CLOSED_FOR)
    return OccupiedPad(station_id=step.station_id, pad=step.pad, until_ms=until_ms)


@dataclass(frozen=True, slots=True)
class OccupiedPads:
    """Closes such pads, and has the missions that hold them look for other plans."""

    closings: Closings

    async def close(self, record: MissionRecord) -> None:
        """Close the pad that this mission's drone found taken, unless it is closed or it is over.

        In a transaction of its own: closures lock a network before any drone.
        """
        occupied = None if record.stuck is None else record.stuck.occupied
        now_ms = self.closings.now_ms
        if occupied is None or occupied.until_ms <= now_ms:
            return
        async with self.closings.db.read() as connection:
            known = await outages(connection, at_ms=now_ms, station_id=occupied.station_id)
        if any(each.pad == occupied.pad for each in known):
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

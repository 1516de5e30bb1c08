"""The mission that every drone of the benchmark flies: straight out, and home again."""

import math
from datetime import datetime, timedelta
from typing import Final

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone

from skyway.contracts.flight_step import FlyStep
from skyway.contracts.instruction import MissionInstruction
from skyway.drone.flight import flight_time_s
from skyway.geo import EARTH_RADIUS_M, Position, distance_m
from skyway.ids import DeliveryId, InstructionId, MissionId, StationId

#: Metres each way: eight minutes in the air and, out and home, half of the battery.
_OUT_M: Final = 11_000.0


def trip_of(drone: EnrolledDrone, *, bearing_rad: float, now: datetime) -> MissionInstruction:
    """The first instruction that the drone gets, as composition words it."""
    home = drone.home_position
    away, place = StationId(f"away-{drone.drone_id}"), _away(home, bearing_rad)
    length_m = distance_m(home, place)
    lasts = timedelta(seconds=flight_time_s(drone.model, length_m=length_m, load_kg=0.0))
    there = FlyStep(
        step_id=1,
        planned_start_at=now,
        planned_end_at=now + lasts,
        from_id=drone.home_station_id,
        to_id=away,
        from_position=home,
        to_position=place,
        length_m=length_m,
        lands=True,
    )
    back = there.model_copy(
        update={
            "step_id": 2,
            "planned_start_at": there.planned_end_at,
            "planned_end_at": there.planned_end_at + lasts,
            "from_id": away,
            "to_id": drone.home_station_id,
            "from_position": place,
            "to_position": home,
        }
    )
    return MissionInstruction(
        message_id=f"msg_{drone.drone_id}",
        sent_at=now,
        instruction_id=InstructionId(f"ins_{drone.drone_id}"),
        stream=1,
        seq=1,
        expires_at=now + timedelta(hours=1),
        mission_id=MissionId(f"mis_{drone.drone_id}"),
        mission_revision=1,
        delivery_id=DeliveryId(f"del_{drone.drone_id}"),
        first_step=1,
        steps=(there, back),
    )


def _away(home: Position, bearing_rad: float) -> Position:
    """The place this far off; on a flat map, which a few kilometres allow."""
    north_deg = math.degrees(_OUT_M * math.cos(bearing_rad) / EARTH_RADIUS_M)
    east_deg = math.degrees(_OUT_M * math.sin(bearing_rad) / EARTH_RADIUS_M)
    narrowing = math.cos(math.radians(home.latitude_deg))
    return Position(home.longitude_deg + east_deg / narrowing, home.latitude_deg + north_deg)

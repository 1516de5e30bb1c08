"""The messages of a drone in flight, as long as they are in life."""

from datetime import UTC, datetime
from typing import Final

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone

from skyway.contracts.drone_report import DroneHealth, DroneState, Telemetry, Wind
from skyway.ids import MissionId

#: Of every message: nobody here looks at their order.
_SESSION: Final = 1_772_366_400
_SEQ: Final = 1_234


def state_in_flight(drone: EnrolledDrone) -> DroneState:
    """A state."""
    now = datetime.now(UTC)
    return DroneState(
        message_id="msg_01kakz2m9x3v5w7yabcd",
        sent_at=now,
        session=_SESSION,
        seq=_SEQ,
        at=now,
        activity="FLYING",
        stream=1,
        last_instruction_seq=1,
        last_event_seq=1,
        mission_id=MissionId(f"mis_{drone.drone_id}"),
        mission_revision=1,
        step_id=2,
        released_through=3,
        position=drone.home_position,
        soc=0.7123456789,
        load_kg=2.0,
        health=DroneHealth(
            voltage_v=46.12345678,
            current_a=-13.12345678,
            soc_error=0.01234567,
            cell_spread_v=0.01234567,
            temperature_c=28.12345678,
            state_of_health=0.98765432,
            range_m=31_234.5678,
            wind=Wind(east_mps=1.23456789, north_mps=-3.3456789),
            safe_landings=(drone.home_station_id,),
        ),
    )


def sample_in_flight(drone: EnrolledDrone) -> Telemetry:
    """A sample."""
    now = datetime.now(UTC)
    return Telemetry(
        message_id="msg_01kakz2m9x3v5w7yabcd",
        sent_at=now,
        session=_SESSION,
        seq=_SEQ,
        at=now,
        position=drone.home_position,
        soc=0.7123456789,
        power_w=612.3,
        speed_mps=22.87,
        voltage_v=46.123,
        temperature_c=28.1,
        range_m=31_234.0,
    )

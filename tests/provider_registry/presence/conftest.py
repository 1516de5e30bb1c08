"""Messages as drones send them, and a fleet to send them."""

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any, Literal

import pytest

from skyway.contracts.drone_report import Connection, DroneState, Telemetry
from skyway.geo import Position
from skyway.runtime.clock import ManualClock


@pytest.fixture
def online(clock: ManualClock) -> Callable[..., Connection]:
    def make(
        session: int,
        connection_number: int,
        status: Literal["ONLINE", "OFFLINE", "LOST"] = "ONLINE",
    ) -> Connection:
        return Connection(
            message_id="m",
            sent_at=clock.now(),
            session=session,
            connection_number=connection_number,
            status=status,
        )

    return make


@pytest.fixture
def state(clock: ManualClock) -> Callable[..., DroneState]:
    def make(session: int, seq: int, **members: Any) -> DroneState:
        return DroneState.model_validate(
            {
                "message_id": "m",
                "sent_at": clock.now(),
                "session": session,
                "seq": seq,
                "at": clock.now(),
                "activity": "IDLE",
                "stream": 0,
                "last_instruction_seq": 0,
                "last_event_seq": 0,
                "station_id": "san-marcos",
                "position": Position(-97.9, 29.9),
                "soc": 0.9,
                **members,
            }
        )

    return make


@pytest.fixture
def sample(clock: ManualClock) -> Callable[..., Telemetry]:
    def make(session: int, seq: int, *, later_s: float = 0.0, soc: float = 0.5) -> Telemetry:
        at: datetime = clock.now() + timedelta(seconds=later_s)
        return Telemetry(
            message_id="m",
            sent_at=at,
            session=session,
            seq=seq,
            at=at,
            position=Position(-98.0, 29.5),
            soc=soc,
            power_w=600.0,
            speed_mps=23.0,
        )

    return make

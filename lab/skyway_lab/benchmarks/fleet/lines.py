"""What a drone in flight says, written once and sent with the moment of each sending."""

import json
from dataclasses import dataclass
from datetime import UTC, datetime

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.fleet.in_flight import sample_in_flight, state_in_flight

from skyway.contracts.message import Message
from skyway.contracts.topics import STATE, TELEMETRY


@dataclass(frozen=True, slots=True)
class Written:
    """A message that was written once, and is sent with the moment of each sending."""

    before: bytes
    after: bytes

    @classmethod
    def of(cls, message: Message) -> "Written":
        """The message without its moment of sending."""
        text = message.model_dump_json()
        moment = json.loads(text)["sent_at"]
        before, _, after = text.partition(moment)
        return cls(before.encode(), after.encode())

    def now(self) -> bytes:
        """The message, sent now."""
        return self.before + datetime.now(UTC).isoformat().encode() + self.after


@dataclass(frozen=True, slots=True)
class Lines:
    """All that one drone says here."""

    state_topic: str
    telemetry_topic: str
    state: Written
    sample: Written

    @classmethod
    def of(cls, drone: EnrolledDrone) -> "Lines":
        """The lines of one drone."""
        here = (drone.provider_id, drone.drone_id)
        return cls(
            STATE(*here).name,
            TELEMETRY(*here).name,
            Written.of(state_in_flight(drone)),
            Written.of(sample_in_flight(drone)),
        )

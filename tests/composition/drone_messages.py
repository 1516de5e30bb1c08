"""The messages of one drone to composition, numbered as its agent would number them."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Final

from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState
from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
)
from skyway.contracts.topics import ACKS, CONNECTION, EVENTS, STATE, Topic
from skyway.drone.flight import flight_energy_j, soc_after_use
from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId
from skyway.runtime.mqtt.client import Received

_MODEL = DRONE_MODELS[DroneModelId("paper-scenario")]

#: What the hand-over of one package says about the load on board.
EVIDENCE: Final = {"load_before_kg": 0.9, "load_after_kg": 0.5}

#: The mass of a package that no loading of the instruction names.
_PACKAGE_KG: Final = 0.4


@dataclass
class DroneMessages:
    """Makes the messages of one drone, numbered as its agent would number them."""

    composition: Any  # the fixture of that name, whose clock it reads
    drone_id: str = "drn_1"
    provider_id: str = "prv_1"
    session: int = 1
    stream: int = 1
    event_seq: int = 0
    sent: int = 0

    def ack(self, instruction: Any, status: str = "ACCEPTED", **members: Any) -> Received[Any]:
        values = {
            "instruction_id": instruction.instruction_id,
            "instruction_seq": instruction.seq,
            "stream": instruction.stream,
            "status": status,
            **members,
        }
        return self._received(ACKS, Ack.model_validate(self._envelope() | values))

    def event(self, event: str, **members: Any) -> Received[Any]:
        self.event_seq += 1
        values = {
            "seq": self.event_seq,
            "event": event,
            "stream": self.stream,
            "ended_at": self.composition.clock.now(),
            "position": (0.0, 0.0),
            "soc": 0.5,
            **members,
        }
        return self._received(EVENTS, DroneEvent.model_validate(self._envelope() | values))

    def state(self, **members: Any) -> Received[Any]:
        values = {
            "at": self.composition.clock.now(),
            "activity": "IDLE",
            "stream": self.stream,
            "last_instruction_seq": 0,
            "last_event_seq": self.event_seq,
            "station_id": "a",
            "position": (0.0, 0.0),
            "soc": 1.0,
            **members,
        }
        return self._received(STATE, DroneState.model_validate(self._envelope() | values))

    def connection(self, status: str, number: int = 1) -> Received[Any]:
        message = Connection.model_validate(
            {
                "message_id": f"con{number}",
                "sent_at": self.composition.clock.now(),
                "session": self.session,
                "connection_number": number,
                "status": status,
            }
        )
        return self._received(CONNECTION, message)

    def ended(
        self,
        instruction: Any,
        steps: Sequence[FlightStep],
        *,
        soc: float = 1.0,
        late_by: timedelta = timedelta(0),
    ) -> list[Received[Any]]:
        """The end of each of these steps, with the charge as planned from `soc` on."""
        events = []
        for step in steps:
            soc = _soc_after(step, soc)
            ended = self.event(
                "STEP_ENDED",
                mission_id=instruction.mission_id,
                mission_revision=instruction.mission_revision,
                step_id=step.step_id,
                step_kind=step.kind,
                started_at=step.planned_start_at + late_by,
                ended_at=step.planned_end_at + late_by,
                station_id=step.to_id if isinstance(step, FlyStep) else step.station_id,
                energy_j=1000.0 if step.kind == "FLY" else 0.0,
                soc=soc,
                data=evidence_of(step, instruction.steps),
            )
            events.append(ended)
        return events

    def flown(self, instruction: Any) -> list[Received[Any]]:
        """The end of each step as planned, and the end of the mission."""
        events = self.ended(instruction, instruction.steps)
        last = instruction.steps[-1]
        ended = self.event(
            "MISSION_ENDED",
            mission_id=instruction.mission_id,
            ended_at=last.planned_end_at,
            station_id=last.to_id if isinstance(last, FlyStep) else last.station_id,
        )
        return [*events, ended]

    def _envelope(self) -> dict[str, Any]:
        self.sent += 1
        return {
            "message_id": f"m{self.sent}",
            "sent_at": self.composition.clock.now(),
            "session": self.session,
            "seq": self.sent,
        }

    def _received(self, topic: Topic[Any], message: Any) -> Received[Any]:
        ids, payload = (self.provider_id, self.drone_id), message.model_dump_json().encode()
        return Received(topic, ids, message, retained=False, payload=payload)


def evidence_of(step: FlightStep, steps: Sequence[FlightStep]) -> dict[str, float]:
    """What a hand-over says about the load, with the masses that a loading among `steps` names."""
    if not isinstance(step, DeliverStep | ReturnStep):
        return {}
    masses_kg = {
        package.package_id: package.mass_kg
        for each in steps
        if isinstance(each, PickUpStep)
        for package in each.packages
    }
    handed_kg = sum(masses_kg.get(each, _PACKAGE_KG) for each in step.package_ids)
    return {"load_before_kg": 0.5 + handed_kg, "load_after_kg": 0.5}


def _soc_after(step: FlightStep, soc: float) -> float:
    """The charge after a step with 400 g on board, by the drone model without a margin."""
    if isinstance(step, RechargeStep):
        return max(soc, step.until_soc)
    if not isinstance(step, FlyStep):
        return soc
    energy_j = flight_energy_j(_MODEL, length_m=step.length_m, load_kg=0.4)
    return soc_after_use(_MODEL, soc, energy_j=energy_j)

"""Sends acks to the cloud in order, each until the broker confirms it."""

import asyncio
from collections import deque
from itertools import islice
from typing import Literal

from skyway.contracts.drone_report import Ack
from skyway.contracts.topics import ACKS
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.records import AcceptanceSent, Answer
from skyway_drone_agent.link.uplink import Uplink

_Status = Literal["RECEIVED", "ACCEPTED", "REJECTED"]


class AckQueue:
    """Sends answers as acks, and records when the broker confirmed a mission's ACCEPTED."""

    def __init__(self, uplink: Uplink, recorder: FlightRecorder, clock: FleetClock) -> None:
        self._uplink = uplink
        self._recorder = recorder
        self._clock = clock
        self._waiting: deque[tuple[_Status, Answer]] = deque()
        self._has_some = asyncio.Event()
        self._all_sent = asyncio.Event()
        self._all_sent.set()

    def received(self, answer: Answer) -> None:
        """Queue RECEIVED: the instruction is in the journal."""
        self._add("RECEIVED", answer)

    def answered(self, answer: Answer) -> None:
        """Queue the final answer."""
        self._add(answer.status, answer)

    async def run(self) -> None:
        """Send for ever; after a restart first the ack of the current mission."""
        if self._recorder.logbook.mission is not None:
            self.answered(self._recorder.logbook.mission.accepted_by)
        while True:
            await self._has_some.wait()
            together = self._together()
            acks = [self._ack(status, answer) for status, answer in together]
            await self._uplink.send_until_confirmed(ACKS, *acks)
            for status, answer in together:
                self._waiting.popleft()
                if status == "ACCEPTED":
                    self._note_acceptance(answer)
            if not self._waiting:
                self._has_some.clear()
                self._all_sent.set()

    async def wait_all_sent(self) -> None:
        """Return once the broker has confirmed every answer, and the journal says so."""
        await self._all_sent.wait()

    def _together(self) -> list[tuple[_Status, Answer]]:
        """The next answer; a RECEIVED is sent together with the answer after it."""
        is_received = self._waiting[0][0] == "RECEIVED"
        return list(islice(self._waiting, 2 if is_received else 1))

    def _add(self, status: _Status, answer: Answer) -> None:
        self._waiting.append((status, answer))
        self._has_some.set()
        self._all_sent.clear()

    def _note_acceptance(self, answer: Answer) -> None:
        mission = self._recorder.logbook.mission
        is_new = mission is not None and mission.acceptance_sent_at is None
        if mission is not None and is_new and answer == mission.accepted_by:
            self._recorder.note(AcceptanceSent(acceptance_sent_at=self._clock.now()))

    def _ack(self, status: _Status, answer: Answer) -> Ack:
        is_final = status != "RECEIVED"
        return Ack(
            **self._uplink.envelope(ACKS),
            traceparent=answer.traceparent,
            instruction_id=answer.instruction_id,
            instruction_seq=answer.seq,
            stream=answer.stream,
            status=status,
            code=answer.code if is_final else None,
            detail=answer.detail if is_final else None,
            data=answer.data if is_final else {},
        )

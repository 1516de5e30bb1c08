"""Clients with the topics and rights of drones, and a sender of instructions.

A drone answers each instruction and notes what it has done. The sender repeats an instruction until
its drone has answered, as composition does.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Final, Never

from skyway.contracts.drone_report import Ack
from skyway.contracts.instruction import ReportInstruction
from skyway.contracts.topics import ACKS, INSTRUCTIONS
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.client import MqttClient

PROVIDER: Final = "p"
SENDER: Final = "composition"

#: Wall seconds: for all clients to connect, and until an instruction without an answer is repeated.
_BEGINS_WITHIN_S: Final = 300.0
AGAIN_AFTER_S: Final = 2.0


@dataclass(slots=True)
class Drone:
    """A drone that answers each instruction, and notes which it has done."""

    name: str
    client: MqttClient
    done: set[int] = field(default_factory=set)
    received: int = 0
    #: Wall seconds of its longest time without a connection.
    longest_pause_s: float = 0.0

    async def serve(self) -> None:
        """Answer for ever; what is not acknowledged is answered when it comes again."""
        async for batch in self.client.batches(INSTRUCTIONS(PROVIDER, self.name)):
            for each in batch:
                self.received += 1
                self.done.add(each.message.seq)
                with suppress(MqttUnavailable):
                    await self.client.publish(ACKS(PROVIDER, self.name), _ack(each.message.seq))

    async def note_pauses(self) -> Never:
        """Note for ever how long the connection is away."""
        await self.client.wait_connected()
        while True:
            await self.client.wait_lost()
            lost_s = time.monotonic()
            await self.client.wait_connected()
            self.longest_pause_s = max(self.longest_pause_s, time.monotonic() - lost_s)


@dataclass(slots=True)
class Sender:
    """Sends instructions, and each again until its drone has answered."""

    client: MqttClient
    #: By drone and number: when it was first sent, and after how many seconds its answer came.
    sent_at: dict[tuple[str, int], float] = field(default_factory=dict)
    answered_s: dict[tuple[str, int], float] = field(default_factory=dict)
    #: The instructions that were sent before the kill.
    sent_before: set[tuple[str, int]] = field(default_factory=set)
    _answered: dict[tuple[str, int], asyncio.Event] = field(default_factory=dict)

    async def listen(self) -> None:
        """Note answers for ever."""
        async for batch in self.client.batches(ACKS):
            for each in batch:
                place = each.ids[1], each.message.instruction_seq
                self.answered_s.setdefault(place, time.monotonic() - self.sent_at[place])
                self._answered[place].set()

    async def send(self, drone: str, seq: int) -> None:
        """Return once the drone has answered."""
        self.sent_at[drone, seq] = time.monotonic()
        answered = self._answered[drone, seq] = asyncio.Event()
        while not answered.is_set():
            with suppress(MqttUnavailable):
                await self.client.publish(
                    INSTRUCTIONS(PROVIDER, drone), _instruction(seq), timeout_s=AGAIN_AFTER_S
                )
            with suppress(TimeoutError):
                await asyncio.wait_for(answered.wait(), AGAIN_AFTER_S)


@asynccontextmanager
async def connected(url: str, names: Sequence[str]) -> AsyncIterator[tuple[Sender, list[Drone]]]:
    """The sender and the drones, while all of them are served; a password is a user's name."""
    async with AsyncExitStack() as stack:

        async def enter(name: str) -> MqttClient:
            client = MqttClient(url, client_id=name, user_name=name, password=name)
            return await stack.enter_async_context(client)

        sender = Sender(await enter(SENDER))
        drones = [Drone(name.partition("/")[2], await enter(name)) for name in names]
        async with asyncio.TaskGroup() as tasks:
            serving = [tasks.create_task(each.serve()) for each in drones]
            serving.append(tasks.create_task(sender.listen()))
            async with asyncio.timeout(_BEGINS_WITHIN_S):
                for client in (sender.client, *(each.client for each in drones)):
                    await client.wait_connected()
            serving += [tasks.create_task(each.note_pauses()) for each in drones]
            yield sender, drones
            for task in serving:
                task.cancel()


def _instruction(seq: int) -> ReportInstruction:
    now = datetime.now(UTC)
    return ReportInstruction(
        message_id=f"m{seq}",
        sent_at=now,
        instruction_id=f"i{seq}",
        stream=1,
        seq=seq,
        expires_at=now + timedelta(minutes=5),
        events_after_seq=0,
    )


def _ack(seq: int) -> Ack:
    return Ack(
        message_id=f"a{seq}",
        sent_at=datetime.now(UTC),
        session=1,
        seq=seq,
        instruction_id=f"i{seq}",
        instruction_seq=seq,
        stream=1,
        status="RECEIVED",
    )

"""Sets messages aside: they are judged and counted now, and kept by a loop of their own.

So no message waits until another one is kept, and a sender that floods the quarantine slows nobody.

A forged message does not count against the drone that it names: somebody else has sent it. A few of
them are kept, further ones are only counted, and operators get an alarm.

Each set-aside message adds to the level of its sender, and the level falls with time. Above the
first limit the sender is slowed: its set-aside messages are counted and not kept. Above the second
limit it is put out: none of its messages is read for `PUT_OUT_FOR`. After that its level is zero.
This is kept in memory: a restart of the process pardons everybody.
"""

import logging
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final, Literal

from pydantic import ValidationError

from skyway.complaints import fault_of
from skyway.contracts.topics import Topic
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.inbox import Arrival
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition import alarm_store
from skyway_composition.links.listening import Listening
from skyway_composition.links.store import renewals_of
from skyway_composition.quarantine import store
from skyway_composition.quarantine.quarantined import QuarantineReason, SetAsideMessage

#: Provider and drone, as a topic names them.
Sender = tuple[str, str]

Standing = Literal["NORMAL", "SLOWED", "PUT_OUT"]

#: The levels above which a sender is slowed and put out. Our own choice: a drone with one faulty
#: message in each of its states stays below the first.
SLOWED_ABOVE: Final = 10.0
PUT_OUT_ABOVE: Final = 100.0
#: By how much a level falls in one second of wall time.
_FALL_PER_S: Final = 1 / 30
#: Wall time for which no message of a sender is read.
PUT_OUT_FOR: Final = timedelta(minutes=10)
#: The most senders that are remembered; the longest-known ones are forgotten first.
_MOST_SENDERS: Final = 20_000


@dataclass(frozen=True, slots=True)
class _Record:
    level: float
    at: datetime

    def level_at(self, now: datetime) -> float:
        return max(0.0, self.level - _FALL_PER_S * (now - self.at).total_seconds())


class Offenders:
    """The levels of all senders of which a message was set aside; moments are wall time."""

    def __init__(self) -> None:
        self._records: dict[Sender, _Record] = {}
        self._put_out: dict[Sender, datetime] = {}

    def note(self, sender: Sender, weight: float, *, now: datetime) -> Standing:
        """Add a set-aside message; the result is the standing of the sender from now on."""
        known = self._records.pop(sender, None)
        level = weight + (0.0 if known is None else known.level_at(now))
        if level > PUT_OUT_ABOVE:
            self._put_out[sender] = now
            return "PUT_OUT"
        self._records[sender] = _Record(level, now)
        while len(self._records) > _MOST_SENDERS:
            del self._records[next(iter(self._records))]
        return "SLOWED" if level > SLOWED_ABOVE else "NORMAL"

    def is_put_out(self, sender: Sender, *, now: datetime) -> bool:
        """Whether no message of this sender is read now."""
        since = self._put_out.get(sender)
        if since is None:
            return False
        if now - since < PUT_OUT_FOR:
            return True
        del self._put_out[sender]
        return False

    def put_out(self, *, now: datetime) -> list[Sender]:
        """The senders of which no message is read now."""
        return [each for each in [*self._put_out] if self.is_put_out(each, now=now)]

    def pardon(self, sender: Sender) -> None:
        """Read the messages of a sender again, as if nothing of it had been set aside."""
        self._put_out.pop(sender, None)
        self._records.pop(sender, None)


log = logging.getLogger(__name__)

#: How much a message adds to its sender's level. A drone whose clock is ahead does no harm; a
#: message that fails in our own code delays others while it is tried again.
_WEIGHTS: Final[dict[QuarantineReason, float]] = {
    "UNREADABLE": 1.0,
    "AHEAD": 0.1,
    "BEHIND": 0.1,
    "FOREIGN_PROVIDER": 1.0,
    "IMPLAUSIBLE": 5.0,
    "FAILED": 10.0,
}
#: How much a message adds that is taken, though a drone seldom has a reason for it.
_SUSPICION: Final = 5.0

#: Wall time for which the failure of a provider's message counts.
_FAILURES_COUNT_FOR: Final = timedelta(minutes=5)

#: The most messages of one provider that wait to be kept.
_MOST_WAITING: Final = 50
#: Wall time for which a message is kept after it came last, and between two looks for older ones.
_KEPT_FOR: Final = timedelta(days=7)
_SWEEP_EVERY: Final = timedelta(minutes=10)
#: The most reasons that pydantic's errors are described with.
_MOST_ERRORS: Final = 3

_PUT_OUT: Final = "SENDER_PUT_OUT"

#: How much a forged message adds to the level of forgeries in a drone's name. Above the first limit
#: no more are kept, and there is an alarm: a single one may be of a key that was just replaced.
_FORGED_WEIGHT: Final = 5.0
_FORGED: Final = "FORGED_MESSAGES"


class Quarantine:
    """Takes the messages of drones that are not handled; `Reception` of their signatures' check."""

    def __init__(
        self,
        db: Database,
        *,
        clock: FleetClock,
        mint: Mint,
        listening: Listening,
        is_foreign: Callable[[str], bool] = lambda _drone_id: False,
    ) -> None:
        self._db = db
        self._clock = clock
        self._mint = mint
        self._listening = listening
        self._is_foreign = is_foreign
        self._offenders = Offenders()
        self._forgeries = Offenders()
        self._waiting: dict[ProviderId, list[SetAsideMessage]] = defaultdict(list)
        self._newly_put_out: list[Sender] = []
        self._newly_forged: dict[Sender, None] = {}
        self._put_out_ms: dict[Sender, int] = {}
        self._failed_at: dict[str, datetime] = {}
        self._swept_at = clock.wall_now()
        self.wake = Wake()

    def is_ours(self, ids: tuple[str, ...]) -> bool:
        """Whether this replica owns the drone; others handle the messages of other drones.

        Those are other replicas, and the compositions of other networks (`is_foreign`).
        """
        return not self._is_foreign(ids[1]) and self._listening.owns(DroneId(ids[1]))

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        """Whether the messages of this sender are not read at present."""
        if not self._offenders.is_put_out((ids[0], ids[1]), now=self._clock.wall_now()):
            return False
        count("skyway_unread_messages", "messages of drones that are put out")
        self._listening.miss(DroneId(ids[1]))
        return True

    def unreadable(
        self, topic: Topic[Any], ids: tuple[str, ...], payload: bytes, error: ValidationError
    ) -> None:
        """Set aside a message that does not have the form of its topic."""
        found = error.errors(include_url=False, include_input=False)[:_MOST_ERRORS]
        detail = "; ".join(": ".join(fault_of(each)) for each in found)
        self._add(SetAsideMessage.of(topic(*ids).name, ids, payload, "UNREADABLE", detail))

    def add(self, received: Received[Any], reason: QuarantineReason, detail: str) -> None:
        """Set aside a message that was read. Any: each topic has messages of its own type."""
        if reason == "FAILED":
            self._failed_at[received.ids[0]] = self._clock.wall_now()
        name = received.topic(*received.ids).name
        self._add(SetAsideMessage.of(name, received.ids, received.payload, reason, detail))

    def forged(self, arrival: Arrival) -> None:
        """Set aside a message that its drone has not signed, without counting it as the drone's."""
        sender, now = (arrival.ids[0], arrival.ids[1]), self._clock.wall_now()
        is_flood = self._forgeries.is_put_out(sender, now=now)
        standing = self._forgeries.note(sender, _FORGED_WEIGHT, now=now)
        if standing != "NORMAL":
            self._newly_forged[sender] = None
            self.wake.set()
        detail = "it has no valid signature of its drone"
        message = SetAsideMessage.of(arrival.name, arrival.ids, arrival.payload, "FORGED", detail)
        self._keep_if(message, standing == "NORMAL" and not is_flood)

    def postponed(self, ids: tuple[str, ...]) -> None:
        """Note that a message of this drone waits for its key: it may be an answer."""
        self._listening.miss(DroneId(ids[1]))

    def _add(self, message: SetAsideMessage) -> None:
        standing = self._note((message.provider_id, message.drone_id), _WEIGHTS[message.reason])
        self._keep_if(message, standing == "NORMAL")

    def _keep_if(self, message: SetAsideMessage, has_room: bool) -> None:
        # The message may have been an answer: the drone's silence proves nothing from here on.
        self._listening.miss(message.drone_id)
        count("skyway_set_aside_messages", "drone messages not taken", reason=message.reason)
        waiting = self._waiting[message.provider_id]
        if has_room and len(waiting) < _MOST_WAITING:
            waiting.append(message)
            self.wake.set()
        else:
            _count_left_out(1)

    def has_failed(self, ids: tuple[str, ...]) -> bool:
        """Whether handling a message of this provider's drones has failed in the last minutes."""
        failed_at = self._failed_at.get(ids[0])
        return failed_at is not None and self._clock.wall_now() - failed_at < _FAILURES_COUNT_FOR

    def suspect(self, ids: tuple[str, ...]) -> None:
        """Note a message that was taken, but that no drone sends often."""
        self._note((ids[0], ids[1]), _SUSPICION)

    def _note(self, sender: Sender, weight: float) -> Standing:
        standing = self._offenders.note(sender, weight, now=self._clock.wall_now())
        if standing == "PUT_OUT":
            log.warning("sender put out", extra={"drone_id": sender[1]})
            count("skyway_senders_put_out", "drones of which no message is read for a while")
            self._put_out_ms[sender] = moment_to_ms(self._clock.now())
            self._newly_put_out.append(sender)
            self.wake.set()
        return standing

    async def step(self) -> bool:
        """Step of a loop: keep what waits, and raise alarms. A failed step is done again."""
        await self._keep()
        await self._pardon_renewed()
        await self._raise_alarms()
        await self._sweep()
        return False

    async def _keep(self) -> None:
        messages = [each for waiting in self._waiting.values() for each in waiting]
        if not messages:
            return
        arrival = store.Arrival(
            at_ms=moment_to_ms(self._clock.now()), wall_ms=moment_to_ms(self._clock.wall_now())
        )
        async with self._db.write() as tx:
            left_out = await store.add_all(tx, messages, arrival=arrival, mint=self._mint)
        _count_left_out(left_out)
        kept = set(messages)
        for provider_id, waiting in [*self._waiting.items()]:
            # Others may have come while these were written.
            waiting[:] = [each for each in waiting if each not in kept]
            if not waiting:
                del self._waiting[provider_id]

    async def _pardon_renewed(self) -> None:
        """Read the messages of drones again whose credentials were renewed since."""
        put_out = self._offenders.put_out(now=self._clock.wall_now())
        self._put_out_ms = {each: at for each, at in self._put_out_ms.items() if each in put_out}
        if not put_out:
            return
        async with self._db.read() as connection:
            renewed = await renewals_of(connection, [DroneId(each[1]) for each in put_out])
        for sender, put_out_ms in self._put_out_ms.items():
            if renewed.get(DroneId(sender[1]), 0) > put_out_ms:
                self._offenders.pardon(sender)

    async def _raise_alarms(self) -> None:
        while self._newly_put_out:
            until_at = self._clock.wall_now() + PUT_OUT_FOR
            await self._raise_alarm(
                self._newly_put_out[0],
                code=_PUT_OUT,
                detail="too many messages of the drone could not be taken: none of its messages is "
                f"read until {until_at:%Y-%m-%d %H:%M:%S} UTC, wall time",
            )
            del self._newly_put_out[0]
        while self._newly_forged:
            sender = next(iter(self._newly_forged))
            await self._raise_alarm(
                sender,
                code=_FORGED,
                detail="messages came in the drone's name that it has not signed: look at the "
                "broker, and at the drone's key. They are not believed; its own messages are",
            )
            del self._newly_forged[sender]

    async def _raise_alarm(self, sender: Sender, *, code: str, detail: str) -> None:
        """Raise an alarm about a drone, unless there is an open one of this kind."""
        provider_id, drone_id = sender
        async with self._db.write() as tx:
            if await alarm_store.is_open(tx.connection, DroneId(drone_id), code=code):
                return
            await alarm_store.add(
                tx,
                level="URGENT",
                code=code,
                detail=detail,
                at_ms=moment_to_ms(self._clock.now()),
                mint=self._mint,
                provider_id=ProviderId(provider_id),
                drone_id=DroneId(drone_id),
            )

    async def _sweep(self) -> None:
        now = self._clock.wall_now()
        if now - self._swept_at < _SWEEP_EVERY:
            return
        async with self._db.write() as tx:
            await store.remove_old(tx, before_wall_ms=moment_to_ms(now - _KEPT_FOR))
        self._swept_at = now


def _count_left_out(messages: int) -> None:
    if messages:
        count("skyway_set_aside_not_kept", "set-aside messages that were only counted", messages)

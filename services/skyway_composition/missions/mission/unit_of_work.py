"""The watch over some drones in one transaction: their links and live missions, locked together."""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Self

from skyway.ids import DroneId, InstructionId, MissionId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.minting import Mint
from skyway.runtime.outbox.confirming import confirm
from skyway.runtime.sql.database import Tx
from skyway_composition.links.courier import Courier
from skyway_composition.links.link import DroneLink
from skyway_composition.links.store import lock_links, save_links
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.record import MissionRecord


@dataclass(slots=True)
class MissionUnitOfWork:
    """What is known of each drone; links are locked before missions, by everybody."""

    tx: Tx
    clock: FleetClock
    mint: Mint
    links: dict[DroneId, DroneLink]
    missions: dict[DroneId, MissionRecord]
    _staged_links: set[DroneId] = field(default_factory=set)
    _staged_missions: set[DroneId] = field(default_factory=set)
    _answered: list[InstructionId] = field(default_factory=list)

    @classmethod
    async def lock(
        cls, drone_ids: Collection[DroneId], *, tx: Tx, clock: FleetClock, mint: Mint
    ) -> Self:
        """The watch over these drones; those that we never heard of have no link."""
        links = await lock_links(tx, drone_ids)
        return cls(tx, clock, mint, links, await store.lock_live(tx, drone_ids))

    @property
    def courier(self) -> Courier:
        """Sends instructions to these drones."""
        return Courier(self.clock, self.mint)

    def stage_link(self, link: DroneLink) -> None:
        """Know what changed of a link; `keep_noted` keeps it."""
        if link != self.links[link.drone_id]:
            self.links[link.drone_id] = link
            self._staged_links.add(link.drone_id)

    def stage(self, record: MissionRecord) -> None:
        """Know what changed of a mission that goes on; `keep_noted` keeps it."""
        self.missions[record.drone_id] = record
        self._staged_missions.add(record.drone_id)

    def stage_answer(self, instruction_id: InstructionId) -> None:
        """Know that an instruction was answered; `keep_noted` ends its repeating."""
        self._answered.append(instruction_id)

    async def save_staged(self) -> None:
        """Keep all that was noted: once a transaction, however much the drones say."""
        await save_links(self.tx, [self.links[each] for each in sorted(self._staged_links)])
        noted = [self.missions[each] for each in sorted(self._staged_missions)]
        await store.save_all(self.tx, noted)
        await confirm(self.tx, self._answered)
        self._staged_links.clear()
        self._staged_missions.clear()
        self._answered.clear()

    async def save(self, record: MissionRecord) -> None:
        """Keep what changed of a mission; one that has ended is no longer watched."""
        self._staged_missions.discard(record.drone_id)
        if record.is_live:
            self.missions[record.drone_id] = record
        else:
            self.missions.pop(record.drone_id, None)
        await store.save_all(self.tx, [record])


async def lock_mission(
    tx: Tx,
    mission_id: MissionId,
    *,
    provider_id: ProviderId | None,
    clock: FleetClock,
    mint: Mint,
) -> tuple[MissionUnitOfWork, MissionRecord]:
    """The live mission, if it is this provider's (None: whoever's), and the watch over its drone.

    Raises
    ------
    NotFound
        There is no such mission of this provider.
    Conflict
        MISSION_OVER: it has ended.
    """
    # Read first without a lock, to learn the drone: links are locked before missions.
    found = await store.get(tx.connection, mission_id, provider_id=provider_id)
    if found is None:
        raise NotFound("mission", mission_id)
    work = await MissionUnitOfWork.lock([found.drone_id], tx=tx, clock=clock, mint=mint)
    record = work.missions.get(found.drone_id)
    if record is None or record.mission_id != mission_id:
        raise Conflict("MISSION_OVER", f"{mission_id} is over")
    return work, record

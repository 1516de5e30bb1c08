"""The world in which plans are made: a network version, its reservations and its closures."""

from dataclasses import dataclass
from typing import Self

from skyway.ids import MissionId, StationId
from skyway.runtime.sql.database import Database, Tx
from skyway_composition.closures.conditions import Conditions
from skyway_composition.networks.prepared import PreparedNetwork, PreparedNetworks
from skyway_composition.networks.store import Present, share_current
from skyway_composition.pads.pad_snapshot import PadSnapshot


@dataclass(frozen=True, slots=True)
class World:
    """The world of a plan; a transaction that stores the plan must check `still_holds`.

    The database itself checks reservations.
    """

    skyway: PreparedNetwork
    pads: PadSnapshot
    conditions: Conditions
    conditions_version: int

    @property
    def present(self) -> Present:
        """Version and conditions of the network, which must be unchanged when a plan is stored."""
        skyway = self.skyway
        return Present(skyway.network_id, skyway.version, self.conditions_version)

    @classmethod
    async def around(
        cls, station_id: StationId, networks: PreparedNetworks, *, db: Database, after_ms: int
    ) -> Self | None:
        """The world of the network that has this station; None when no network has it."""
        present = await networks.present_around(station_id)
        return (
            None if present is None else await cls.at(present, networks, db=db, after_ms=after_ms)
        )

    @classmethod
    async def at(
        cls, present: Present, networks: PreparedNetworks, *, db: Database, after_ms: int
    ) -> Self:
        """The world of a network at a version and conditions number that were just read."""
        skyway = await networks.version(present.network_id, present.version)
        number = present.conditions
        conditions = await skyway.conditions.numbered(number, db, after_ms=after_ms)
        pads = _pads(skyway, db, conditions, after_ms=after_ms)
        return cls(skyway, pads, conditions, number)

    @classmethod
    async def of(
        cls,
        skyway: PreparedNetwork,
        db: Database,
        *,
        after_ms: int,
        without_mission_id: MissionId | None = None,
        pad_gap_s: float | None = None,
    ) -> Self:
        """The network with the closures and reservations that end after a moment.

        The reservations of `without_mission_id` are left out. All others begin `pad_gap_s` early;
        None means the network's own gap.
        """
        number, conditions = await skyway.conditions.read(db, after_ms=after_ms)
        pads = _pads(
            skyway,
            db,
            conditions,
            after_ms=after_ms,
            without_mission_id=without_mission_id,
            pad_gap_s=pad_gap_s,
        )
        return cls(skyway, pads, conditions, number)


def _pads(
    skyway: PreparedNetwork,
    db: Database,
    conditions: Conditions,
    *,
    after_ms: int,
    without_mission_id: MissionId | None = None,
    pad_gap_s: float | None = None,
) -> PadSnapshot:
    gap_s = skyway.settings.pad_gap_s if pad_gap_s is None else pad_gap_s
    return PadSnapshot(
        db,
        skyway.network_id,
        skyway.network,
        after_ms=after_ms,
        without_mission_id=without_mission_id,
        outages=conditions.pad_outages(after_ms),
        gap_ms=round(gap_s * 1000),
    )


async def still_holds(tx: Tx, world: World) -> bool:
    """Whether the network is as planned: nothing was published, closed or lifted since (I11).

    Nothing can change before `tx` ends. Reservations are not checked. A transaction with more
    locks calls this after it locks the delivery and before it locks drones.
    """
    now = await share_current(tx, world.skyway.network_id)
    return now == (world.skyway.version, world.conditions_version)

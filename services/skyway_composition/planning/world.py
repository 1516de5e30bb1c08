"""The world in which plans are made: a network version, who holds its pads, what is closed."""

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
    """What plans are made in; whoever keeps one asks `still_holds` in that transaction.

    The reservations are checked by the database itself.
    """

    skyway: PreparedNetwork
    pads: PadSnapshot
    conditions: Conditions
    conditions_version: int

    @property
    def present(self) -> Present:
        """How the network was found: what has to be so still when a plan is kept."""
        skyway = self.skyway
        return Present(skyway.network_id, skyway.version, self.conditions_version)

    @classmethod
    async def around(
        cls, station_id: StationId, networks: PreparedNetworks, *, db: Database, after_ms: int
    ) -> Self | None:
        """The world of whoever begins at a station; None when no network has it."""
        present = await networks.present_around(station_id)
        return (
            None if present is None else await cls.at(present, networks, db=db, after_ms=after_ms)
        )

    @classmethod
    async def at(
        cls, present: Present, networks: PreparedNetworks, *, db: Database, after_ms: int
    ) -> Self:
        """The world of a network as it was just found to be."""
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
        """The network with what is closed and reserved beyond a moment, but for one mission's.

        Others' reservations begin `pad_gap_s` early (None: as long as the network wants).
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
    """Whether nothing was published, closed or lifted since, nor will be before `tx` ends (I11).

    Reservations are not looked at. Whoever locks more asks this after the delivery, before drones.
    """
    now = await share_current(tx, world.skyway.network_id)
    return now == (world.skyway.version, world.conditions_version)

"""The world in which plans are made: a network version, who holds its pads, what is closed."""

from dataclasses import dataclass

from skyway.ids import MissionId
from skyway.runtime.database import Database, Tx
from skyway_composition.closures.conditions import Conditions
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.networks.store import share_world
from skyway_composition.pads.known_pads import KnownPads


@dataclass(frozen=True, slots=True)
class World:
    """What plans are made in; whoever keeps one asks `still_holds` in that transaction.

    The reservations are checked by the database itself.
    """

    skyway: PreparedNetwork
    pads: KnownPads
    conditions: Conditions
    conditions_version: int

    @classmethod
    async def of(
        cls,
        skyway: PreparedNetwork,
        db: Database,
        *,
        after_ms: int,
        without_mission_id: MissionId | None = None,
        pad_gap_s: float | None = None,
    ) -> "World":
        """The network with what is closed and reserved beyond a moment, but for one mission's.

        Others' reservations begin `pad_gap_s` early (None: as long as the network wants).
        """
        gap_s = skyway.settings.pad_gap_s if pad_gap_s is None else pad_gap_s
        version, conditions = await skyway.conditions.read(db, after_ms=after_ms)
        pads = KnownPads(
            db,
            skyway.network_id,
            skyway.network,
            after_ms=after_ms,
            without_mission_id=without_mission_id,
            outages=conditions.pad_outages(after_ms),
            gap_ms=round(gap_s * 1000),
        )
        return cls(skyway, pads, conditions, version)


async def still_holds(tx: Tx, world: World) -> bool:
    """Whether nothing was published, closed or lifted since, nor will be before `tx` ends (I11).

    Reservations are not looked at. Whoever locks more asks this after the delivery, before drones.
    """
    now = await share_world(tx, world.skyway.network_id)
    return now == (world.skyway.version, world.conditions_version)

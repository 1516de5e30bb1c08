"""The world in which plans are made: one network version, and who holds its pads."""

from dataclasses import dataclass

from skyway.ids import MissionId
from skyway.runtime.database import Database
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.pads.known_pads import KnownPads


@dataclass(frozen=True, slots=True)
class World:
    """What plans are made in; a booking checks again that both parts still hold."""

    skyway: PreparedNetwork
    pads: KnownPads

    @classmethod
    def of(
        cls,
        skyway: PreparedNetwork,
        db: Database,
        *,
        after_ms: int,
        without_mission_id: MissionId | None = None,
    ) -> "World":
        """The network with the reservations that last beyond a moment, but for one mission's."""
        return cls(
            skyway,
            KnownPads(
                db,
                skyway.network_id,
                skyway.network,
                after_ms=after_ms,
                without_mission_id=without_mission_id,
            ),
        )

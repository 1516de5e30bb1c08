"""Which networks this composition serves, as the setting `SKYWAY_CELLS` names them.

It refuses requests for the networks of other compositions, and drops the messages of their drones.
A network that was moved to another composition stays in the database with its past.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Self

from skyway.ids import DroneId, NetworkId
from skyway.runtime.errors import InvalidSettings, Misdirected
from skyway.runtime.sql.database import Database
from skyway_composition.cell_store import open_missions
from skyway_composition.settings import CompositionSettings

#: The most drones whose networks are cached, about 200 bytes each.
_MOST_HOMES: Final = 200_000


@dataclass(slots=True)
class OwnCells:
    """The networks of this composition; `url` is its own address, `default` that without cells.

    `foreign` are the networks in its database that another composition serves.
    """

    cells: Mapping[NetworkId, str]
    default: str
    url: str
    foreign: frozenset[NetworkId] = frozenset()
    _homes: dict[str, NetworkId] = field(default_factory=dict)

    @classmethod
    def of(cls, settings: CompositionSettings) -> Self:
        """The networks that these settings give to this composition."""
        default = settings.composition_url.rstrip("/")
        return cls(settings.cells, default, settings.cell_url or default)

    def url_of(self, network_id: NetworkId) -> str:
        """The address of the composition that serves the network."""
        return self.cells.get(network_id, self.default)

    def serves(self, network_id: NetworkId) -> bool:
        """Whether this composition serves the network."""
        return self.url_of(network_id) == self.url

    async def read_database(self, db: Database) -> None:
        """Read which networks in this database another composition serves.

        Raises
        ------
        InvalidSettings
            Such a network has missions that are not over, and nobody would answer their drones.
        """
        async with db.read() as connection:
            found = await open_missions(connection)
        self.foreign = frozenset(each for each in found if not self.serves(each))
        for network_id in sorted(self.foreign):
            if found[network_id]:
                raise InvalidSettings(
                    f"SKYWAY_CELLS: {network_id} is at {self.url_of(network_id)}, and this "
                    f"composition ({self.url}) has {found[network_id]} missions of it that are "
                    "not over: change the setting when they are over"
                )

    def refuse_foreign(self, network_id: NetworkId) -> None:
        """Go on only if this composition serves the network.

        Raises
        ------
        Misdirected
            Another composition serves it.
        """
        if not self.serves(network_id):
            raise Misdirected(
                f"{network_id} is served by {self.url_of(network_id)}, not by this composition "
                f"({self.url}): set SKYWAY_CELLS the same for all services"
            )

    def note_home(self, drone_id: DroneId, network_id: NetworkId | None) -> None:
        """Note the home network of a drone; None if the registry does not know it."""
        if len(self._homes) >= _MOST_HOMES:
            self._homes.clear()
        if network_id is not None:
            self._homes[drone_id] = network_id

    def is_foreign(self, drone_id: str) -> bool:
        """Whether another composition handles the messages of this drone."""
        network_id = self._homes.get(drone_id)
        return network_id is not None and not self.serves(network_id)

"""Which drones the pads of a station fit, from the properties of the station.

`pad_connectors` lists the connectors that each pad of a station has. Without it the pads fit every
drone. A drone whose model has another connector may land there, but it cannot charge.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from skyway.errors import InvalidNetwork
from skyway.ids import ConnectorId, StationId
from skyway.network import fields
from skyway.network.columns import Columns

#: The property of a station that lists the connectors of its pads.
PAD_CONNECTORS: Final = "pad_connectors"

#: The most connectors of a pad, and the most different connectors in a network. Our own choice.
MOST_OF_PAD: Final = 8
MOST_OF_NETWORK: Final = 32


def read_pad_connectors(
    properties: Mapping[str, Any], path: str, *, pads: int
) -> frozenset[ConnectorId]:
    """The connectors of each pad of this station, whose properties have `pad_connectors`.

    Raises
    ------
    InvalidNetwork
        The list is wrong, or the station has no pad.
    """
    path = f"{path}.{PAD_CONNECTORS}"
    listed = fields.array(properties[PAD_CONNECTORS], path)
    if not 1 <= len(listed) <= MOST_OF_PAD:
        raise InvalidNetwork(path, f"{len(listed)} connectors, 1 to {MOST_OF_PAD} are allowed")
    if pads < 1:
        raise InvalidNetwork(path, "the station has no pads that could have connectors")
    return frozenset(
        ConnectorId(fields.identifier(each, f"{path}.{number}"))
        for number, each in enumerate(listed)
    )


@dataclass(frozen=True, slots=True, eq=False)
class PadConnectors:
    """The connectors of each pad, by station; the pads of other stations fit every drone."""

    of_station: Mapping[StationId, frozenset[ConnectorId]]
    #: All connectors of the network.
    named: frozenset[ConnectorId]

    @classmethod
    def of(cls, columns: Columns) -> "PadConnectors":
        """The connectors that the properties of these stations state.

        Raises
        ------
        InvalidNetwork
            A list is wrong, or there are too many different connectors.
        """
        of_station = {
            columns.station_ids[row]: read_pad_connectors(
                each, f"stations.{row}", pads=int(columns.pads[row])
            )
            for row, each in columns.station_properties.items()
            if PAD_CONNECTORS in each
        }
        named = frozenset[ConnectorId]().union(*of_station.values())
        if len(named) > MOST_OF_NETWORK:
            detail = f"the pads have {len(named)} connectors, at most {MOST_OF_NETWORK} are allowed"
            raise InvalidNetwork("stations", detail)
        return cls(of_station, named)

    def unfit(self, connector: ConnectorId) -> Iterator[StationId]:
        """The stations whose pads do not fit a drone with this connector."""
        return (station for station, have in self.of_station.items() if connector not in have)

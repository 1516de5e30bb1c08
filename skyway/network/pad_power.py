"""The power that the pads of a station give, from the properties of the station.

`pad_power_w` is the most that one pad gives, and `station_power_w` the most that all pads of the
station give together. Without them pads charge as fast as a drone can.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from skyway.errors import InvalidNetwork
from skyway.ids import StationId
from skyway.network import fields
from skyway.network.columns import Columns, Rows

#: The properties of a station that hold the power of its pads.
PAD_POWER: Final = "pad_power_w"
STATION_POWER: Final = "station_power_w"

#: Limits of both, watts: below the first a charge would take weeks. Our own choice.
MIN_POWER_W: Final = 10.0
MAX_POWER_W: Final = 1e9

#: The most different powers of the pads of one network. The planner keeps a charge curve for each.
#: Our own choice.
MAX_POWERS: Final = 32


def has_power(properties: Mapping[str, Any]) -> bool:
    """Whether these properties of a station limit the power of its pads."""
    return PAD_POWER in properties or STATION_POWER in properties


def read_pad_power(properties: Mapping[str, Any], path: str, *, pads: int) -> float:
    """The power that each pad of this station gives even if all pads charge, in watts.

    Parameters
    ----------
    properties
        At least one of the two properties is there.
    path
        Where the properties are, for an error.

    Raises
    ------
    InvalidNetwork
        A power or a pad's share is no number within the limits, or the station has no pad.
    """
    powers_w = {
        name: fields.number(properties[name], f"{path}.{name}", low=MIN_POWER_W, high=MAX_POWER_W)
        for name in (PAD_POWER, STATION_POWER)
        if name in properties
    }
    if pads < 1:
        name = next(iter(powers_w))
        raise InvalidNetwork(f"{path}.{name}", "the station has no pads that could give power")
    share_w = powers_w.get(STATION_POWER, np.inf) / pads
    if share_w < MIN_POWER_W:
        detail = f"{share_w:g} W for each of {pads} pads is below {MIN_POWER_W:g} W"
        raise InvalidNetwork(f"{path}.{STATION_POWER}", detail)
    return min(powers_w.get(PAD_POWER, np.inf), share_w)


@dataclass(frozen=True, slots=True, eq=False)
class PadPowers:
    """The power of each pad that is guaranteed, by station.

    `limited_w` holds the stations with a limit. `steps_w` are the different powers of the network's
    pads in watts, the highest first, inf for pads without a limit. `step` is ``(n,)`` the index of
    each station's power among them; it is empty if no station has a limit.
    """

    limited_w: Mapping[StationId, float]
    steps_w: tuple[float, ...]
    step: Rows

    @classmethod
    def of(cls, columns: Columns) -> "PadPowers":
        """The powers that the properties of these stations state.

        Raises
        ------
        InvalidNetwork
            A power is wrong, or there are too many different powers.
        """
        by_row = {
            row: read_pad_power(each, f"stations.{row}", pads=int(columns.pads[row]))
            for row, each in columns.station_properties.items()
            if has_power(each)
        }
        if not by_row:
            return cls({}, (np.inf,), np.empty(0, np.int32))
        power_w = np.full(len(columns.station_ids), np.inf)
        power_w[list(by_row)] = list(by_row.values())
        steps_w = np.unique(power_w[columns.pads > 0])[::-1]
        if len(steps_w) > MAX_POWERS:
            detail = f"the pads give {len(steps_w)} different powers, at most {MAX_POWERS} may be"
            raise InvalidNetwork("stations", detail)
        # A station without pads gets the first step, which means nothing there.
        step = np.where(columns.pads > 0, np.searchsorted(-steps_w, -power_w), 0)
        return cls(
            {columns.station_ids[row]: one_w for row, one_w in by_row.items()},
            tuple(steps_w.tolist()),
            step.astype(np.int32),
        )

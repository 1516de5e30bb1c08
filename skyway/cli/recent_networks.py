"""Keeps the networks last read: hundreds of problems often share one, and reading it is slow."""

import marshal
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any

from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.problem import network_of

#: Networks kept; each may take as much memory as the rest of the program.
_KEPT = 4


@dataclass(slots=True)
class RecentNetworks:
    """Networks and their airspaces by the content of their JSON, the latest last."""

    _kept: dict[bytes, tuple[Network, Airspace]] = field(default_factory=dict)

    def prepared(self, value: Any) -> tuple[Network, Airspace]:  # any JSON value
        """The network that this JSON describes, ready to compose on.

        Raises
        ------
        InvalidNetwork
            It describes none.
        """
        # Version 2 of the format writes equal values equally, and tells true from 1.
        key = sha256(marshal.dumps(value, 2)).digest()
        known = self._kept.pop(key, None)
        if known is None:
            network = network_of(value)
            known = network, Airspace.of(network)
        self._kept[key] = known
        if len(self._kept) > _KEPT:
            del self._kept[next(iter(self._kept))]
        return known

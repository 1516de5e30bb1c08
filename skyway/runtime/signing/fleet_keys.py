"""The keys of drones that are registered together with a fleet file."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from skyway.contracts.drones import MOST_NEW_DRONES
from skyway.runtime.signing.key_pair import PrivateKey


class FleetKeys:
    """A key pair for each drone: public keys go to the registry, private keys into the fleet file.

    The values of JSON objects are Any.
    """

    def __init__(self, drones: Sequence[Mapping[str, Any]]) -> None:
        self._drones = drones
        self._keys = [PrivateKey.new() for _ in drones]

    @property
    def bodies(self) -> list[dict[str, Any]]:
        """The drones as they are registered, each with its public key."""
        pairs = zip(self._drones, self._keys, strict=True)
        return [{**drone, "public_key": key.public_key} for drone, key in pairs]

    def batches(self) -> Iterator[list[dict[str, Any]]]:
        """The same in as many lists as calls are needed to register them."""
        for first in range(0, len(self._drones), MOST_NEW_DRONES):
            yield self.bodies[first : first + MOST_NEW_DRONES]

    def kept(self, registered: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """The answer to the registration, in its order, each drone with its private key."""
        pairs = zip(registered, self._keys, strict=True)
        return [{**drone, "signing_key": key.text} for drone, key in pairs]

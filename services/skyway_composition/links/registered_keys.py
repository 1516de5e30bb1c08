"""The keys with which drones sign, as the registry answers."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from skyway.contracts.drones import (
    DRONE_SIGNATURES,
    DroneSignature,
    DroneSignatureQuery,
    DroneSignatures,
)
from skyway.ids import DroneId
from skyway.runtime.http.client import ServiceClient
from skyway_composition.own_cells import OwnCells


@dataclass(frozen=True, slots=True)
class RegisteredKeys:
    """`KeySource` of the registry; each call raises `ServiceUnavailable` while it is away."""

    registry: ServiceClient
    own: OwnCells

    async def of(self, drone_ids: Collection[DroneId]) -> Sequence[DroneSignature]:
        """How each of these drones signs; one that is not registered is left out."""
        return await self._ask(DroneSignatureQuery(drone_ids=tuple(drone_ids)))

    async def changed(self) -> Sequence[DroneSignature]:
        """How the drones sign whose credentials have changed within a minute."""
        return await self._ask(DroneSignatureQuery())

    async def _ask(self, query: DroneSignatureQuery) -> Sequence[DroneSignature]:
        """Ask for keys; the answer also shows which drones are of networks of others."""
        answer = await self.registry.call(
            "POST", DRONE_SIGNATURES, body=query, answer=DroneSignatures
        )
        for each in answer.signatures:
            self.own.note_home(each.drone_id, each.network_id)
        return answer.signatures

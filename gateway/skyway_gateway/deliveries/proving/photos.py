"""Keeps the photos of hand-overs, and erases pictures in time.

A photo is in its store before its row says so, and leaves it before its row does. So after a kill
in between, no photo is left that nobody would erase.
"""

import asyncio
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from skyway.errors import InvalidInput
from skyway.ids import DeliveryId, PackageId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway_gateway.deliveries.proving.accept_proof import ProofAcceptance
from skyway_gateway.proofs import store as proof_store
from skyway_gateway.proofs.photo import cleaned
from skyway_gateway.proofs.store import PackageKey

if TYPE_CHECKING:
    from skyway_gateway.proofs.photo_store import PhotoStore

#: Photos that are decoded at the same time: each may need 50 MB of memory meanwhile.
_DECODED_AT_ONCE = 2


@dataclass(frozen=True, slots=True)
class Photos:
    """The photos of this deployment; without a store no package can ask for one."""

    db: Database
    clock: FleetClock
    store: "PhotoStore | None"
    proofs: ProofAcceptance
    _turns: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(_DECODED_AT_ONCE))

    def require_store(self, field_name: str) -> "PhotoStore":
        """The store.

        Raises
        ------
        InvalidInput
            The deployment has none.
        """
        if self.store is None:
            raise InvalidInput(field_name, "must not be PHOTO: this deployment keeps no photos")
        return self.store

    async def accept(self, delivery_id: DeliveryId, package_id: PackageId, raw: bytes) -> None:
        """Keep the photo that a drone has uploaded, and take it as the proof.

        Raises
        ------
        InvalidInput
            It is no photo, or is too large.
        NotFound, Conflict
            As `ProofAcceptance.accept_photo`.
        ServiceUnavailable
            The store does not answer.
        """
        if not await self.proofs.must_await_photo(delivery_id, package_id):
            return
        async with self._turns:
            photo = await asyncio.to_thread(cleaned, raw)
        await self.require_store("method").put(delivery_id, package_id, photo)
        await self.proofs.accept_photo(delivery_id, package_id)

    async def picture_of(self, key: PackageKey) -> tuple[bytes, str] | None:
        """The picture of a proof and its media type; None without one."""
        async with self.db.read() as connection:
            proof = (await proof_store.of_delivery(connection, key[0])).get(key[1])
            signature = await proof_store.signature_of(connection, key)
        if signature is not None:
            return signature.svg.encode(), "image/svg+xml"
        if proof is None or proof.picture is None or self.store is None:
            return None
        photo = await self.store.get(*key)
        return None if photo is None else (photo, proof.picture)

    async def erase_due(self) -> bool:
        """One step of a loop: erase PINs that are of no use, and pictures that are due."""
        async with self.db.write() as tx:
            await proof_store.erase_pins(tx)
        async with self.db.read() as connection:
            keys = await proof_store.due(connection, at=self.clock.now())
        await self._erase(keys)
        return len(keys) == proof_store.BATCH

    async def erase_of(self, delivery_ids: Collection[DeliveryId]) -> None:
        """Erase the photos of deliveries that are about to be deleted."""
        async with self.db.read() as connection:
            keys = await proof_store.photos_of(connection, delivery_ids)
        await self._erase(keys)

    async def _erase(self, keys: Collection[PackageKey]) -> None:
        if self.store is not None:
            for key in keys:
                await self.store.delete(*key)
        if keys:
            async with self.db.write() as tx:
                await proof_store.note_erased(tx, keys)

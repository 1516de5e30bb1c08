"""Accepts the proof of a hand-over, and notifies composition in the same transaction.

The delivery is locked first. So of two proofs at the same time one counts, and wrong PINs that are
typed at the same time are all counted before they are answered.
"""

import hmac
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from skyway.contracts.mission import GivenProof
from skyway.contracts.mission_reports import MissionReport
from skyway.errors import InvalidInput
from skyway.ids import DeliveryId, PackageId, is_live_id
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.limits import Budget, Meter
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.clients import PROOFS_PATH
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.proofs import store
from skyway_gateway.proofs.signature import Signature
from skyway_gateway.proofs.verification import (
    MOST_WRONG_PINS,
    DropoffProof,
    GivenBy,
)
from skyway_gateway.sandbox.sandbox_composition import SandboxComposition

#: What may be typed as a PIN: a wrong one may be shorter than a right one.
_Typed = Annotated[str, Field(min_length=1, max_length=8, pattern=r"^[0-9]+$")]


class TypedProof(JsonModel):
    """What a recipient types or signs; exactly one of the two."""

    package_id: PackageId
    pin: Annotated[_Typed | None, Field(repr=False, description="The PIN, up to 8 digits.")] = None
    signature: Annotated[Signature | None, Field(description="The signature.")] = None

    @model_validator(mode="after")
    def _is_one_of_two(self) -> Self:
        if (self.pin is None) == (self.signature is None):
            raise ValueError("needs either a pin or a signature")
        return self

    @property
    def method(self) -> str:
        """What it proves the hand-over by."""
        return "SIGNATURE" if self.pin is None else "PIN"


#: What is typed and signed on the page of one delivery, however many people have its link.
_TRIES: Final = Budget("PROOF_TRIES", per_s=0.5, burst=20)


@dataclass(frozen=True, slots=True)
class ProofAcceptance:
    """Accepts proofs; their pictures are `kept` so long, fleet time."""

    db: Database
    clock: FleetClock
    kept: timedelta
    sandbox: SandboxComposition
    tries: Meter = field(default_factory=lambda: Meter(_TRIES))

    async def accept_typed(self, delivery_id: DeliveryId, typed: TypedProof) -> None:
        """Accept what a recipient has typed or signed on the tracking page.

        Raises
        ------
        NotFound
            The delivery has no such package, or needs no proof for it.
        InvalidInput
            The PIN is wrong, or another method proves the hand-over.
        Conflict
            NOT_AWAITED: no drone waits for the proof now. PROOF_LOCKED: too many wrong PINs.
        BudgetSpent
            Too much was typed on the page of this delivery.
        """
        self.tries.spend(delivery_id)
        async with self.db.write() as tx:
            delivery = (await delivery_store.lock(tx, delivery_id)).delivery
            proof = await self._open(tx, delivery, typed.package_id, method=typed.method)
            key = delivery_id, typed.package_id
            if proof is None:
                return
            if proof.is_locked:
                raise Conflict("PROOF_LOCKED", _LOCKED)
            is_right = typed.pin is None or _is_same(typed.pin, proof.pin)
            if is_right:
                await self._give(tx, key, "RECIPIENT", signature=typed.signature)
            else:
                await store.note_wrong_pin(tx, key)
        if not is_right:
            left = MOST_WRONG_PINS - proof.wrong_pins - 1
            raise InvalidInput("pin", f"is wrong; {left} of {MOST_WRONG_PINS} tries are left")

    async def follow(self, tx: Tx, delivery: Delivery, report: MissionReport) -> None:
        """Do what a report asks for; the delivery must be locked."""
        if report.kind == "PROOF_AWAITED":
            await self.notify_again(tx, delivery, report.package_ids)
        elif report.kind == "PIN_ENTERED" and report.pin is not None:
            await self.accept_at_box(tx, delivery, report.package_ids, pin=report.pin)

    async def accept_at_box(
        self, tx: Tx, delivery: Delivery, package_ids: Collection[PackageId], *, pin: str
    ) -> None:
        """Accept a PIN that was typed at the box of a drone, for one of these packages.

        A wrong PIN counts for each of them. The delivery must be locked.
        """
        proofs = await store.of_delivery(tx.connection, delivery.delivery_id)
        awaited = [
            (each.package_id, proofs[each.package_id])
            for each in self._awaiting(delivery.packages)
            if each.package_id in package_ids and each.package_id in proofs
        ]
        open_ones = [
            (package_id, proof)
            for package_id, proof in awaited
            if proof.pin is not None and not proof.is_locked
        ]
        right = [package_id for package_id, proof in open_ones if _is_same(pin, proof.pin)]
        for package_id in right:
            await self._give(tx, (delivery.delivery_id, package_id), "KEYPAD")
        for package_id, _ in open_ones if not right else ():
            await store.note_wrong_pin(tx, (delivery.delivery_id, package_id))

    async def vouch(self, delivery_id: DeliveryId, package_id: PackageId, *, by: GivenBy) -> None:
        """Accept the word of a customer or an operator, even after too many wrong PINs.

        Raises NotFound and Conflict as `accept_typed` does.
        """
        async with self.db.write() as tx:
            delivery = (await delivery_store.lock(tx, delivery_id)).delivery
            if await self._open(tx, delivery, package_id) is not None:
                await self._give(tx, (delivery_id, package_id), by)

    async def accept_photo(self, delivery_id: DeliveryId, package_id: PackageId) -> None:
        """Accept the photo that the store now has. Raises as `accept_typed` does."""
        async with self.db.write() as tx:
            delivery = (await delivery_store.lock(tx, delivery_id)).delivery
            if await self._open(tx, delivery, package_id, method="PHOTO") is not None:
                await self._give(tx, (delivery_id, package_id), "DRONE", has_photo=True)

    async def must_await_photo(self, delivery_id: DeliveryId, package_id: PackageId) -> bool:
        """Check that a drone waits with the package; False if its photo was accepted before.

        Raises as `accept_photo` does.
        """
        async with self.db.read() as connection:
            delivery = (await delivery_store.read(connection, delivery_id)).delivery
            found = await store.of_delivery(connection, delivery_id)
        return self._open_of(delivery, found.get(package_id), package_id, "PHOTO") is not None

    async def notify_again(self, tx: Tx, delivery: Delivery, waiting: Iterable[PackageId]) -> None:
        """Notify composition of proofs that were given before a drone waits for them once more."""
        proofs = await store.of_delivery(tx.connection, delivery.delivery_id)
        for package_id in waiting:
            if package_id in proofs and proofs[package_id].given_at is not None:
                await self._notify(tx, (delivery.delivery_id, package_id))

    def _awaiting(self, packages: Iterable[PackageStatus]) -> Iterable[PackageStatus]:
        now = self.clock.now()
        return (each for each in packages if each.awaits_proof(now))

    async def _open(
        self, tx: Tx, delivery: Delivery, package_id: PackageId, *, method: str | None = None
    ) -> DropoffProof | None:
        found = await store.of_delivery(tx.connection, delivery.delivery_id)
        return self._open_of(delivery, found.get(package_id), package_id, method)

    def _open_of(
        self,
        delivery: Delivery,
        proof: DropoffProof | None,
        package_id: PackageId,
        method: str | None,
    ) -> DropoffProof | None:
        """The proof that a drone waits for; None if it was given before."""
        if proof is None:
            raise NotFound("proof of package", package_id)
        if method not in (None, proof.method):
            field = "body" if method == "PHOTO" else str(method).lower()
            detail = f"package {package_id} needs a proof of the method {proof.method}"
            raise InvalidInput(field, detail)
        if proof.given_at is not None:
            return None
        if all(each.package_id != package_id for each in self._awaiting(delivery.packages)):
            raise Conflict("NOT_AWAITED", f"no drone waits for the proof of package {package_id}")
        return proof

    async def _give(
        self,
        tx: Tx,
        key: store.PackageKey,
        by: GivenBy,
        *,
        signature: Signature | None = None,
        has_photo: bool = False,
    ) -> None:
        is_first = await store.give(
            tx,
            key,
            by=by,
            at=self.clock.now(),
            kept=self.kept,
            signature=signature,
            has_photo=has_photo,
        )
        if is_first:
            await self._notify(tx, key)

    async def _notify(self, tx: Tx, key: store.PackageKey) -> None:
        delivery_id, package_id = key
        if not is_live_id(delivery_id):
            await self.sandbox.accept_proof(tx, delivery_id, package_id)
            return
        path = PROOFS_PATH.format(delivery_id=delivery_id)
        tx.report("composition", path, GivenProof(package_id=package_id), stream=delivery_id)


_LOCKED: Final = (
    f"{MOST_WRONG_PINS} wrong PINs were typed: only the sender can confirm the hand-over now"
)


def _is_same(typed: str, pin: str | None) -> bool:
    """Whether this is the PIN, compared in constant time."""
    return pin is not None and hmac.compare_digest(typed, pin)

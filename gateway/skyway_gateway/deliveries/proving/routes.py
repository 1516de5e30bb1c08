"""Proofs over REST: what proves a hand-over, its picture, the customer's word, a drone's photo."""

from typing import Annotated, Final

from fastapi import Request, Response
from pydantic import Field
from starlette.exceptions import HTTPException

from skyway.ids import DeliveryId, PackageId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.answers import Part, conflicts
from skyway.runtime.http.entrance import Meters
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter, takes_bytes
from skyway.runtime.sql.database import Database
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.proving.accept_proof import ProofAcceptance
from skyway_gateway.deliveries.proving.photos import Photos
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.proofs import store
from skyway_gateway.proofs.photo import MEDIA_TYPES, MOST_BYTES
from skyway_gateway.proofs.store import PackageKey
from skyway_gateway.proofs.upload_links import UPLOAD_PATHS, UploadLinks
from skyway_gateway.proofs.verification import DropoffProof, GivenBy

#: A picture runs no script, and no browser takes it for something else.
_PICTURE_HEADERS: Final = {"Content-Security-Policy": "default-src 'none'; sandbox"}

_PICTURE: Final[dict[int | str, Part]] = {
    200: {
        "content": {
            media: {"schema": {"type": "string", "format": "binary"}}
            for media in ("image/jpeg", "image/svg+xml")
        }
    }
}
_UPLOAD: Final = {
    "requestBody": {
        "required": True,
        "content": {
            media: {"schema": {"type": "string", "format": "binary"}} for media in MEDIA_TYPES
        },
    }
}


class ShownProof(DropoffProof):
    """The proof of a package's hand-over, as the caller may see it."""

    package_id: PackageId


async def picture_answer(photos: Photos, key: PackageKey) -> Response:
    """The picture of a proof.

    Raises
    ------
    NotFound
        There is none, or it is erased.
    """
    found = await photos.picture_of(key)
    if found is None:
        raise NotFound("picture of package", key[1])
    return Response(found[0], media_type=found[1], headers=_PICTURE_HEADERS)


def proof_routes(db: Database, *, proofs: ProofAcceptance, photos: Photos) -> ServiceRouter:
    """Everything below /v1/deliveries/{delivery_id}/packages/{package_id}/proof."""
    router = ServiceRouter(tags=("deliveries",))
    path = "/v1/deliveries/{delivery_id}/packages/{package_id}/proof"

    @router.get(path)
    async def get_package_proof(
        delivery_id: DeliveryId, package_id: PackageId, caller: KeyCaller
    ) -> ShownProof:
        """Show the proof of a package's hand-over: its method, and when and by whom it was given.

        Callers: customer, provider, operator.
        """
        proof = await _proof_of(caller, delivery_id, package_id)
        shown = proof.without_pin if caller.role == "provider" else proof
        return ShownProof(package_id=package_id, **dict(shown))

    @router.get(f"{path}/picture", response_class=Response, responses=_PICTURE)
    async def get_proof_picture(
        delivery_id: DeliveryId, package_id: PackageId, caller: KeyCaller
    ) -> Response:
        """Show the photo or the signature of a package's hand-over.

        Callers: customer, provider, operator.
        """
        await _proof_of(caller, delivery_id, package_id)
        return await picture_answer(photos, (delivery_id, package_id))

    @router.post(path, responses=conflicts("NOT_AWAITED"))
    async def give_package_proof(
        delivery_id: DeliveryId, package_id: PackageId, caller: KeyCaller
    ) -> ShownProof:
        """Confirm the hand-over in place of the recipient, while the drone waits.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        await _proof_of(caller, delivery_id, package_id)
        by: GivenBy = "CUSTOMER" if caller.role == "customer" else "OPERATOR"
        await proofs.vouch(delivery_id, package_id, by=by)
        proof = await _proof_of(caller, delivery_id, package_id)
        return ShownProof(package_id=package_id, **dict(proof))

    async def _proof_of(
        caller: Caller, delivery_id: DeliveryId, package_id: PackageId
    ) -> DropoffProof:
        caller.must_be("customer", "provider", "operator")
        async with db.read() as connection:
            if caller.role == "provider":
                delivery = (await delivery_store.read(connection, delivery_id)).delivery
                if caller.subject_id != _flown_by(delivery, package_id):
                    raise NotFound("delivery", delivery_id)
            else:
                await delivery_store.require_own(connection, caller, delivery_id)
            found = (await store.of_delivery(connection, delivery_id)).get(package_id)
        if found is None:
            raise NotFound("proof of package", package_id)
        return found

    return router


def _flown_by(delivery: Delivery, package_id: PackageId) -> str | None:
    """The provider whose drone carries, or has carried, a package."""
    carried = {each.package_id: each.mission_id for each in delivery.packages}.get(package_id)
    flown = (each.provider_id for each in delivery.missions if each.mission_id == carried)
    return next(flown, None)


def upload_routes(*, photos: Photos, uploads: UploadLinks, meters: Meters) -> ServiceRouter:
    """PUT /v1/proofs/uploads/{token}."""
    router = ServiceRouter(tags=("deliveries",))

    @router.put(
        f"{UPLOAD_PATHS}{{token}}",
        status_code=204,
        responses=conflicts("NOT_AWAITED"),
        openapi_extra=_UPLOAD,
    )
    @takes_bytes(MOST_BYTES)
    async def upload_proof_photo(
        request: Request,
        token: Annotated[str, Field(max_length=300, description="The end of the address.")],
    ) -> Response:
        """Upload the photo of a hand-over, while the drone waits; the address is the key.

        A JPEG, PNG or WebP of at most 2 MiB and 4096 by 4096 pixels. A second photo of the same
        package changes nothing.

        Callers: anybody with the address.
        """
        key = uploads.package_of(token)
        if key is None:
            meters.charge_refused(request)
            raise NotFound("upload", "with this address")
        media_type = request.headers.get("content-type", "none").partition(";")[0].strip().lower()
        if media_type not in MEDIA_TYPES:
            detail = f"the Content-Type must be one of {', '.join(MEDIA_TYPES)}; it is {media_type}"
            raise HTTPException(415, detail)
        await photos.accept(*key, await request.body())
        return Response(status_code=204)

    return router

"""Photos of hand-overs: who may upload one, what is kept of it, and until when."""

from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import pytest

from tests.gateway.deliveries.proving.proofs import (
    Recipient,
    asking,
    make_photo,
    proof_of,
    recipient_of,
)
from tests.gateway.whole_gateway import Gateway, opened_gateway

PHOTO = {"method": "PHOTO"}


def address_of(gateway: Gateway, recipient: Recipient) -> str:
    """Where the drone uploads the photo, as composition was asked."""
    asked = (
        package.dropoff_verification
        for booking in gateway.composition.asked
        for package in booking.request.packages
    )
    paths = [each.upload_path for each in asked if each is not None and each.upload_path]
    [path] = [each for each in paths if recipient.delivery_id in each]
    return path


async def upload(gateway: Gateway, path: str, body: bytes, media_type: str = "image/jpeg") -> int:
    """The status of the answer."""
    headers = {"Content-Type": media_type}
    return (await gateway.http.put(path, content=body, headers=headers)).status_code


def kept_photos(folder: Path) -> list[Path]:
    """The files in the store of the gateway in this folder."""
    return [*folder.glob("photos/**/*.jpg")]


async def picture(
    gateway: Gateway, recipient: Recipient, who: dict[str, str], *, package_id: str = "p1"
) -> int:
    """The status of a look at the picture."""
    path = f"/v1/deliveries/{recipient.delivery_id}/packages/{package_id}/proof/picture"
    return (await gateway.http.get(path, headers=who)).status_code


async def test_a_photo_is_accepted_only_while_the_drone_waits(gateway: Gateway) -> None:
    recipient = await recipient_of(gateway, PHOTO)
    path = address_of(gateway, recipient)

    before = await upload(gateway, path, make_photo())
    await recipient.drone_waits()
    accepted = [await upload(gateway, path, make_photo()) for _ in range(2)]

    assert (before, accepted) == (409, [204, 204])
    assert await recipient.messages() == ['{"package_id":"p1"}']
    proof = await proof_of(gateway, recipient.delivery_id)
    assert (proof["given_by"], proof["picture"]) == ("DRONE", "image/jpeg")
    seen = [
        await picture(gateway, recipient, who)
        for who in (gateway.customer, gateway.provider, gateway.operator, gateway.other)
    ]
    assert seen == [200, 200, 200, 404]


async def test_the_address_of_a_photo_is_in_no_event_and_no_delivery(gateway: Gateway) -> None:
    recipient = await recipient_of(gateway, PHOTO)
    token = address_of(gateway, recipient).rpartition("/")[2]

    shown = await gateway.get(recipient.delivery_id)

    assert token not in f"{shown} {await gateway.events(recipient.delivery_id)}"


@pytest.mark.parametrize(
    ("make_body", "media_type", "status"),
    [
        (lambda: b"<svg xmlns='http://www.w3.org/2000/svg'/>", "image/svg+xml", 415),
        (lambda: b"<html></html>", "image/jpeg", 422),
        (lambda: b"", "image/jpeg", 422),
        (lambda: make_photo()[:200], "image/jpeg", 422),
        (lambda: make_photo("GIF"), "image/png", 422),
        (lambda: make_photo("PNG", (4_097, 1)), "image/png", 422),
        (lambda: make_photo("PNG", (10_000, 10_000), mode="1"), "image/png", 422),
        (lambda: bytes(2 * 1024 * 1024 + 1), "image/jpeg", 413),
        (lambda: make_photo("PNG"), "image/png", 204),
        (lambda: make_photo("WEBP"), "image/webp", 204),
    ],
    ids=["svg", "html", "empty", "cut", "gif", "wide", "bomb", "large", "png", "webp"],
)
async def test_what_is_no_small_photo_is_refused(
    gateway: Gateway, make_body: Callable[[], bytes], media_type: str, status: int
) -> None:
    recipient = await recipient_of(gateway, PHOTO)
    await recipient.drone_waits()

    assert await upload(gateway, address_of(gateway, recipient), make_body(), media_type) == status


async def test_the_address_of_another_delivery_or_a_guess_is_not_found(gateway: Gateway) -> None:
    one, other = [await recipient_of(gateway, PHOTO) for _ in range(2)]
    await one.drone_waits()
    path = address_of(gateway, other)

    wrong = [
        path.replace(other.delivery_id, one.delivery_id),
        path[:-1],
        path + "x",
        "/v1/proofs/uploads/x",
        f"{path}%C3%A9",
    ]

    assert [await upload(gateway, each, make_photo()) for each in wrong] == [404] * 5


async def test_a_photo_is_erased_after_its_days(gateway: Gateway, tmp_path: Path) -> None:
    recipient = await recipient_of(gateway, PHOTO)
    await recipient.drone_waits()
    await upload(gateway, address_of(gateway, recipient), make_photo())
    assert len(kept_photos(tmp_path)) == 1

    gateway.clock.advance(timedelta(days=30, seconds=1))
    await gateway.parts.photos.erase_due()

    assert kept_photos(tmp_path) == []
    assert (await proof_of(gateway, recipient.delivery_id))["picture"] is None


async def test_pictures_are_erased_with_the_personal_data(gateway: Gateway, tmp_path: Path) -> None:
    recipient = await recipient_of(gateway, PHOTO, {"method": "SIGNATURE"})
    await recipient.drone_waits("p1", "p2")
    await upload(gateway, address_of(gateway, recipient), make_photo())
    await recipient.gives(package_id="p2", signature={"name": "Ada"})
    path = f"/v1/deliveries/{recipient.delivery_id}/personal-data"

    erased = await gateway.http.delete(path, headers=gateway.customer)

    names = [f"packages.{each}.dropoff_proof.picture" for each in ("p1", "p2")]
    assert erased.json()["fields"] == names
    assert kept_photos(tmp_path) == []
    assert await picture(gateway, recipient, gateway.customer) == 404
    again = await gateway.http.delete(path, headers=gateway.customer)
    assert again.json()["fields"] == []


async def test_a_deployment_without_a_store_refuses_photos(sqlite_url: str, tmp_path: Path) -> None:
    async with opened_gateway(sqlite_url, tmp_path, proof_store=None) as gateway:
        answer = await gateway.post(asking(PHOTO))

    assert answer.status_code == 422
    assert "packages.0.dropoff_verification.method" in answer.text

"""Deliveries whose packages need proofs, and drones that wait for them."""

from datetime import timedelta
from io import BytesIO
from typing import Any

from PIL import Image

from skyway.ids import DeliveryId
from tests.gateway.whole_gateway import Gateway, make_request

WAIT = timedelta(seconds=120)


def make_photo(form: str = "JPEG", size: tuple[int, int] = (64, 48), *, mode: str = "RGB") -> bytes:
    """A small picture."""
    made = BytesIO()
    Image.new(mode, size, "navy").save(made, form)
    return made.getvalue()


def asking(*verifications: dict[str, Any]) -> dict[str, Any]:
    """A request with one package for each of these proofs."""
    request = make_request(packages=len(verifications))
    for package, verification in zip(request["packages"], verifications, strict=True):
        package["dropoff_verification"] = verification
    return request


class Recipient:
    """A person with the tracking link of a delivery."""

    def __init__(self, gateway: Gateway, delivery_id: DeliveryId, path: str) -> None:
        self.gateway, self.delivery_id, self.path = gateway, delivery_id, path
        self.reports = 0

    async def gives(self, **proof: Any) -> int:
        """The status of the answer to a proof for p1."""
        body = {"package_id": "p1", **proof}
        return (await self.gateway.http.post(f"{self.path}/proof", json=body)).status_code

    async def package(self, number: int = 0) -> dict[str, Any]:
        """A package as the page shows it."""
        answer = await self.gateway.http.get(f"{self.path}/state")
        package: dict[str, Any] = answer.json()["packages"][number]
        return package

    async def report(self, kind: str, **fields: Any) -> None:
        """The next report of the first mission."""
        self.reports += 1
        answer = await self.gateway.report(
            self.delivery_id, kind, seq=self.reports, station_id="mcqueeney", **fields
        )
        assert answer.status_code == 204, answer.text

    async def drone_waits(self, *package_ids: str) -> None:
        """The drone has come and waits for these packages' proofs."""
        until_at = self.gateway.clock.now() + WAIT
        await self.report("PROOF_AWAITED", package_ids=package_ids or ("p1",), until_at=until_at)

    async def messages(self) -> list[str]:
        """The messages about proofs to composition."""
        statement = "SELECT payload FROM outbox WHERE address LIKE '%/proofs' ORDER BY 1"
        async with self.gateway.parts.db.read() as connection:
            rows = await connection.exec_driver_sql(statement)
            return [bytes(row.payload).decode() for row in rows]


async def recipient_of(gateway: Gateway, *verifications: dict[str, Any]) -> Recipient:
    """The recipient of a delivery that is on its way."""
    recipient = await booked_for(gateway, *verifications)
    for kind in ("ACCEPTED", "LOADING", "LOADED"):
        await recipient.report(kind)
    return recipient


async def booked_for(gateway: Gateway, *verifications: dict[str, Any]) -> Recipient:
    """The recipient of a delivery that waits for its drone."""
    answer = await gateway.post(asking(*verifications))
    assert answer.status_code == 202, answer.text
    while await gateway.book_next():
        pass
    path = answer.json()["tracking_url"].removeprefix("http://gateway")
    return Recipient(gateway, answer.json()["delivery_id"], path)


async def proof_of(gateway: Gateway, delivery_id: str) -> dict[str, Any]:
    """The proof of the first package as its customer sees it."""
    proof: dict[str, Any] = (await gateway.get(delivery_id))["packages"][0]["dropoff_proof"]
    return proof

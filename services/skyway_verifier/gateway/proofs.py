"""The rules of proofs: who asked for one has one, and PINs and pictures leave in time."""

from typing import Final

from skyway_gateway.delivery_tables import deliveries, packages, proofs
from sqlalchemy import and_, select

from skyway.delivery.request import DeliveryRequest
from skyway_verifier.rule import Rule, Survey

#: The gateway looks once in a minute of wall time, at any clock rate. Fleet ms.
_ERASED_WITHIN_MS: Final = 86_400_000

_name = proofs.c.delivery_id + "/" + proofs.c.package_id
_is_of_package = and_(
    packages.c.delivery_id == proofs.c.delivery_id, packages.c.package_id == proofs.c.package_id
)
_may_be_handed_over = packages.c.state.in_(("CREATED", "LOADED", "IN_TRANSIT"))


async def _not_as_asked(survey: Survey) -> list[str]:
    """Packages whose proof is not the one that their request asks for."""
    stored: dict[tuple[str, str], str] = {}
    async for row in survey.each(select(proofs)):
        stored[row.delivery_id, row.package_id] = row.method
    asked: dict[tuple[str, str], str] = {}
    query = select(deliveries.c.delivery_id, deliveries.c.request)
    async for row in survey.each(query.where(deliveries.c.request.contains("dropoff_verif"))):
        for package in DeliveryRequest.read(row.request).packages:
            if package.dropoff_verification is not None:
                key = row.delivery_id, package.package_id
                asked[key] = package.dropoff_verification.method
    differing = {key for key, _ in stored.items() ^ asked.items()}
    return sorted("/".join(key) for key in differing)


async def _late_pins(survey: Survey) -> list[str]:
    """Packages that are not handed over any more, and whose PIN is there a day later."""
    if survey.fleet_ms is None:
        return []
    joined = proofs.join(packages, _is_of_package).join(
        deliveries, deliveries.c.delivery_id == proofs.c.delivery_id
    )
    is_old = deliveries.c.updated_ms + _ERASED_WITHIN_MS < survey.fleet_ms
    query = select(_name.label("name")).select_from(joined)
    rows = await survey.rows(query.where(proofs.c.pin.is_not(None), ~_may_be_handed_over, is_old))
    return [row.name for row in rows]


async def _late_pictures(survey: Survey) -> list[str]:
    """Packages whose picture is there a day after the time that was promised."""
    if survey.fleet_ms is None:
        return []
    is_late = proofs.c.due_ms + _ERASED_WITHIN_MS < survey.fleet_ms
    return [row.name for row in await survey.rows(select(_name.label("name")).where(is_late))]


_ERASING: Final = "The gateway's loop `proofs` does not run, or its store of photos: see its log."

PROOFS: Final = (
    Rule(
        "a package has the proof that its request asks for",
        _not_as_asked,
        "The customer asked for it in `deliveries.request`: add or delete the row of `proofs`.",
    ),
    Rule(
        "a package that needs a proof is delivered with one",
        select(_name)
        .select_from(proofs.join(packages, _is_of_package))
        .where(packages.c.state == "DELIVERED", proofs.c.given_ms.is_(None)),
        "Its drone has handed it over without its proof: ask the recipient, and its provider why.",
    ),
    Rule("the PIN of a hand-over is erased in time", _late_pins, _ERASING),
    Rule("the picture of a hand-over is erased in time", _late_pictures, _ERASING),
)

"""The rules of held offers: each hold keeps its drones and its pads, until one moment."""

from typing import Any, Final

from sqlalchemy import exists, select

from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.survey import Survey
from skyway.scheduling.booked_pad import BookedPad
from skyway_composition.missions.booking.claim_hold import pads_of_offers
from skyway_composition.missions.booking.held_offer import HELD_OFFERS, HeldOffer
from skyway_composition.tables import drone_links, offer_holds, pad_reservations

_RELEASE: Final = (
    "Nothing is lost: delete the hold's rows of `pad_reservations`, set `held_by` and "
    "`held_until_ms` of its drones to NULL, and delete its row of `offer_holds`. An offer that is "
    "accepted then is planned again."
)


async def _holds(survey: Survey) -> dict[str, tuple[int, tuple[HeldOffer, ...]]]:
    """By hold: until when it lasts, and its offers; a text that cannot be read is left out."""
    found = {}
    for row in await survey.rows(select(offer_holds)):
        try:
            found[row.hold_id] = (row.until_ms, HELD_OFFERS.validate_json(row.offers))
        except ValueError:
            continue  # another rule names texts that cannot be read
    return found


async def _without_drone(survey: Survey) -> list[str]:
    """Holds with a drone that no hold keeps; a later hold may have it after this one expired."""
    kept: dict[str, Any] = {}  # rows of drone_links
    for row in await survey.rows(select(drone_links).where(drone_links.c.held_by.is_not(None))):
        kept[row.drone_id] = row
    return [
        hold_id
        for hold_id, (until_ms, offers) in (await survey.once(_holds)).items()
        for drone_id in {each for held in offers for each in held.drone_ids}
        if drone_id not in kept or kept[drone_id].held_until_ms < until_ms
    ]


async def _without_pads(survey: Survey) -> list[str]:
    """Holds of idle drones with other pads than those of their offers.

    A drone on a mission may share pads with this mission, so nobody knows which ones it needs.
    """
    reserved: dict[str, set[BookedPad]] = {}
    of_holds = select(pad_reservations).where(pad_reservations.c.hold_id.is_not(None))
    for row in await survey.rows(of_holds):
        pad = BookedPad(row.station_id, row.pad, row.start_ms, row.end_ms)
        reserved.setdefault(row.hold_id, set()).add(pad)
    return [
        hold_id
        for hold_id, (_, offers) in (await survey.once(_holds)).items()
        if not any(held.calendars for held in offers)
        and set(pads_of_offers(offers)) != reserved.get(hold_id, set())
    ]


HOLDS: Final = (
    Rule(
        "I17 a held drone names its hold, and is held as long",
        select(drone_links.c.drone_id).where(
            drone_links.c.held_by.is_not(None),
            ~exists().where(
                offer_holds.c.hold_id == drone_links.c.held_by,
                offer_holds.c.until_ms == drone_links.c.held_until_ms,
            ),
        ),
        _RELEASE,
    ),
    Rule(
        "I17 a held pad is held as long as its hold",
        select(pad_reservations.c.hold_id)
        .join(offer_holds, offer_holds.c.hold_id == pad_reservations.c.hold_id)
        .where(offer_holds.c.until_ms != pad_reservations.c.held_until_ms),
        _RELEASE,
    ),
    Rule("I17 a hold keeps the drones of its offers", _without_drone, _RELEASE),
    Rule("I17 a hold keeps the pads of its offers", _without_pads, _RELEASE),
)

"""All SQL that deletes deliveries which ended long ago, each with everything that belongs to it."""

from collections.abc import Collection, Iterable, Sequence
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Delete,
    and_,
    bindparam,
    delete,
    exists,
    literal_column,
    or_,
    select,
    union_all,
    update,
)

from skyway.ids import DeliveryId, MissionId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.tables import (
    cancellations,
    custody,
    cut_steps,
    deliveries,
    drone_links,
    guests,
    instructions,
    is_open,
    mission_steps,
    missions,
    no_shows,
    outbox,
    proofs,
)

_LOCK: Final = (
    select(deliveries.c.delivery_id)
    .where(in_list(deliveries.c.delivery_id, "delivery_ids"))
    .order_by(deliveries.c.delivery_id)
    .with_for_update()
)

_following = instructions.alias("following")


def _is_unanswered(table: Any) -> ColumnElement[bool]:  # a table and its alias have no common type
    found: ColumnElement[bool] = table.c.status.in_(
        [literal_column("'SENT'"), literal_column("'RECEIVED'")]
    )
    return found


#: Missions that are not over, wait for an answer, have reports on their way, count against their
#: provider, or are reported by their drone, which may still have the packages.
_is_needed_mission: Final = or_(
    is_open,
    exists().where(
        outbox.c.channel.in_(("gateway", "registry")), outbox.c.stream == missions.c.mission_id
    ),
    exists().where(
        instructions.c.mission_id == missions.c.mission_id, _is_unanswered(instructions)
    ),
    exists().where(
        no_shows.c.mission_id == missions.c.mission_id,
        no_shows.c.at_ms >= bindparam("blamed_ms", type_=BigInteger),
    ),
    exists().where(
        drone_links.c.drone_id == missions.c.drone_id,
        drone_links.c.state.contains('"mission_id":"' + missions.c.mission_id + '"'),
    ),
)
_NEEDED: Final = union_all(
    select(missions.c.delivery_id).where(
        in_list(missions.c.delivery_id, "delivery_ids"), _is_needed_mission
    ),
    select(guests.c.delivery_id)
    .join(missions, missions.c.mission_id == guests.c.host_id)
    .where(
        in_list(guests.c.delivery_id, "delivery_ids"),
        or_(_is_needed_mission, exists().where(outbox.c.stream == guests.c.mission_id)),
    ),
)
#: Each delivery with a shared mission, and a guest of this mission.
_SHARING: Final = (
    select(missions.c.delivery_id, guests.c.delivery_id.label("guest_id"))
    .join(guests, guests.c.host_id == missions.c.mission_id)
    .where(in_list(missions.c.delivery_id, "delivery_ids"))
)

_MISSIONS: Final = select(missions.c.mission_id).where(
    in_list(missions.c.delivery_id, "delivery_ids")
)

#: The last instruction of a stream carries its number, and the drone's next answer is checked
#: against the instruction before an unanswered one.
_is_last = exists().where(
    drone_links.c.drone_id == instructions.c.drone_id,
    drone_links.c.stream == instructions.c.stream,
    drone_links.c.last_seq == instructions.c.seq,
)
_is_followed_by_unanswered = exists(
    select(literal_column("1"))
    .select_from(_following)
    .where(
        _following.c.drone_id == instructions.c.drone_id,
        _following.c.stream == instructions.c.stream,
        _following.c.seq == instructions.c.seq + 1,
        _is_unanswered(_following),
    )
)
_is_needed = or_(_is_last, _is_followed_by_unanswered)
_is_of_missions = in_list(instructions.c.mission_id, "mission_ids")

_LAST_PLACES: Final = (
    select(instructions.c.drone_id, instructions.c.stream, instructions.c.seq)
    .where(_is_of_missions)
    .order_by(instructions.c.drone_id, instructions.c.stream, instructions.c.seq)
)
_FORGET_INSTRUCTIONS: Final = delete(instructions).where(_is_of_missions, ~_is_needed)
_DETACH_INSTRUCTIONS: Final = (
    update(instructions).where(_is_of_missions).values(mission_id=None, mission_revision=None)
)
#: Instructions without a mission, before the last forgotten instruction of their drone.
_FORGET_DETACHED: Final = delete(instructions).where(
    instructions.c.drone_id == bindparam("of_drone"),
    instructions.c.mission_id.is_(None),
    or_(
        instructions.c.stream < bindparam("before_stream"),
        and_(
            instructions.c.stream == bindparam("before_stream"),
            instructions.c.seq < bindparam("before_seq"),
        ),
    ),
    ~_is_unanswered(instructions),
    ~_is_needed,
)

#: Rows that refer to missions, before the missions.
_OF_MISSION: Final[Sequence[Delete]] = tuple(
    delete(table).where(in_list(table.c.mission_id, "mission_ids"))
    for table in (cut_steps, mission_steps, no_shows)
)
_OF_DELIVERY: Final[Sequence[Delete]] = tuple(
    delete(table).where(in_list(table.c.delivery_id, "delivery_ids"))
    for table in (custody, proofs, cancellations, guests, missions, deliveries)
)


async def needed_among(
    tx: Tx, delivery_ids: Collection[DeliveryId], *, blamed_ms: int
) -> set[DeliveryId]:
    """Lock these deliveries; those that are still needed.

    A no-show since `blamed_ms`, fleet time, counts against its provider. A shared mission is needed
    as long as one of its guests is.
    """
    asked = {"delivery_ids": sorted(delivery_ids)}
    await tx.execute(_LOCK, asked)
    needed = set((await tx.execute(_NEEDED, asked | {"blamed_ms": blamed_ms})).scalars())
    sharing = [(row.delivery_id, row.guest_id) for row in await tx.execute(_SHARING, asked)]
    gone = set(delivery_ids) - needed
    while kept := {host for host, guest in sharing if host in gone and guest not in gone}:
        gone -= kept
    return set(delivery_ids) - gone


async def delete_deliveries(tx: Tx, delivery_ids: Iterable[DeliveryId]) -> None:
    """Delete these deliveries with all that belongs to them, the parts before the whole."""
    asked = {"delivery_ids": sorted(delivery_ids)}
    mission_ids = sorted((await tx.execute(_MISSIONS, asked)).scalars())
    if mission_ids:
        await _delete_instructions(tx, mission_ids)
        for statement in _OF_MISSION:
            await tx.execute(statement, {"mission_ids": mission_ids})
    for statement in _OF_DELIVERY:
        await tx.execute(statement, asked)


async def _delete_instructions(tx: Tx, mission_ids: list[MissionId]) -> None:
    """Delete the instructions of these missions; one that its stream needs only leaves them."""
    asked = {"mission_ids": mission_ids}
    places = {row.drone_id: row for row in await tx.execute(_LAST_PLACES, asked)}
    await tx.execute(_FORGET_INSTRUCTIONS, asked)
    await tx.execute(_DETACH_INSTRUCTIONS, asked)
    older = [
        {"of_drone": drone_id, "before_stream": row.stream, "before_seq": row.seq}
        for drone_id, row in sorted(places.items())
    ]
    if older:
        await tx.execute(_FORGET_DETACHED, older)

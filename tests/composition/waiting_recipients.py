"""The recipients of a busy world, who prove the hand-overs for which its drones wait."""

from contextlib import suppress
from typing import Literal

from skyway_composition.context import Context
from skyway_composition.missions.interventions.give_proof import give_proof
from skyway_composition.tables import proofs
from sqlalchemy import select

from skyway.runtime.errors import Conflict

#: FIRST: of several packages at one place, only the first gets its proof.
Recipients = Literal["THERE", "FIRST", "ABSENT"]


async def give_proofs(context: Context, recipients: Recipients) -> None:
    """Give the proofs that are missing now, as the recipients would."""
    if recipients == "ABSENT":
        return
    missing = select(proofs).where(proofs.c.given_ms.is_(None))
    async with context.db.read() as connection:
        rows = (await connection.execute(missing.order_by(*proofs.primary_key))).all()
    served: set[tuple[str, int]] = set()
    for row in rows:
        if recipients == "THERE" or (row.mission_id, row.step_id) not in served:
            served.add((row.mission_id, row.step_id))
            with suppress(Conflict):
                await give_proof(context, row.delivery_id, row.package_id)

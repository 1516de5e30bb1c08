"""The rules of proofs: who asks for one gets it, and a proof is one that its step awaits."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from skyway_composition.tables import custody, mission_steps, missions, proofs
from sqlalchemy import and_, select

from skyway_verifier.composition.calendars import owners
from skyway_verifier.composition.steps import step_json
from skyway_verifier.finders import each_where, readable
from skyway_verifier.rule import Rule, Survey


@dataclass(slots=True)
class DeliveredPackage:
    """A package that its recipient has: who brought it, its proof as asked, and whether it came."""

    mission_id: str
    asked: str | None = None
    is_proven: bool = False


async def _delivered(survey: Survey) -> Mapping[tuple[str, str], DeliveredPackage]:
    """The packages that were delivered, by delivery and package."""
    owner_of = await survey.once(owners)
    by_mission = and_(
        custody.c.mission_id == missions.c.mission_id, custody.c.custodian_kind == "RECIPIENT"
    )
    found: dict[tuple[str, str], DeliveredPackage] = {}
    columns = custody.c.delivery_id, custody.c.package_id, missions.c.mission_id, missions.c.request
    async for row in survey.each(select(*columns).where(by_mission)):
        package = found[row.delivery_id, row.package_id] = DeliveredPackage(row.mission_id)
        for flying_id, method in (readable(None, _asked, row.request) or {}).items():
            owner = owner_of.get((row.mission_id, flying_id), (row.delivery_id, flying_id))
            if owner == (row.delivery_id, row.package_id):
                package.asked = method
    given = select(proofs).where(proofs.c.given_ms.is_not(None))
    async for row in survey.each(given):
        delivered = found.get((row.delivery_id, row.package_id))
        if delivered is not None and delivered.mission_id == row.mission_id:
            delivered.is_proven |= delivered.asked == row.method
    return found


def _asked(request: str) -> dict[str, str]:
    """By package: the proof that it asks for."""
    return {
        each["package_id"]: each["dropoff_verification"]["method"]
        for each in json.loads(request)["packages"]
        if each.get("dropoff_verification")
    }


async def _not_awaited(survey: Survey) -> list[str]:
    """Proofs of packages that their step delivers without such a proof, or of somebody else."""
    owner_of = await survey.once(owners)
    at_step = and_(
        proofs.c.mission_id == mission_steps.c.mission_id,
        proofs.c.step_id == mission_steps.c.step_id,
    )
    columns = (*proofs.c, mission_steps.c.step, missions.c.delivery_id.label("host_id"))
    joined = proofs.outerjoin(mission_steps, at_step).join(
        missions, missions.c.mission_id == proofs.c.mission_id
    )
    return [
        f"{row.mission_id}/{row.step_id}/{row.flying_id}"
        async for row in survey.each(select(*columns).select_from(joined))
        if _awaited(row).get(row.flying_id) != row.method
        or owner_of.get((row.mission_id, row.flying_id), (row.host_id, row.flying_id))
        not in (None, (row.delivery_id, row.package_id))
    ]


def _awaited(row: Any) -> dict[str, str]:  # a row of proofs with its step
    """By package: the proof that the step awaits."""
    step = step_json(row) or {}
    return {each["package_id"]: each["method"] for each in step.get("verification", ())}


PROOFS: Final[tuple[Rule, ...]] = (
    Rule(
        "I6 a package that asks for a proof is delivered only with one",
        each_where(_delivered, lambda package: package.asked is not None and not package.is_proven),
        "Ask the recipient whether the package has come. Its provider's drone was believed "
        "wrongly, or a row of `proofs` was deleted: the gateway's `proofs` say who gave the proof.",
    ),
    Rule(
        "I6 a proof is one that its step awaits",
        _not_awaited,
        "A row of `proofs` was changed. Its step in `mission_steps` says which package needs which "
        "proof.",
    ),
)

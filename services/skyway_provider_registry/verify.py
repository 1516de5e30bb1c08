"""The invariants of the registry's database; each violation is printed as one JSON line."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from sqlalchemy import Select, select

from skyway.drone.models import DRONE_MODELS
from skyway.runtime.sql.database import Database
from skyway_provider_registry.tables import (
    broker_accounts,
    drone_models,
    drones,
    presence,
)

_is_drone_account = broker_accounts.c.kind == "DRONE"

#: Each invariant as a sentence, and the query for the subjects that violate it.
_CHECKS: Final[Mapping[str, Select[*tuple[Any, ...]]]] = {
    "every drone has a broker account": select(drones.c.drone_id).where(
        drones.c.drone_id.not_in(select(broker_accounts.c.user_name).where(_is_drone_account))
    ),
    "every drone's broker account has a drone": select(broker_accounts.c.user_name).where(
        _is_drone_account, broker_accounts.c.user_name.not_in(select(drones.c.drone_id))
    ),
    "every drone has one presence": select(drones.c.drone_id).where(
        drones.c.drone_id.not_in(select(presence.c.drone_id))
    ),
    "every presence has a drone": select(presence.c.drone_id).where(
        presence.c.drone_id.not_in(select(drones.c.drone_id))
    ),
    "every drone has an existing model": select(drones.c.drone_id).where(
        drones.c.model_id.not_in(select(drone_models.c.model_id)),
        drones.c.model_id.not_in(list(DRONE_MODELS)),
    ),
}


async def violations(db: Database) -> Sequence[Mapping[str, str]]:
    """Each violation: the broken rule, and its subject."""
    found: list[Mapping[str, str]] = []
    async with db.survey() as connection:
        for rule, statement in _CHECKS.items():
            subjects = (await connection.execute(statement)).scalars()
            found.extend({"rule": rule, "subject": str(subject)} for subject in subjects)
    return found

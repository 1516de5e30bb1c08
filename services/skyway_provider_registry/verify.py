"""The invariants of the registry's database; each violation is printed as one JSON line."""

from typing import Final

from sqlalchemy import select

from skyway.drone.models import DRONE_MODELS
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.violations import Rules, Violation, check_of, violations_found
from skyway_provider_registry.tables import (
    broker_accounts,
    drone_models,
    drones,
    presence,
)

_is_drone_account = broker_accounts.c.kind == "DRONE"

#: Each invariant as a sentence, and the query for the subjects that violate it.
_RULES: Final[Rules] = {
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


_CHECK: Final = check_of(_RULES)


async def violations(db: Database) -> list[Violation]:
    """Each violation: the broken rule, and its subject."""
    async with db.survey() as connection:
        return await violations_found(connection, _CHECK)

"""Each broken invariant is found; a check that cannot fail is not a check."""

from typing import Any

import pytest
from skyway_provider_registry.tables import broker_accounts, drones, learned_values, presence
from skyway_verifier.registry.rules import RULES
from sqlalchemy import Executable, delete, insert, update

from skyway.broker_setup.passwords import hash_password
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules

_LEARNED = "what was learned about a drone is within its bounds"


def _learned(**changes: float) -> dict[str, object]:
    """What one flight has shown about the drone."""
    return {
        "drone_id": "drn_000001",
        "flights": 1,
        "recharges": 0,
        "still_air_factor": 1.0,
        "state_of_health": 1.0,
        "charge_rate_factor": 1.0,
        "learned_session": 1,
        "learned_seq": 1,
        "is_maintenance_due": False,
        "learned_ms": 1,
        "since_ms": 0,
        **changes,
    }


BREAKS: dict[str, tuple[Executable, str]] = {
    "every drone has a broker account": (delete(broker_accounts), "drn_000001"),
    "every drone's broker account has a drone": (
        insert(broker_accounts).values(
            user_name="drn_9", kind="DRONE", password_hash=hash_password("secret")
        ),
        "drn_9",
    ),
    "every drone has one presence": (delete(presence), "drn_000001"),
    _LEARNED: (insert(learned_values).values(_learned(still_air_factor=2.5)), "drn_000001"),
    "every drone has an existing model": (update(drones).values(model_id="gone"), "drn_000001"),
}


@pytest.mark.databases("sqlite")
@pytest.mark.parametrize("rule", BREAKS)
async def test_a_broken_rule_is_found(api: Any, db: Database, rule: str) -> None:
    await api.drone(await api.provider())
    statement, subject = BREAKS[rule]

    async with db.write() as tx:
        await tx.execute(statement)

    assert await broken_rules(db, RULES) == [(rule, subject)]


async def test_an_impossible_variance_of_the_energy_use_is_found(api: Any, db: Database) -> None:
    await api.drone(await api.provider())

    async with db.write() as tx:
        await tx.execute(insert(learned_values).values(_learned(still_air_variance=0.1)))

    assert await broken_rules(db, RULES) == [(_LEARNED, "drn_000001")]


async def test_a_sound_database_breaks_no_rule(api: Any, db: Database) -> None:
    await api.drone(await api.provider())
    await api(None, "PUT", "/internal/broker-accounts/ann", {"password": "x" * 32})

    assert await broken_rules(db, RULES) == []

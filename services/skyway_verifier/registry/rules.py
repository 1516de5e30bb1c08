"""All rules of the registry's database, and its facts for other services' facts.

The rules here are those of drones and their accounts, and of hints and change numbers, by which
candidates are selected. `drones` has the other rules of drones.
"""

from typing import Final

from skyway_provider_registry.change_store import ONLY_ROW
from skyway_provider_registry.presence.drone_presence import Condition
from skyway_provider_registry.tables import (
    broker_accounts,
    changes,
    drone_keys,
    drone_models,
    drone_signing_keys,
    drones,
    enrolment_tokens,
    idempotency,
    metadata,
    mission_hints,
    presence,
    providers,
    renewals,
    replicas,
    revoked_certificates,
    waiting_alarms,
)
from sqlalchemy import and_, func, literal, or_, select

from skyway.broker_setup.nats_accounts import is_nats_hash
from skyway.broker_setup.passwords import read_hash
from skyway.contracts.drones import DroneAlarm
from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.delivery.offer import Tariff
from skyway.drone.model import DroneModel
from skyway.drone.models import DRONE_MODELS
from skyway.runtime.signing.key_pair import public_key_bytes
from skyway_verifier.facts import CopyFacts, Facts, HintFacts
from skyway_verifier.finders import any_of
from skyway_verifier.registry.drones import DRONE_RULES, is_outside
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import (
    form_rule,
    read_fernet_token,
    read_sha256,
    replica_rule,
    storage_rules,
)

_is_drone_account = broker_accounts.c.kind == "DRONE"

_newest_change = select(func.coalesce(func.max(presence.c.changed), 0)).scalar_subquery()
_rows = select(func.count()).select_from(changes).scalar_subquery()

_SETTLES: Final = (
    "Composition decides which drones are busy (GET /v1/missions?drone_id=...). Set `is_live` and "
    "`mission_state` to the state of the mission there, and `presence.changed` of the drone to a "
    "new number of `changes.latest`."
)

_HINTS: Final = (
    Rule(
        "a hint is live while its mission is",
        select(mission_hints.c.mission_id).where(
            mission_hints.c.is_live != mission_hints.c.mission_state.in_(LIVE_MISSION_STATES)
        ),
        _SETTLES,
    ),
    Rule(
        "a hint says when, where and with what charge its drone is free, or nothing",
        any_of(
            mission_hints.c.mission_id,
            mission_hints.c.free_ms.is_(None) != mission_hints.c.free_station_id.is_(None),
            mission_hints.c.free_ms.is_(None) != mission_hints.c.free_soc.is_(None),
            ~mission_hints.c.free_soc.between(0, 1),
        ),
        "Set `free_ms`, `free_station_id` and `free_soc` to NULL: the drone counts as busy until "
        "the mission's next report, or its end.",
    ),
    Rule(
        "the change numbers are not behind the changes",
        select(literal("changes")).where(
            or_(
                and_(_newest_change > 0, _rows == 0),
                select(func.count())
                .select_from(changes)
                .where(
                    or_(
                        changes.c.only != ONLY_ROW,
                        changes.c.latest < _newest_change,
                        changes.c.latest < changes.c.providers,
                        changes.c.latest < changes.c.removals,
                    )
                )
                .scalar_subquery()
                > 0,
            )
        ),
        "Readers that have seen a larger number miss all changes up to it. Set `changes.latest` to "
        "more than every `presence.changed`, and restart the registry.",
    ),
)


def _read_password_hash(hashed: str) -> None:
    """Read a hash for one of the brokers; ValueError if it is for none."""
    if not is_nats_hash(hashed):
        read_hash(hashed)


_FORMS: Final = form_rule(
    {
        providers.c.tariff: Tariff.read,
        drone_models.c.model: DroneModel.read,
        presence.c.condition: Condition.read,
        waiting_alarms.c.alarm: DroneAlarm.read,
        broker_accounts.c.password_hash: _read_password_hash,
        enrolment_tokens.c.token_hash: read_sha256,
        drone_keys.c.key_hash: read_sha256,
        revoked_certificates.c.key_hash: read_sha256,
        drone_keys.c.next_key_hash: read_sha256,
        drone_keys.c.next_password_hash: _read_password_hash,
        drone_signing_keys.c.public_key: public_key_bytes,
        drone_signing_keys.c.next_public_key: public_key_bytes,
        idempotency.c.key_hash: read_sha256,
        idempotency.c.answer: read_fernet_token,
    }
)


_DRONES: Final = (
    Rule(
        "every drone has a broker account",
        select(drones.c.drone_id).where(
            drones.c.drone_id.not_in(select(broker_accounts.c.user_name).where(_is_drone_account))
        ),
        "The broker refuses the drone. Give it a new enrolment token (POST "
        "/v1/providers/{id}/drones/{id}/enrolment): enrolling opens an account, once its row "
        "exists: restore the row of `broker_accounts` from a backup first.",
    ),
    Rule(
        "every drone's broker account has a drone",
        select(broker_accounts.c.user_name).where(
            _is_drone_account, broker_accounts.c.user_name.not_in(select(drones.c.drone_id))
        ),
        "If the drone was removed, delete the row of `broker_accounts`. If not, restore the drone "
        "with its presence from a backup.",
    ),
    Rule(
        "every drone has one presence",
        select(drones.c.drone_id).where(drones.c.drone_id.not_in(select(presence.c.drone_id))),
        "Restore the row of `presence` from a backup; the drone's next messages fill it again.",
    ),
    Rule(
        "every presence has a drone",
        select(presence.c.drone_id).where(presence.c.drone_id.not_in(select(drones.c.drone_id))),
        "If the drone was removed, delete the row of `presence`. If not, restore the drone.",
    ),
    Rule(
        "every drone has an existing model",
        select(drones.c.drone_id).where(
            drones.c.model_id.not_in(select(drone_models.c.model_id)),
            drones.c.model_id.not_in(list(DRONE_MODELS)),
        ),
        "Add the model again (PUT /v1/drone-models/{id}), with the values that the missions of the "
        "drone show in composition's `missions.candidate`.",
    ),
    Rule(
        "a drone's model is its provider's own or in the catalogue",
        select(drones.c.drone_id)
        .join(drone_models, drone_models.c.model_id == drones.c.model_id)
        .where(drone_models.c.provider_id != drones.c.provider_id),
        "Approve the model: an operator sends it again (PUT /v1/drone-models/{id}).",
    ),
    Rule(
        "a drone's charge and place are possible",
        any_of(
            presence.c.drone_id,
            ~presence.c.soc.between(0, 1),
            presence.c.ahead_m < 0,
            presence.c.ahead_soc < 0,
            is_outside(presence.c.longitude_deg, presence.c.latitude_deg),
            is_outside(presence.c.sample_longitude_deg, presence.c.sample_latitude_deg),
            ~presence.c.sample_soc.between(0, 1),
            (presence.c.activity.is_(None)) != (presence.c.state_at_ms.is_(None)),
            and_(
                presence.c.activity.is_not(None),
                # A sum is null if any of its parts is.
                (presence.c.longitude_deg + presence.c.latitude_deg + presence.c.soc).is_(None),
            ),
        ),
        "The drone's next state fills the row again. Set `state_session` and `state_seq` to -1, "
        "so that it is accepted.",
    ),
    Rule(
        "a drone's home is on earth, and its first charge possible",
        any_of(
            drones.c.drone_id,
            is_outside(drones.c.home_longitude_deg, drones.c.home_latitude_deg),
            ~drones.c.initial_soc.between(0, 1),
        ),
        "Set the home to the place of the station `home_station_id`: see GET /v1/networks.",
    ),
    Rule(
        "no certificate is revoked whose key is in use",
        select(revoked_certificates.c.user_name).join(
            drone_keys,
            revoked_certificates.c.key_hash.in_(
                (drone_keys.c.key_hash, drone_keys.c.next_key_hash)
            ),
        ),
        "Mosquitto refuses the drone. Delete the row of `revoked_certificates`.",
    ),
)


#: The most important rules first: those of storage say whether the others can be believed.
RULES: Final[tuple[Rule, ...]] = (
    replica_rule(replicas),
    *storage_rules(metadata),
    _FORMS,
    *_DRONES,
    *DRONE_RULES,
    *_HINTS,
)


async def read_facts(survey: Survey) -> Facts:
    """The facts of the registry's database."""
    own = await survey.rows(select(drones.c.drone_id, drones.c.provider_id))
    return Facts(
        hints={
            row.mission_id: HintFacts(
                *(row.mission_id, row.drone_id, row.mission_state, row.is_live), report_seq=row.seq
            )
            async for row in survey.each(select(mission_hints))
        },
        drones={(row[0], row[1]): row.drone_id for row in own},
        providers={row[0]: row[0] for row in await survey.rows(select(providers.c.provider_id))},
        copies={
            (key := f"renewal {row.drone_id}"): CopyFacts(key, row.renewed_ms)
            for row in await survey.rows(select(renewals))
        },
    )

"""All rules of the registry's database."""

from typing import Final

from skyway.broker_setup.passwords import read_hash
from skyway.delivery.offer import Tariff
from skyway.drone.model import DroneModel
from skyway.runtime.verification.hash_forms import read_fernet_token, read_sha256
from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.storage_rules import storage_rules
from skyway.runtime.verification.stored_forms import form_rule
from skyway_provider_registry.presence.drone_presence import Condition
from skyway_provider_registry.tables import (
    broker_accounts,
    drone_keys,
    drone_models,
    enrolment_tokens,
    idempotency,
    metadata,
    presence,
    providers,
)
from skyway_provider_registry.verify.drones import DRONES
from skyway_provider_registry.verify.hints import HINTS

_FORMS: Final = form_rule(
    {
        providers.c.tariff: Tariff.read,
        drone_models.c.model: DroneModel.read,
        presence.c.condition: Condition.read,
        broker_accounts.c.password_hash: read_hash,
        enrolment_tokens.c.token_hash: read_sha256,
        drone_keys.c.key_hash: read_sha256,
        drone_keys.c.next_key_hash: read_sha256,
        drone_keys.c.next_password_hash: read_hash,
        idempotency.c.key_hash: read_sha256,
        idempotency.c.answer: read_fernet_token,
    }
)

#: The most important rules first: those of storage say whether the others can be believed.
RULES: Final[tuple[Rule, ...]] = (*storage_rules(metadata), _FORMS, *DRONES, *HINTS)

"""Corruptions of the gateway's database: calls, their stored answers, keys, login links."""

from typing import Final

from tests.verification.damaged_copies import Corruption

_AUDIT_CHANGED: Final = "the audit log has every entry as it was written"

_KEYS: Final = "whose deliveries, webhooks, branding and calls are stored has a key, or had one"

ACCESS_CORRUPTIONS: Final = (
    Corruption(
        "an entry of the audit log changed",
        _AUDIT_CHANGED,
        gateway="UPDATE audit SET subject_id = 'somebody' WHERE number = 2",
    ),
    Corruption(
        "an entry of the audit log deleted",
        _AUDIT_CHANGED,
        gateway="DELETE FROM audit WHERE number = 3",
    ),
    Corruption(
        "the last entry of the audit log deleted",
        _AUDIT_CHANGED,
        gateway="DELETE FROM audit WHERE number = (SELECT max(number) FROM audit)",
    ),
    Corruption(
        "the last entry of the audit log deleted, and the number too",
        _AUDIT_CHANGED,
        gateway="DELETE FROM audit WHERE number = (SELECT max(number) FROM audit);"
        " UPDATE audit_head SET entries = entries - 1",
    ),
    Corruption(
        "the head of the audit log deleted",
        _AUDIT_CHANGED,
        gateway="DELETE FROM audit_head",
    ),
    Corruption(
        "a stored answer deleted",
        "I9 a request that was accepted under a key has its stored answer",
        gateway="DELETE FROM idempotency WHERE location = '/v1/deliveries/' || :flying",
    ),
    Corruption(
        "a stored answer about a delivery that is gone",
        "I9 a stored answer is about a delivery that exists",
        gateway="UPDATE idempotency SET location = '/v1/deliveries/dlv_gone'"
        " WHERE location = '/v1/deliveries/' || :waiting",
    ),
    Corruption(
        "a stored answer cut",
        "every stored text has its form",
        gateway="UPDATE idempotency SET answer = substr(answer, 1, 30)",
    ),
    Corruption(
        "the hash of a key cut",
        "every stored text has its form",
        gateway="UPDATE api_keys SET key_hash = substr(key_hash, 1, 20) WHERE role = 'customer'",
    ),
    Corruption(
        "the hash of a login link cut",
        "every stored text has its form",
        gateway="UPDATE session_links SET code_hash = substr(code_hash, 1, 20)",
    ),
    Corruption(
        "a login link that never ends",
        "every moment and number is one that Skyway writes",
        gateway="UPDATE session_links SET expires_wall_ms = 9223372036854775807",
    ),
    Corruption(
        "the key of a customer deleted",
        _KEYS,
        gateway="DELETE FROM api_keys WHERE role = 'customer'",
    ),
    Corruption(
        "a key with a scope that does not exist",
        "every stored text has its form",
        gateway="UPDATE api_keys SET scopes = '[\"everything:write\"]' WHERE role = 'customer'",
    ),
    Corruption(
        "an operator's key that replaces a customer's",
        "a key that was rotated has the rights of the key that it replaces",
        gateway="UPDATE api_keys SET replaces_key_id = 'key_of_nobody' WHERE role = 'operator'",
    ),
    Corruption(
        "a key that goes on after its rotation",
        "a key ends when the key that replaces it is first used",
        gateway="UPDATE api_keys SET replaces_key_id = key_id WHERE role = 'customer'",
    ),
    Corruption(
        "a key without an end after its expiry",
        "a key does not end after its expiry",
        gateway="UPDATE api_keys SET expires_wall_ms = 1 WHERE role = 'customer'",
    ),
    Corruption(
        "the key of an operator deleted",
        _KEYS,
        gateway="DELETE FROM api_keys WHERE role = 'operator'",
    ),
)

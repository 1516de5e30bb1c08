"""Newer corruptions of keys, sessions, links and personal data, and of drones' credentials."""

from typing import Final

from tests.verification.damaged_copies import Corruption

_HOUR_MS: Final = 3_600_000
_DAY_MS: Final = 24 * _HOUR_MS
_WALL: Final = "what is stored as past is past, by wall time"
_KEY: Final = "a key was made, and is deleted, as the audit log says"
_LOGIN: Final = "a session or login link lasts no longer than its span, and its begin was logged"
_LINK: Final = "a tracking link was renewed and withdrawn as the audit log says"
_SIGNS: Final = "a drone that has ever signed has the row of its key"
_FITS: Final = "a drone's token, key and account fit one another"


def in_future(table: str, column: str, where: str = "", *, days: int = 400) -> str:
    """SQL that moves a column of all or some rows far ahead."""
    value = f"max(coalesce({column}, 0), 1795800000000) + {days * _DAY_MS}"
    return f"UPDATE {table} SET {column} = {value} {where}"


_ACCESS: Final = (
    Corruption(
        "a customer's key made an operator's",
        _KEY,
        gateway="UPDATE api_keys SET role = 'operator', subject_id = 'mallory', scopes = NULL"
        " WHERE subject_id = 'river-books'",
    ),
    Corruption(
        "a customer's key made the first operator's",
        _KEY,
        gateway="UPDATE api_keys SET role = 'operator', subject_id = 'operator', scopes = NULL"
        " WHERE subject_id = 'river-books'",
    ),
    Corruption(
        "a key with more scopes than it was given",
        _KEY,
        gateway="UPDATE api_keys SET scopes = NULL WHERE subject_id = 'river-books'",
    ),
    Corruption(
        "a deleted key in use again",
        _KEY,
        gateway="UPDATE api_keys SET deleted_wall_ms = NULL WHERE subject_id = 'lee'",
    ),
    Corruption(
        "a key that nobody made",
        _KEY,
        gateway="INSERT INTO api_keys (key_id, key_hash, role, subject_id, created_wall_ms,"
        " is_account_open) SELECT 'key_x', lower(hex(zeroblob(32))), 'operator', 'mallory',"
        " created_wall_ms, 1 FROM api_keys WHERE subject_id = 'river-books'",
    ),
    Corruption(
        "the row of a key deleted",
        _KEY,
        gateway="DELETE FROM api_keys WHERE subject_id = 'river-books'",
    ),
    Corruption(
        "a key made an hour earlier than its call",
        _KEY,
        gateway=f"UPDATE api_keys SET created_wall_ms = created_wall_ms - {_HOUR_MS}"
        " WHERE subject_id = 'river-books'",
    ),
    Corruption(
        "a provider's key given to a provider that is not registered",
        "a provider that has a key is registered",
        gateway="UPDATE api_keys SET subject_id = 'prv_other' WHERE role = 'provider'",
    ),
    Corruption(
        "a key made next year",
        _WALL,
        gateway=in_future("api_keys", "created_wall_ms", "WHERE role = 'customer'"),
    ),
    Corruption(
        "a session that lasts for a week",
        _LOGIN,
        gateway=f"UPDATE sessions SET expires_wall_ms = expires_wall_ms + {7 * _DAY_MS}",
    ),
    Corruption(
        "a session that lasts for an hour longer",
        _LOGIN,
        gateway=f"UPDATE sessions SET expires_wall_ms = expires_wall_ms + {_HOUR_MS}",
    ),
    Corruption(
        "a session that nobody began",
        _LOGIN,
        gateway="INSERT INTO sessions SELECT lower(hex(zeroblob(32))), key_id,"
        " (SELECT max(at_wall_ms) FROM audit) + 43200000 - 600000 FROM api_keys"
        " WHERE subject_id = 'operator'",
    ),
    Corruption(
        "the session of an operator given to a provider's key",
        _LOGIN,
        gateway="UPDATE sessions SET key_id = (SELECT key_id FROM api_keys"
        " WHERE role = 'provider' LIMIT 1)",
    ),
    Corruption(
        "a login link that lasts for a day",
        _LOGIN,
        gateway=f"UPDATE session_links SET expires_wall_ms = expires_wall_ms + {_DAY_MS}",
    ),
    Corruption(
        "a login link of another key",
        _LOGIN,
        gateway="UPDATE session_links SET key_id = (SELECT key_id FROM api_keys"
        " WHERE role = 'provider' LIMIT 1)",
    ),
    Corruption(
        "the withdrawal of a tracking link undone",
        _LINK,
        gateway="UPDATE tracking_links SET is_withdrawn = 0",
    ),
    Corruption(
        "the row of a withdrawn tracking link deleted",
        _LINK,
        gateway="DELETE FROM tracking_links WHERE is_withdrawn",
    ),
    Corruption(
        "the row of a renewed tracking link deleted",
        _LINK,
        gateway="DELETE FROM tracking_links WHERE number > 1",
    ),
    Corruption(
        "a tracking link set back to its first number",
        _LINK,
        gateway="UPDATE tracking_links SET number = 1 WHERE delivery_id = :completed",
    ),
    Corruption(
        "a tracking link withdrawn by nobody",
        _LINK,
        gateway="INSERT INTO tracking_links VALUES (:waiting, 1, 1)",
    ),
)

_SIGNING: Final = (
    Corruption(
        "the signing key of a drone deleted",
        _SIGNS,
        registry="DELETE FROM drone_signing_keys WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a drone that need not sign any more",
        _SIGNS,
        registry="UPDATE drone_signing_keys SET is_required = 0, public_key = NULL"
        " WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a drone that has never signed, as its own row says",
        _SIGNS,
        registry="UPDATE drones SET is_signing = 0 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "the token of a drone deleted, as if its credentials had been revoked",
        _FITS,
        registry="DELETE FROM enrolment_tokens WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a token used by a drone without a key",
        _FITS,
        registry="UPDATE enrolment_tokens SET used_wall_ms = 5 WHERE drone_id = :flying_drone",
    ),
    Corruption(
        "a blocked drone that kept its key",
        _FITS,
        registry="UPDATE broker_accounts SET revoked_wall_ms = 5 WHERE user_name = :flying_drone;"
        " INSERT INTO drone_keys VALUES (:flying_drone, lower(hex(zeroblob(32))), NULL, NULL)",
    ),
    Corruption(
        "a next key without a password",
        _FITS,
        registry="INSERT INTO drone_keys VALUES (:flying_drone, lower(hex(zeroblob(32))),"
        " lower(hex(zeroblob(32))), NULL)",
    ),
    Corruption(
        "an enrolment token that lasts for a year",
        "an enrolment token lasts no longer than its span",
        registry=in_future("enrolment_tokens", "expires_wall_ms"),
    ),
    Corruption(
        "an account blocked next year",
        _WALL,
        registry=in_future("broker_accounts", "revoked_wall_ms", "WHERE user_name = :silent_drone"),
    ),
)

_PERSONAL: Final = (
    Corruption(
        "personal data that was never erased",
        "personal data is erased in time",
        gateway=f"UPDATE deliveries SET created_ms = created_ms - {40 * _DAY_MS},"
        f" updated_ms = updated_ms - {40 * _DAY_MS} WHERE delivery_id = :completed;"
        f" UPDATE personal_data SET due_ms = due_ms - {40 * _DAY_MS}",
    ),
    Corruption(
        "personal data that is kept for a thousand years",
        "personal data is kept for a time that can be promised",
        gateway=f"UPDATE personal_data SET due_ms = due_ms + {365_000 * _DAY_MS}",
    ),
    Corruption(
        "personal data of a delivery that does not exist",
        "every row that is referred to exists",
        gateway="UPDATE personal_data SET delivery_id = 'no_' || delivery_id",
    ),
    Corruption(
        "personal data erased next year",
        "what is stored as past is past, by fleet time",
        gateway="UPDATE personal_data SET details = NULL,"
        f" erased_ms = 1795800000000 + {400 * _DAY_MS}",
    ),
    Corruption(
        "half of the personal data",
        "every stored text has its form",
        gateway="UPDATE personal_data SET details = substr(details, 1, 9)",
    ),
)

_PROOF: Final = (
    "INSERT INTO proofs (delivery_id, package_id, method, pin, given_by, given_ms, due_ms)"
    " SELECT delivery_id, package_id, 'PIN', {values} FROM packages"
    " WHERE delivery_id = :completed LIMIT 1"
)
_OLD: Final = (
    f"; UPDATE deliveries SET created_ms = created_ms - {9 * _DAY_MS},"
    f" updated_ms = updated_ms - {9 * _DAY_MS} WHERE delivery_id = :completed"
)
_PROOFS: Final = (
    Corruption(
        "a proof that nobody has asked for",
        "a package has the proof that its request asks for",
        gateway=_PROOF.format(values="NULL, 'KEYPAD', 5, NULL"),
    ),
    Corruption(
        "a package delivered without its proof",
        "a package that needs a proof is delivered with one",
        gateway=_PROOF.format(values="NULL, NULL, NULL, NULL"),
    ),
    Corruption(
        "a PIN of no use that was never erased",
        "the PIN of a hand-over is erased in time",
        gateway=_PROOF.format(values="'4711', NULL, NULL, NULL") + _OLD,
    ),
    Corruption(
        "a picture that was never erased",
        "the picture of a hand-over is erased in time",
        gateway=_PROOF.format(values="NULL, 'DRONE', 5, 5"),
    ),
)

ACCESS_AND_SIGNING: Final = (*_ACCESS, *_SIGNING, *_PERSONAL, *_PROOFS)

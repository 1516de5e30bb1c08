"""The rules of API keys: a rotation gives no more rights, and ends the key that it replaces."""

from typing import Final

from sqlalchemy import and_, exists, select

from skyway.runtime.verification.rule import Rule
from skyway_gateway.tables import api_keys

_replaced = api_keys.alias("replaced")

_is_replaced = _replaced.c.key_id == api_keys.c.replaces_key_id

_SAME: Final = and_(
    *(
        _replaced.c[name].is_not_distinct_from(api_keys.c[name])
        for name in ("role", "subject_id", "name", "scopes", "expires_wall_ms")
    )
)

API_KEYS: Final = (
    Rule(
        "a key that was rotated has the rights of the key that it replaces",
        select(api_keys.c.key_id).where(
            api_keys.c.replaces_key_id.is_not(None), ~exists().where(_is_replaced, _SAME)
        ),
        "Somebody has changed a row of `api_keys`: the key may allow more than its holder was "
        "given. Delete the key, and make another one: POST /v1/keys.",
    ),
    Rule(
        "a key ends when the key that replaces it is first used",
        select(api_keys.c.key_id).where(
            ~api_keys.c.is_next, exists().where(_is_replaced, _replaced.c.deleted_wall_ms.is_(None))
        ),
        "Two keys of one rotation are in use, and the old one may be known to others. Delete the "
        "key that `replaces` names: DELETE /v1/keys/{key_id}.",
    ),
    Rule(
        "a key does not end after its expiry",
        select(api_keys.c.key_id).where(
            api_keys.c.expires_wall_ms.is_not(None),
            api_keys.c.ends_wall_ms.is_(None)
            | (api_keys.c.ends_wall_ms > api_keys.c.expires_wall_ms),
        ),
        "Somebody has changed a row of `api_keys`. Delete the key, and make another one: POST "
        "/v1/keys.",
    ),
)

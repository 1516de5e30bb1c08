"""The rules of calls: keys, the audit log, and the stored answers of accepted requests.

A rotation of a key gives no more rights, and ends the key that it replaces.
"""

import json
from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import Any, Final

from skyway_gateway.access.api_key import KeyRequest, NewKey
from skyway_gateway.access.audit_store import UNKNOWN, entry_hash
from skyway_gateway.access.audit_trail import TRACKING_LINK
from skyway_gateway.access.keys import FIRST_HOLDERS
from skyway_gateway.access.login_codes import CODE_LASTS
from skyway_gateway.access.session_store import SESSION_LASTS
from skyway_gateway.delivery_tables import deliveries
from skyway_gateway.tables import (
    api_keys,
    audit,
    audit_head,
    brandings,
    events,
    idempotency,
    session_links,
    sessions,
    tracking_links,
    webhooks,
)
from skyway_gateway.tracking_links import FIRST_LINK
from sqlalchemy import Column, ColumnElement, and_, exists, func, or_, select, true

from skyway.runtime.idempotency_store import KEPT_MS
from skyway.units import NEVER_MS, moment_to_ms
from skyway_verifier.finders import readable
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import name_of, union_of

#: Answers are deleted when they are a day old; a look at that moment may find them or not. Wall ms.
_SWEPT_WITHIN_MS: Final = 600_000


async def _changed_entries(survey: Survey) -> list[str]:
    """The entries of the audit log that do not follow the entry before them."""
    found: list[str] = []
    heads = await survey.rows(select(audit_head))
    # The oldest entries may have been deleted because of their age.
    number, chained = (heads[0].pruned_entries, heads[0].pruned_hash) if heads else (0, "")
    async for row in survey.each(select(audit).order_by(audit.c.number)):
        if row.number != number + 1:
            found.append(f"entries {number + 1} to {row.number - 1}")
        elif row.hash != entry_hash(chained, row._asdict()):
            found.append(f"entry {row.number} {row.entry_id}")
        number, chained = row.number, row.hash
    if [(number, chained)] != [(head.entries, head.hash) for head in heads]:
        found.append(f"entries after {number}")
    return found


async def _lost_answers(survey: Survey) -> set[str]:
    since_ms = survey.wall_ms - KEPT_MS + _SWEPT_WITHIN_MS
    unanswered = (
        select(deliveries.c.delivery_id)
        .join(events, events.c.delivery_id == deliveries.c.delivery_id)
        .where(
            deliveries.c.has_idempotency_key,
            events.c.sequence == 1,
            events.c.recorded_wall_ms > since_ms,
            ~exists().where(idempotency.c.location == "/v1/deliveries/" + deliveries.c.delivery_id),
        )
    )
    return {str(row.delivery_id) for row in await survey.rows(unanswered)}


def _without_key(subject: Column[str]) -> ColumnElement[bool]:
    # Deleted keys stay in the table.
    return ~exists().where(api_keys.c.subject_id == subject)


async def _logged(survey: Survey) -> tuple[int, list[Any]]:
    """From when on the audit log is whole, wall ms, and its rows of paths about keys and links."""
    path = audit.c.path
    about = or_(path.like("/v1/keys%"), path.like("/v1/session%"), path.like("%/tracking-link"))
    made = path == "/v1/providers"
    rows = await survey.rows(select(audit).where(or_(about, made)).order_by(audit.c.number))
    oldest = select(func.min(audit.c.at_wall_ms), func.max(audit_head.c.pruned_entries))
    [(first_ms, pruned)] = await survey.rows(
        oldest.select_from(audit_head.outerjoin(audit, true()))
    )
    return (first_ms or survey.wall_ms) if pruned else 0, rows


async def _other_links(survey: Survey) -> list[str]:
    """Deliveries whose tracking link is not what the last logged calls have made of it."""
    since_ms, rows = await survey.once(_logged)
    made: Counter[str] = Counter()
    last: dict[str, str] = {}
    for row in rows:
        if row.status in (201, 204) and row.path.endswith(TRACKING_LINK):
            delivery_id = row.path.split("/")[3]
            made[delivery_id] += row.method == "POST"
            last[delivery_id] = row.method
    stored = {
        row.delivery_id: (row.number, row.is_withdrawn)
        for row in await survey.rows(select(tracking_links))
    }
    known = {row.delivery_id for row in await survey.rows(select(deliveries.c.delivery_id))}
    found = []
    for delivery_id in sorted(known & (stored.keys() | last.keys())):
        number, is_withdrawn = stored.get(delivery_id, (FIRST_LINK, False))
        is_last = delivery_id not in last or is_withdrawn == (last[delivery_id] == "DELETE")
        made_before = number - FIRST_LINK - made[delivery_id]
        if (
            not is_last
            or made_before < 0
            or (made_before > 0 or delivery_id not in last) > (since_ms > 0)
        ):
            found.append(delivery_id)
    return found


CALLS: Final = (
    Rule(
        "a tracking link was renewed and withdrawn as the audit log says",
        _other_links,
        "A link that was withdrawn may be open again. Withdraw it: DELETE "
        "/v1/deliveries/{id}/tracking-link.",
        settles=True,
    ),
    Rule(
        "whose deliveries, webhooks, branding and calls are stored has a key, or had one",
        union_of(
            select(subject).where(_without_key(subject), *conditions)
            for subject, *conditions in (
                (deliveries.c.customer_id,),
                (webhooks.c.customer_id,),
                (brandings.c.customer_id,),
                (audit.c.subject_id, audit.c.role != UNKNOWN),
            )
        ),
        "A row of `api_keys` was deleted or changed, so its owner cannot call. Restore it from a "
        "backup, or make a new key: POST /v1/keys.",
    ),
    Rule(
        "the audit log has every entry as it was written",
        _changed_entries,
        "Somebody has deleted or changed entries of the audit log. Find out who had access to the "
        "database, and restore the table `audit` and `audit_head` from a backup.",
    ),
    Rule(
        "I9 a request that was accepted under a key has its stored answer",
        _lost_answers,
        "The same request under the same key would be accepted again, as a second delivery. "
        "Restore the row of `idempotency` from a backup, or ask the customer not to repeat it.",
    ),
    Rule(
        "I9 a stored answer is about a delivery that exists",
        select(idempotency.c.location).where(
            idempotency.c.location.startswith("/v1/deliveries/"),
            ~exists().where(idempotency.c.location == "/v1/deliveries/" + deliveries.c.delivery_id),
        ),
        "The customer was answered that the delivery was accepted, but it is gone. Restore it from "
        "a backup, or ask the customer to request it again under another key.",
    ),
)


_replaced = api_keys.alias("replaced")

_is_replaced = _replaced.c.key_id == api_keys.c.replaces_key_id

_SAME: Final = and_(
    *(
        _replaced.c[name].is_not_distinct_from(api_keys.c[name])
        for name in ("role", "subject_id", "name", "scopes", "expires_wall_ms")
    )
)

#: A call is logged so long after its effect at most, and clocks may differ. Wall ms.
_LOGGED_WITHIN_MS: Final = 120_000
#: An effect that is younger may not be logged yet. Wall ms.
_LOGGED_SOON_MS: Final = 30_000
_LEAST_BEFORE_MS: Final = 5_000


def _is_logged(at_ms: int, rows: Iterable[Any]) -> bool:
    """Whether one of these rows of the audit log can be the call that had an effect at a moment."""
    return any(
        at_ms - _LEAST_BEFORE_MS <= row.at_wall_ms <= at_ms + _LOGGED_WITHIN_MS for row in rows
    )


def _asked(row: Any) -> NewKey | None:  # a row of the audit log
    """The key that a call asked for; None if the log has only a part of the body."""
    asked = readable(None, KeyRequest.read, row.body or "")
    if asked is None:
        return None
    return readable(None, asked.asked_by, row.role, row.subject_id)


async def _unlike_log(survey: Survey) -> set[str]:
    """Keys that nobody made as they are, and keys that were deleted but are in use."""
    since_ms, rows = await survey.once(_logged)
    # A call that failed may have had its effect before: it is repeated.
    made = [
        (row, _asked(row) if row.path == "/v1/keys" else None)
        for row in rows
        if row.method == "POST" and (row.status == 201 or not 100 < row.status < 500)
    ]
    deleted = {row.path for row in rows if row.method == "DELETE" and row.status == 204}
    found, first_ms = set[str](), dict[tuple[str, str], int]()
    async for key in survey.each(select(api_keys)):
        holder, at_ms = (key.role, key.subject_id), key.created_wall_ms
        first_ms[holder] = min(at_ms, first_ms.get(holder, at_ms))
        is_young = at_ms > survey.wall_ms - _LOGGED_SOON_MS
        is_exempt = is_young or at_ms < since_ms + _LOGGED_WITHIN_MS or holder in FIRST_HOLDERS
        calls = (row for row, asked in made if _fits(key, row.path, asked))
        if not (is_exempt or key.replaces_key_id or _is_logged(at_ms, calls)):
            found.add(key.key_id)
        if key.deleted_wall_ms is None and f"/v1/keys/{key.key_id}" in deleted:
            found.add(key.key_id)
    for row, asked in made:
        if asked is not None and row.status == 201:
            key_ms = first_ms.get((asked.role, asked.subject_id), NEVER_MS)
            if row.at_wall_ms < key_ms - _LEAST_BEFORE_MS:
                found.add(f"key of {asked.role} {asked.subject_id}")
    return found


def _fits(key: Any, path: str, asked: NewKey | None) -> bool:  # a row of api_keys
    """Whether a call can have asked for this key."""
    if path == "/v1/providers":
        return bool(key.role == "provider")
    if asked is None:
        return path == "/v1/keys"
    ends = None if asked.expires_wall_at is None else moment_to_ms(asked.expires_wall_at)
    scopes = None if asked.scopes is None else json.dumps(asked.scopes)
    made = (asked.role, asked.subject_id, asked.name, scopes, ends)
    return made == (key.role, key.subject_id, key.name, key.scopes, key.expires_wall_ms)


async def _unlogged_logins(survey: Survey) -> list[str]:
    """Sessions and login links of operators and providers that they did not begin then."""
    since_ms, rows = await survey.once(_logged)
    begun: dict[tuple[str, str, str], list[Any]] = defaultdict(list)
    for row in rows:
        begun[row.role, row.subject_id, row.path].append(row)
    found = []
    for table, path, lasts in (
        (sessions, "/v1/sessions", SESSION_LASTS),
        (session_links, "/v1/session-links", CODE_LASTS),
    ):
        for login in await survey.rows(select(table, api_keys).join(api_keys)):
            at_ms = login.expires_wall_ms - int(lasts.total_seconds() * 1000)
            is_young = at_ms > survey.wall_ms - _LOGGED_SOON_MS
            is_old = at_ms < since_ms + _LOGGED_WITHIN_MS or login.role == "customer"
            if at_ms > survey.wall_ms + _LOGGED_WITHIN_MS or not (
                is_young or is_old or _is_logged(at_ms, begun[login.role, login.subject_id, path])
            ):
                found.append(name_of(table, login[0]))
    return found


API_KEYS: Final = (
    Rule(
        "a key was made, and is deleted, as the audit log says",
        _unlike_log,
        "Somebody has changed a row of `api_keys`, or its call could not be logged (see the "
        "gateway's log for `audit entry lost`). Delete the key, and make another one: POST "
        "/v1/keys.",
        settles=True,
    ),
    Rule(
        "a session or login link lasts no longer than its span, and its begin was logged",
        _unlogged_logins,
        "Somebody has changed a row of `sessions` or `session_links`, which may let others in. "
        "Delete the row: its holder logs in again.",
        settles=True,
    ),
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

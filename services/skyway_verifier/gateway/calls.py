"""The rules of calls: keys, the audit log, and the stored answers of accepted requests."""

from collections import Counter
from typing import Any, Final

from skyway_gateway.access.audit_store import UNKNOWN, entry_hash
from skyway_gateway.access.audit_trail import TRACKING_LINK
from skyway_gateway.delivery_tables import deliveries
from skyway_gateway.tables import (
    api_keys,
    audit,
    audit_head,
    events,
    idempotency,
    tracking_links,
    webhooks,
)
from skyway_gateway.tracking_links import FIRST_LINK
from sqlalchemy import Column, ColumnElement, exists, func, or_, select, true

from skyway.runtime.idempotency_store import KEPT_MS
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import union_of

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


async def logged(survey: Survey) -> tuple[int, list[Any]]:
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
    since_ms, rows = await survey.once(logged)
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
        "whose deliveries, webhooks and calls are stored has a key, or had one",
        union_of(
            select(subject).where(_without_key(subject), *conditions)
            for subject, *conditions in (
                (deliveries.c.customer_id,),
                (webhooks.c.customer_id,),
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

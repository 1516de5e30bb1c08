"""What a price is made of: line items in whole minor units, whose sum is the price."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Literal

from pydantic import Field

from skyway.json_model import JsonModel

LineKind = Literal[
    "BASE",
    "DISTANCE",
    "MASS",
    "RECHARGING",
    "MINIMUM",
    "PRIORITY",
    "POOLED",
    "CANCELLATION",
    "FAILURE",
    "LATENESS",
    "WAITING",
]


class LineItem(JsonModel):
    """A part of a price; what a customer gets back is negative."""

    kind: Annotated[
        LineKind,
        Field(
            description="BASE, DISTANCE, MASS, RECHARGING: by the tariff. MINIMUM: up to the least "
            "price. PRIORITY: on top, for the class. POOLED: off, for a shared trip. CANCELLATION, "
            "FAILURE, LATENESS: given back for what was cancelled, not delivered, or late. "
            "WAITING: on top, for a drone that waited for the proof of a hand-over."
        ),
    ]
    amount: Annotated[
        int,
        Field(
            ge=-(10**12),
            le=10**12,
            description="Amount in minor units of the price's currency; negative if given back.",
        ),
    ]


def whole_items(parts: Mapping[LineKind, float], total: int) -> tuple[LineItem, ...]:
    """The parts in whole minor units, which sum to `total`; parts of 0 are left out.

    Each part is rounded down. The parts with the largest remainders get one unit more each, until
    the sum is `total`: the sum of the parts, rounded.
    """
    whole = {kind: int(amount) for kind, amount in parts.items()}
    by_remainder = sorted(parts, key=lambda kind: whole[kind] - parts[kind])
    for kind in by_remainder[: total - sum(whole.values())]:
        whole[kind] += 1
    return items_of(whole)


def items_of(amounts: Mapping[LineKind, int]) -> tuple[LineItem, ...]:
    """One item for each amount that is not 0."""
    return tuple(
        LineItem(kind=kind, amount=amount) for kind, amount in amounts.items() if amount != 0
    )


def summed(items: Iterable[LineItem]) -> tuple[LineItem, ...]:
    """One item for each kind, in the order in which the kinds come first."""
    amounts: dict[LineKind, int] = {}
    for item in items:
        amounts[item.kind] = amounts.get(item.kind, 0) + item.amount
    return items_of(amounts)

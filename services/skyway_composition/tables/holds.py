"""The table of offers that are held for a customer until they expire."""

from sqlalchemy import (
    BigInteger,
    CheckConstraint,
    Column,
    Index,
    SmallInteger,
    Table,
    Text,
    UniqueConstraint,
)

from skyway_composition.tables.metadata import metadata

#: One row for each quote whose offers are held, and for each offer that is being accepted. Its pads
#: are in `pad_reservations`, its drones are marked in `drone_links`.
offer_holds = Table(
    "offer_holds",
    metadata,
    Column("hold_id", Text, primary_key=True),
    Column("customer_id", Text, nullable=False),
    # Numbers the holds of a customer from 1 to its limit; null for an offer that is being accepted.
    Column("slot", SmallInteger),
    Column("until_ms", BigInteger, nullable=False),  # from then on nothing is held
    Column("offers", Text, nullable=False),  # JSON list of missions.booking.held_offer.HeldOffer
    UniqueConstraint("customer_id", "slot", name="hold_slot"),
    CheckConstraint("slot >= 1", name="hold_slot_counts"),
    Index("offer_holds_by_end", "until_ms"),
)

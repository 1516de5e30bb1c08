"""The table of what the dispatcher's orders have saved."""

from typing import Final

from sqlalchemy import BigInteger, Column, Integer, Table, Text

from skyway_composition.tables.networks import metadata

#: A day of fleet time, milliseconds.
DAY_MS: Final = 24 * 3600 * 1000

#: The better orders of a provider that were adopted on a day of fleet time, which begins at
#: `day_ms`: how many orders, missions that changed their drone, and milliseconds of deliveries.
better_orders = Table(
    "better_orders",
    metadata,
    Column("provider_id", Text, primary_key=True),
    Column("day_ms", BigInteger, primary_key=True),
    Column("orders", Integer, nullable=False),
    Column("moves", Integer, nullable=False),
    Column("saved_ms", BigInteger, nullable=False),
)

"""Quotes, and the networks that requests are checked against."""

from sqlalchemy import BigInteger, Column, Index, Integer, Table, Text, text

from skyway_gateway.tables.metadata import metadata

#: Offers to customers, which reserve nothing unless they are held.
quotes = Table(
    "quotes",
    metadata,
    Column("quote_id", Text, primary_key=True),
    Column("customer_id", Text, nullable=False),
    Column("request", Text, nullable=False),  # JSON of skyway.delivery.request.DeliveryRequest
    Column("offers", Text, nullable=False),  # JSON list of quotes.quote.Offer
    Column("infeasible", Text, nullable=False),  # JSON list of ProviderReason
    Column("made_ms", BigInteger, nullable=False),
    Column("expires_wall_ms", BigInteger, nullable=False),
    Column("taken_offer_id", Text),
    Column("delivery_id", Text),
    # What composition holds for its first offers until they expire; null if nothing is held.
    Column("hold_id", Text),
    Index("quotes_by_expiry", "expires_wall_ms"),
    Index(
        "quotes_held",
        "expires_wall_ms",
        sqlite_where=text("hold_id IS NOT NULL"),
        postgresql_where=text("hold_id IS NOT NULL"),
    ),
)

#: The last known version of each network, for the time in which composition is away.
known_networks = Table(
    "known_networks",
    metadata,
    Column("network_id", Text, primary_key=True),
    Column("version", Integer, nullable=False),
    Column("stations", Text, nullable=False),  # JSON of contracts.station_check.NetworkStations
)

"""The batteries of providers, rules for maintenance, and what the flights of drones have shown.

`_ms` is fleet time, in ms since 1970. `tables` has all other tables of the registry.
"""

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Double,
    ForeignKey,
    Index,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
)

metadata = MetaData()

#: Rules for the maintenance of a provider's drones of one model; null: no limit of this kind.
maintenance_rules = Table(
    "maintenance_rules",
    metadata,
    Column("provider_id", Text, ForeignKey("providers.provider_id"), primary_key=True),
    Column("model_id", Text, primary_key=True),
    Column("every_flight_s", Double),
    Column("every_cycles", Double),
)

#: The batteries of providers. A battery is in one drone or in none, and a drone has one or none.
batteries = Table(
    "batteries",
    metadata,
    Column("battery_id", Text, primary_key=True),
    Column("provider_id", Text, ForeignKey("providers.provider_id"), nullable=False),
    Column("model_id", Text, nullable=False),  # of the drones that it fits
    Column("serial", Text, nullable=False),
    Column("capacity_j", Double, nullable=False),
    # Learned from the flights with it: a mean over so many observations.
    Column("state_of_health", Double, nullable=False),
    Column("health_observations", BigInteger, nullable=False),
    # The full charges that it has given in earlier installations.
    Column("used_soc", Double, nullable=False),
    Column("drone_id", Text, ForeignKey("drones.drone_id")),
    Column("installed_ms", BigInteger),
    # The drone's `presence.used_soc` when the battery was installed.
    Column("installed_used_soc", Double),
    Column("created_ms", BigInteger, nullable=False),
    UniqueConstraint("provider_id", "serial", name="battery_serial"),
    UniqueConstraint("drone_id", name="battery_of_drone"),
    Index("batteries_by_provider", "provider_id", "battery_id"),
)

#: Where a battery was before; a drone of an old row may have been removed.
past_installations = Table(
    "past_installations",
    metadata,
    Column(
        "battery_id", Text, ForeignKey("batteries.battery_id", ondelete="CASCADE"), primary_key=True
    ),
    Column("installed_ms", BigInteger, primary_key=True, autoincrement=False),
    Column("removed_ms", BigInteger, nullable=False),
    Column("drone_id", Text, nullable=False),
    Column("used_soc", Double, nullable=False),
)

#: What the flights of a drone have shown about it: means, which begin at 1. No row: nothing yet.
#: With a battery in `batteries` the health is there: here it is the health of an unknown battery.
learned_values = Table(
    "learned_values",
    metadata,
    Column("drone_id", Text, ForeignKey("drones.drone_id", ondelete="CASCADE"), primary_key=True),
    Column("flights", BigInteger, nullable=False),
    Column("recharges", BigInteger, nullable=False),
    Column("still_air_factor", Double, nullable=False),
    # The mean square of the distance from that mean. The default is that of a new drone.
    Column("still_air_variance", Double, nullable=False, server_default="0.0064"),
    Column("state_of_health", Double, nullable=False),
    Column("charge_rate_factor", Double, nullable=False),
    # How many of the flights and recharges the health rests on.
    Column("health_observations", BigInteger, nullable=False, server_default="0"),
    # Whether the alarm for maintenance was raised, and the drone has not become better since.
    Column("is_maintenance_due", Boolean, nullable=False),
    # The last state that was learned from, and when it was received.
    Column("learned_session", BigInteger, nullable=False),
    Column("learned_seq", BigInteger, nullable=False),
    Column("learned_ms", BigInteger, nullable=False),
    Column("since_ms", BigInteger, nullable=False),
)

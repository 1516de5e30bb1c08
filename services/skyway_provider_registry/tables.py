"""The tables of the registry; `_ms` is fleet time, `_wall_ms` wall time, in ms since 1970."""

from collections.abc import Iterator
from typing import Final

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Double,
    ForeignKey,
    Index,
    MetaData,
    SmallInteger,
    Table,
    Text,
    UniqueConstraint,
    exists,
    false,
    select,
    text,
)

from skyway.runtime.idempotency_store import idempotency_table
from skyway.runtime.replicas.replica_store import replicas_table

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


replicas, idempotency = replicas_table(metadata), idempotency_table(metadata)
_STANDBYS = "standby IN ('HOME', 'STAY', 'PARKING', 'NEXT_PICKUP')"


def _place_columns() -> Iterator[Column[float]]:
    """The position of a drone."""
    return (Column(f"{name}_deg", Double, nullable=False) for name in ("longitude", "latitude"))


providers = Table(
    "providers",
    metadata,
    Column("provider_id", Text, primary_key=True),
    Column("name", Text, nullable=False),
    Column("tariff", Text, nullable=False),  # JSON of skyway.delivery.offer.Tariff
    Column("terms", Text),
    Column("state", Text, nullable=False),
    Column("loading", Text, nullable=False, server_default="AUTOMATIC"),
    Column("standby", Text, nullable=False, server_default="HOME"),
    Column("exchanges_deliveries", Boolean, nullable=False, server_default=false()),
    Column("created_ms", BigInteger, nullable=False),
    CheckConstraint("state IN ('ACTIVE', 'SUSPENDED')", name="provider_state"),
    CheckConstraint(_STANDBYS, name="provider_standby"),
)

#: Models that operators and providers added; the library's named models are not in this table.
drone_models = Table(
    "drone_models",
    metadata,
    Column("model_id", Text, primary_key=True),
    Column("model", Text, nullable=False),  # JSON of skyway.drone.model.DroneModel
    # The provider that added it, may replace it, and alone uses it; null: it is in the catalogue.
    Column("provider_id", Text, ForeignKey("providers.provider_id"), nullable=True),
)

drones = Table(
    "drones",
    metadata,
    Column("drone_id", Text, primary_key=True),
    Column("provider_id", Text, ForeignKey("providers.provider_id"), nullable=False),
    Column("model_id", Text, nullable=False),
    Column("home_station_id", Text, nullable=False),
    Column("home_longitude_deg", Double, nullable=False),
    Column("home_latitude_deg", Double, nullable=False),
    Column("network_id", Text, nullable=False),  # of its home
    Column("name", Text),
    Column("registration", Text),
    Column("initial_soc", Double, nullable=False),
    Column("standby", Text),  # null: as its provider
    Column("is_in_maintenance", Boolean, nullable=False),
    # What `presence` had counted at the last maintenance, and since when the next one is due.
    Column("maintained_flown_s", Double, nullable=False, server_default="0"),
    Column("maintained_used_soc", Double, nullable=False, server_default="0"),
    Column("maintained_ms", BigInteger),
    Column("maintenance_due_ms", BigInteger),
    Column("battery_changed_ms", BigInteger),
    Column("created_ms", BigInteger, nullable=False),
    Column("is_signing", Boolean, nullable=False, server_default=false()),  # since its first key
    # A registration belongs to one aircraft; across providers we cannot judge to which one.
    UniqueConstraint("provider_id", "registration", name="drone_registration"),
    CheckConstraint(_STANDBYS, name="drone_standby"),
    Index("drones_by_provider", "provider_id", "drone_id"),
    Index("drones_by_model", "model_id"),
)

#: One row per drone, from its registration on. -1 in an order column: no message yet.
presence = Table(
    "presence",
    metadata,
    Column("drone_id", Text, ForeignKey("drones.drone_id", ondelete="CASCADE"), primary_key=True),
    Column("connection_session", BigInteger, nullable=False),
    Column("connection_number", BigInteger, nullable=False),
    Column("connection_rank", BigInteger, nullable=False),
    Column("connection_status", Text),
    Column("state_session", BigInteger, nullable=False),
    Column("state_seq", BigInteger, nullable=False),
    Column("state_at_ms", BigInteger),
    Column("state_seen_ms", BigInteger),  # when the state was received
    Column("activity", Text),
    Column("mission_id", Text),
    Column("station_id", Text),
    Column("longitude_deg", Double),
    Column("latitude_deg", Double),
    Column("soc", Double),
    # How far, and by how much charge, its states are ahead of what it can fly and charge.
    Column("ahead_m", Double, nullable=False, server_default="0"),
    Column("ahead_soc", Double, nullable=False, server_default="0"),
    # How long it has flown, and how many full charges it has used, as far as it was seen.
    Column("flown_s", Double, nullable=False, server_default="0"),
    Column("used_soc", Double, nullable=False, server_default="0"),
    Column("condition", Text),  # JSON of presence.drone_presence.Condition
    Column("sample_session", BigInteger, nullable=False),
    Column("sample_seq", BigInteger, nullable=False),
    Column("sample_at_ms", BigInteger),
    Column("sample_longitude_deg", Double),
    Column("sample_latitude_deg", Double),
    Column("sample_soc", Double),
    Column("last_seen_ms", BigInteger),
    Column("last_seen_wall_ms", BigInteger),
    # The number of the last change that affects selection.
    Column("changed", BigInteger, nullable=False, server_default="0"),
    Index("presence_by_change", "changed"),
)

#: Alarms about drones on their way to composition.
waiting_alarms = Table(
    "waiting_alarms",
    metadata,
    Column("drone_id", Text, ForeignKey("drones.drone_id", ondelete="CASCADE"), primary_key=True),
    Column("alarm", Text, nullable=False),  # JSON of DroneAlarm
)

#: When the credentials of a drone were renewed last, if ever.
renewals = Table(
    "renewals",
    metadata,
    Column("drone_id", Text, ForeignKey("drones.drone_id", ondelete="CASCADE"), primary_key=True),
    Column("renewed_ms", BigInteger, nullable=False),
    Column("renewed_wall_ms", BigInteger, nullable=False),
    Column("is_announced", Boolean, nullable=False),  # whether composition knows
    Index("renewals_by_moment", "renewed_wall_ms"),
    Index(
        "renewals_to_announce",
        "renewed_wall_ms",
        sqlite_where=text("is_announced = 0"),
        postgresql_where=text("NOT is_announced"),
    ),
)

#: Samples of telemetry, each stored once; `at_ms` is fleet time. There is no foreign key, because a
#: removed drone has too many rows to delete them in one transaction.
telemetry_samples = Table(
    "telemetry_samples",
    metadata,
    Column("drone_id", Text, primary_key=True),
    Column("at_ms", BigInteger, primary_key=True, autoincrement=False),
    Column("heard_wall_ms", BigInteger, nullable=False),
    *_place_columns(),
    Column("soc", Double, nullable=False),
    Column("power_w", Double, nullable=False),
    Column("speed_mps", Double, nullable=False),
    Column("voltage_v", Double),
    Column("temperature_c", Double),
    Column("range_m", Double),
    # The rows of a drone are stored side by side, without a second index.
    sqlite_with_rowid=False,
)

#: Old telemetry: one row of averages for each minute of fleet time.
telemetry_minutes = Table(
    "telemetry_minutes",
    metadata,
    Column("drone_id", Text, primary_key=True),
    Column("at_ms", BigInteger, primary_key=True, autoincrement=False),
    Column("heard_wall_ms", BigInteger, nullable=False),
    *_place_columns(),
    Column("samples", BigInteger, nullable=False),
    *(
        Column(f"{prefix}{name}", Double, nullable=False)
        for name in ("soc", "power_w", "speed_mps")
        for prefix in ("", "min_", "max_")
    ),
    sqlite_with_rowid=False,
)

#: Mission reports of composition. They are hints: composition's own index decides who is busy.
mission_hints = Table(
    "mission_hints",
    metadata,
    Column("mission_id", Text, primary_key=True),
    Column("drone_id", Text, ForeignKey("drones.drone_id", ondelete="CASCADE"), nullable=False),
    Column("seq", BigInteger, nullable=False),
    Column("mission_state", Text, nullable=False),
    Column("is_live", Boolean, nullable=False),
    Column("reported_wall_ms", BigInteger, nullable=False),
    # When and where the drone can begin another mission; null if that was not reported.
    Column("free_ms", BigInteger),
    Column("free_station_id", Text),
    Column("free_soc", Double),
    Index("mission_hints_by_drone", "drone_id", "is_live"),
)

#: Accounts of drones and customers; accounts of services and operators come from the secrets.
broker_accounts = Table(
    "broker_accounts",
    metadata,
    Column("user_name", Text, primary_key=True),
    Column("kind", Text, nullable=False),
    Column("password_hash", Text, nullable=False),
    # When the account was blocked; it is open again once the drone enrols again.
    Column("revoked_wall_ms", BigInteger),
    CheckConstraint("kind IN ('DRONE', 'CUSTOMER', 'OPERATOR')", name="broker_account_kind"),
)

#: The newest enrolment token of each drone, as SHA-256.
enrolment_tokens = Table(
    "enrolment_tokens",
    metadata,
    Column("drone_id", Text, ForeignKey("drones.drone_id", ondelete="CASCADE"), primary_key=True),
    Column("token_hash", Text, nullable=False),
    Column("expires_wall_ms", BigInteger, nullable=False),
    Column("used_wall_ms", BigInteger),
    UniqueConstraint("token_hash", name="enrolment_token_hash"),
)

#: Keys of enrolled drones, as SHA-256; the next key and password take effect at first use.
drone_keys = Table(
    "drone_keys",
    metadata,
    Column("drone_id", Text, ForeignKey("drones.drone_id", ondelete="CASCADE"), primary_key=True),
    Column("key_hash", Text, nullable=False),
    Column("next_key_hash", Text),
    Column("next_password_hash", Text),
    UniqueConstraint("key_hash", name="drone_key_hash"),
    UniqueConstraint("next_key_hash", name="drone_next_key_hash"),
)

#: Certificates that ended before their time, by the SHA-256 of the drone's key that came with each.
revoked_certificates = Table(
    "revoked_certificates",
    metadata,
    Column("key_hash", Text, primary_key=True),
    # Not the drone: its row may be gone.
    Column("user_name", Text, nullable=False),
    # When the certificate is over by itself, at the latest.
    Column("ends_wall_ms", BigInteger, nullable=False),
)

#: The public keys with which drones sign; the next key takes effect with the next credentials.
#: While `is_required`, nothing is believed without a signature: without a key nothing at all.
drone_signing_keys = Table(
    "drone_signing_keys",
    metadata,
    Column("drone_id", Text, ForeignKey("drones.drone_id", ondelete="CASCADE"), primary_key=True),
    Column("is_required", Boolean, nullable=False),
    Column("public_key", Text),
    Column("next_public_key", Text),
    CheckConstraint("is_required OR public_key IS NULL", name="drone_signing_required"),
)

#: One row: the number of the last change, and of the last change of two kinds.
changes = Table(
    "changes",
    metadata,
    Column("only", SmallInteger, primary_key=True, autoincrement=False),
    Column("latest", BigInteger, nullable=False),
    Column("providers", BigInteger, nullable=False),
    Column("removals", BigInteger, nullable=False),
)

#: While there are such rows, time alone can make work for the loops.
OPEN_ROWS: Final = (exists(select(drones)),)

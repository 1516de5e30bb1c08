"""The tables of the provider registry."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "broker_accounts",
        sa.Column("user_name", sa.Text(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("password_hash", sa.Text(), nullable=False),
        sa.Column("revoked_wall_ms", sa.BigInteger(), nullable=True),
        sa.CheckConstraint("kind IN ('DRONE', 'CUSTOMER', 'OPERATOR')", name="broker_account_kind"),
        sa.PrimaryKeyConstraint("user_name"),
    )
    op.create_table(
        "changes",
        sa.Column("only", sa.SmallInteger(), autoincrement=False, nullable=False),
        sa.Column("latest", sa.BigInteger(), nullable=False),
        sa.Column("providers", sa.BigInteger(), nullable=False),
        sa.Column("removals", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("only"),
    )
    op.create_table(
        "idempotency",
        sa.Column("key_hash", sa.Text(), nullable=False),
        sa.Column("body_hash", sa.LargeBinary(), nullable=False),
        sa.Column("answer", sa.LargeBinary(), nullable=True),
        sa.Column("created_at_ms", sa.BigInteger(), nullable=False),
        sa.Column("location", sa.Text(), nullable=True),
        sa.PrimaryKeyConstraint("key_hash"),
    )
    op.create_index("idempotency_age", "idempotency", ["created_at_ms"], unique=False)
    op.create_table(
        "providers",
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("tariff", sa.Text(), nullable=False),
        sa.Column("terms", sa.Text(), nullable=True),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("loading", sa.Text(), server_default="AUTOMATIC", nullable=False),
        sa.Column("standby", sa.Text(), server_default="HOME", nullable=False),
        sa.Column("created_ms", sa.BigInteger(), nullable=False),
        sa.CheckConstraint(
            "standby IN ('HOME', 'STAY', 'PARKING', 'NEXT_PICKUP')", name="provider_standby"
        ),
        sa.CheckConstraint("state IN ('ACTIVE', 'SUSPENDED')", name="provider_state"),
        sa.PrimaryKeyConstraint("provider_id"),
    )
    op.create_table(
        "drone_models",
        sa.Column("model_id", sa.Text(), nullable=False),
        sa.Column("model", sa.Text(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=True),
        sa.ForeignKeyConstraint(["provider_id"], ["providers.provider_id"]),
        sa.PrimaryKeyConstraint("model_id"),
    )
    op.create_table(
        "replicas",
        sa.Column("replica_id", sa.Text(), nullable=False),
        sa.Column("joined_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("seen_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("is_listening", sa.Boolean(), nullable=False),
        sa.PrimaryKeyConstraint("replica_id"),
    )
    op.create_table(
        "revoked_certificates",
        sa.Column("key_hash", sa.Text(), nullable=False),
        sa.Column("user_name", sa.Text(), nullable=False),
        sa.Column("ends_wall_ms", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("key_hash"),
    )
    op.create_table(
        "telemetry_minutes",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("heard_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("longitude_deg", sa.Double(), nullable=False),
        sa.Column("latitude_deg", sa.Double(), nullable=False),
        sa.Column("samples", sa.BigInteger(), nullable=False),
        sa.Column("soc", sa.Double(), nullable=False),
        sa.Column("min_soc", sa.Double(), nullable=False),
        sa.Column("max_soc", sa.Double(), nullable=False),
        sa.Column("power_w", sa.Double(), nullable=False),
        sa.Column("min_power_w", sa.Double(), nullable=False),
        sa.Column("max_power_w", sa.Double(), nullable=False),
        sa.Column("speed_mps", sa.Double(), nullable=False),
        sa.Column("min_speed_mps", sa.Double(), nullable=False),
        sa.Column("max_speed_mps", sa.Double(), nullable=False),
        sa.PrimaryKeyConstraint("drone_id", "at_ms"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "telemetry_samples",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("heard_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("longitude_deg", sa.Double(), nullable=False),
        sa.Column("latitude_deg", sa.Double(), nullable=False),
        sa.Column("soc", sa.Double(), nullable=False),
        sa.Column("power_w", sa.Double(), nullable=False),
        sa.Column("speed_mps", sa.Double(), nullable=False),
        sa.Column("voltage_v", sa.Double(), nullable=True),
        sa.Column("temperature_c", sa.Double(), nullable=True),
        sa.Column("range_m", sa.Double(), nullable=True),
        sa.PrimaryKeyConstraint("drone_id", "at_ms"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "drones",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("model_id", sa.Text(), nullable=False),
        sa.Column("home_station_id", sa.Text(), nullable=False),
        sa.Column("home_longitude_deg", sa.Double(), nullable=False),
        sa.Column("home_latitude_deg", sa.Double(), nullable=False),
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=True),
        sa.Column("registration", sa.Text(), nullable=True),
        sa.Column("initial_soc", sa.Double(), nullable=False),
        sa.Column("standby", sa.Text(), nullable=True),
        sa.Column("is_in_maintenance", sa.Boolean(), nullable=False),
        sa.Column("maintained_flown_s", sa.Double(), server_default="0", nullable=False),
        sa.Column("maintained_used_soc", sa.Double(), server_default="0", nullable=False),
        sa.Column("maintained_ms", sa.BigInteger(), nullable=True),
        sa.Column("maintenance_due_ms", sa.BigInteger(), nullable=True),
        sa.Column("battery_changed_ms", sa.BigInteger(), nullable=True),
        sa.Column("created_ms", sa.BigInteger(), nullable=False),
        sa.Column("is_signing", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.CheckConstraint(
            "standby IN ('HOME', 'STAY', 'PARKING', 'NEXT_PICKUP')", name="drone_standby"
        ),
        sa.ForeignKeyConstraint(
            ["provider_id"],
            ["providers.provider_id"],
        ),
        sa.PrimaryKeyConstraint("drone_id"),
        sa.UniqueConstraint("provider_id", "registration", name="drone_registration"),
    )
    op.create_index("drones_by_model", "drones", ["model_id"], unique=False)
    op.create_index("drones_by_provider", "drones", ["provider_id", "drone_id"], unique=False)
    op.create_table(
        "maintenance_rules",
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("model_id", sa.Text(), nullable=False),
        sa.Column("every_flight_s", sa.Double(), nullable=True),
        sa.Column("every_cycles", sa.Double(), nullable=True),
        sa.ForeignKeyConstraint(
            ["provider_id"],
            ["providers.provider_id"],
        ),
        sa.PrimaryKeyConstraint("provider_id", "model_id"),
    )
    op.create_table(
        "batteries",
        sa.Column("battery_id", sa.Text(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("model_id", sa.Text(), nullable=False),
        sa.Column("serial", sa.Text(), nullable=False),
        sa.Column("capacity_j", sa.Double(), nullable=False),
        sa.Column("state_of_health", sa.Double(), nullable=False),
        sa.Column("health_observations", sa.BigInteger(), nullable=False),
        sa.Column("used_soc", sa.Double(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=True),
        sa.Column("installed_ms", sa.BigInteger(), nullable=True),
        sa.Column("installed_used_soc", sa.Double(), nullable=True),
        sa.Column("created_ms", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["drone_id"],
            ["drones.drone_id"],
        ),
        sa.ForeignKeyConstraint(
            ["provider_id"],
            ["providers.provider_id"],
        ),
        sa.PrimaryKeyConstraint("battery_id"),
        sa.UniqueConstraint("drone_id", name="battery_of_drone"),
        sa.UniqueConstraint("provider_id", "serial", name="battery_serial"),
    )
    op.create_index(
        "batteries_by_provider", "batteries", ["provider_id", "battery_id"], unique=False
    )
    op.create_table(
        "drone_keys",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("key_hash", sa.Text(), nullable=False),
        sa.Column("next_key_hash", sa.Text(), nullable=True),
        sa.Column("next_password_hash", sa.Text(), nullable=True),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
        sa.UniqueConstraint("key_hash", name="drone_key_hash"),
        sa.UniqueConstraint("next_key_hash", name="drone_next_key_hash"),
    )
    op.create_table(
        "drone_signing_keys",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("is_required", sa.Boolean(), nullable=False),
        sa.Column("public_key", sa.Text(), nullable=True),
        sa.Column("next_public_key", sa.Text(), nullable=True),
        sa.CheckConstraint("is_required OR public_key IS NULL", name="drone_signing_required"),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
    )
    op.create_table(
        "enrolment_tokens",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("token_hash", sa.Text(), nullable=False),
        sa.Column("expires_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("used_wall_ms", sa.BigInteger(), nullable=True),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
        sa.UniqueConstraint("token_hash", name="enrolment_token_hash"),
    )
    op.create_table(
        "learned_values",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("flights", sa.BigInteger(), nullable=False),
        sa.Column("recharges", sa.BigInteger(), nullable=False),
        sa.Column("still_air_factor", sa.Double(), nullable=False),
        sa.Column("still_air_variance", sa.Double(), server_default="0.0064", nullable=False),
        sa.Column("state_of_health", sa.Double(), nullable=False),
        sa.Column("charge_rate_factor", sa.Double(), nullable=False),
        sa.Column("health_observations", sa.BigInteger(), server_default="0", nullable=False),
        sa.Column("is_maintenance_due", sa.Boolean(), nullable=False),
        sa.Column("learned_session", sa.BigInteger(), nullable=False),
        sa.Column("learned_seq", sa.BigInteger(), nullable=False),
        sa.Column("learned_ms", sa.BigInteger(), nullable=False),
        sa.Column("since_ms", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
    )
    op.create_table(
        "mission_hints",
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("seq", sa.BigInteger(), nullable=False),
        sa.Column("mission_state", sa.Text(), nullable=False),
        sa.Column("is_live", sa.Boolean(), nullable=False),
        sa.Column("reported_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("free_ms", sa.BigInteger(), nullable=True),
        sa.Column("free_station_id", sa.Text(), nullable=True),
        sa.Column("free_soc", sa.Double(), nullable=True),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("mission_id"),
    )
    op.create_index(
        "mission_hints_by_drone", "mission_hints", ["drone_id", "is_live"], unique=False
    )
    op.create_table(
        "presence",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("connection_session", sa.BigInteger(), nullable=False),
        sa.Column("connection_number", sa.BigInteger(), nullable=False),
        sa.Column("connection_rank", sa.BigInteger(), nullable=False),
        sa.Column("connection_status", sa.Text(), nullable=True),
        sa.Column("state_session", sa.BigInteger(), nullable=False),
        sa.Column("state_seq", sa.BigInteger(), nullable=False),
        sa.Column("state_at_ms", sa.BigInteger(), nullable=True),
        sa.Column("state_seen_ms", sa.BigInteger(), nullable=True),
        sa.Column("activity", sa.Text(), nullable=True),
        sa.Column("mission_id", sa.Text(), nullable=True),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("longitude_deg", sa.Double(), nullable=True),
        sa.Column("latitude_deg", sa.Double(), nullable=True),
        sa.Column("soc", sa.Double(), nullable=True),
        sa.Column("ahead_m", sa.Double(), server_default="0", nullable=False),
        sa.Column("ahead_soc", sa.Double(), server_default="0", nullable=False),
        sa.Column("flown_s", sa.Double(), server_default="0", nullable=False),
        sa.Column("used_soc", sa.Double(), server_default="0", nullable=False),
        sa.Column("condition", sa.Text(), nullable=True),
        sa.Column("sample_session", sa.BigInteger(), nullable=False),
        sa.Column("sample_seq", sa.BigInteger(), nullable=False),
        sa.Column("sample_at_ms", sa.BigInteger(), nullable=True),
        sa.Column("sample_longitude_deg", sa.Double(), nullable=True),
        sa.Column("sample_latitude_deg", sa.Double(), nullable=True),
        sa.Column("sample_soc", sa.Double(), nullable=True),
        sa.Column("last_seen_ms", sa.BigInteger(), nullable=True),
        sa.Column("last_seen_wall_ms", sa.BigInteger(), nullable=True),
        sa.Column("changed", sa.BigInteger(), server_default="0", nullable=False),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
    )
    op.create_index("presence_by_change", "presence", ["changed"], unique=False)
    op.create_table(
        "renewals",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("renewed_ms", sa.BigInteger(), nullable=False),
        sa.Column("renewed_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("is_announced", sa.Boolean(), nullable=False),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
    )
    op.create_index("renewals_by_moment", "renewals", ["renewed_wall_ms"], unique=False)
    op.create_index(
        "renewals_to_announce",
        "renewals",
        ["renewed_wall_ms"],
        unique=False,
        sqlite_where=sa.text("is_announced = 0"),
        postgresql_where=sa.text("NOT is_announced"),
    )
    op.create_table(
        "waiting_alarms",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("alarm", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
    )
    op.create_table(
        "past_installations",
        sa.Column("battery_id", sa.Text(), nullable=False),
        sa.Column("installed_ms", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("removed_ms", sa.BigInteger(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("used_soc", sa.Double(), nullable=False),
        sa.ForeignKeyConstraint(["battery_id"], ["batteries.battery_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("battery_id", "installed_ms"),
    )

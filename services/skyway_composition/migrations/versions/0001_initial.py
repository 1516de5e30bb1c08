"""The tables of composition, and the rules that no pad and no drone is taken twice."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

# I1 on PostgreSQL. GiST can compare text and integers only with btree_gist. An int8range with equal
# ends is empty and overlaps nothing.
_POSTGRESQL = (
    "CREATE EXTENSION IF NOT EXISTS btree_gist",
    (
        "ALTER TABLE pad_reservations ADD CONSTRAINT pad_taken EXCLUDE USING gist "
        "(station_id WITH =, pad WITH =, int8range(start_ms, end_ms) WITH &&)"
    ),
    (
        "ALTER TABLE missions ADD CONSTRAINT drone_time_taken EXCLUDE USING gist "
        "(drone_id WITH =, int8range(start_ms, served_ms) WITH &&) WHERE (state = 'QUEUED')"
    ),
    # Every message of a drone rewrites its link. While the page has free space, PostgreSQL needs no
    # new index entry. Without it, every search for the link also reads its old row versions.
    "ALTER TABLE drone_links SET (fillfactor = 50)",
)

_PAD_OVERLAPS = (
    "SELECT 1 FROM pad_reservations AS other WHERE other.station_id = NEW.station_id "
    "AND other.pad = NEW.pad AND other.start_ms < NEW.end_ms AND NEW.start_ms < other.end_ms"
)

_DRONE_OVERLAPS = (
    "NEW.state = 'QUEUED' AND NEW.start_ms < NEW.served_ms AND EXISTS ("
    "SELECT 1 FROM missions AS other WHERE other.drone_id = NEW.drone_id "
    "AND other.mission_id <> NEW.mission_id AND other.state = 'QUEUED' "
    "AND other.start_ms < other.served_ms "
    "AND other.start_ms < NEW.served_ms AND NEW.start_ms < other.served_ms)"
)

# I1 on SQLite. A check before the write is safe, because SQLite has one writer.
_SQLITE = (
    (
        "CREATE TRIGGER pad_taken_on_insert BEFORE INSERT ON pad_reservations "
        f"WHEN EXISTS ({_PAD_OVERLAPS}) BEGIN SELECT RAISE(ABORT, 'pad_taken'); END"
    ),
    (
        "CREATE TRIGGER pad_taken_on_update BEFORE UPDATE ON pad_reservations "
        f"WHEN EXISTS ({_PAD_OVERLAPS} AND other.rowid <> OLD.rowid) "
        "BEGIN SELECT RAISE(ABORT, 'pad_taken'); END"
    ),
    *(
        f"CREATE TRIGGER drone_time_taken_on_{verb.lower()} BEFORE {verb} ON missions "
        f"WHEN {_DRONE_OVERLAPS} BEGIN SELECT RAISE(ABORT, 'drone_time_taken'); END"
        for verb in ("INSERT", "UPDATE")
    ),
)


def upgrade() -> None:
    op.create_table(
        "alarms",
        sa.Column("alarm_id", sa.Text(), nullable=False),
        sa.Column("level", sa.Text(), nullable=False),
        sa.Column("code", sa.Text(), nullable=False),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=True),
        sa.Column("drone_id", sa.Text(), nullable=True),
        sa.Column("mission_id", sa.Text(), nullable=True),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("data", sa.Text(), nullable=False),
        sa.Column("acknowledged_ms", sa.BigInteger(), nullable=True),
        sa.Column("acknowledged_by", sa.Text(), nullable=True),
        sa.Column("note", sa.Text(), nullable=True),
        sa.CheckConstraint("level IN ('WARNING', 'URGENT', 'CRITICAL')", name="alarm_level"),
        sa.PrimaryKeyConstraint("alarm_id"),
    )
    op.create_index("alarms_open", "alarms", ["acknowledged_ms", "alarm_id"], unique=False)
    op.create_index(
        "alarms_open_of_drone",
        "alarms",
        ["drone_id", "level"],
        unique=False,
        sqlite_where=sa.text("acknowledged_ms IS NULL"),
        postgresql_where=sa.text("acknowledged_ms IS NULL"),
    )
    op.create_table(
        "better_orders",
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("day_ms", sa.BigInteger(), nullable=False),
        sa.Column("orders", sa.Integer(), nullable=False),
        sa.Column("moves", sa.Integer(), nullable=False),
        sa.Column("saved_ms", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("provider_id", "day_ms"),
    )
    op.create_table(
        "deliveries",
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("closed_ms", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("delivery_id"),
    )
    op.create_table(
        "drone_links",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("stream", sa.Integer(), nullable=False),
        sa.Column("last_seq", sa.Integer(), nullable=False),
        sa.Column("acked_stream", sa.Integer(), nullable=False),
        sa.Column("acked_session", sa.BigInteger(), nullable=False),
        sa.Column("last_event_seq", sa.BigInteger(), nullable=False),
        sa.Column("report_asked_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("state", sa.Text(), nullable=True),
        sa.Column("is_occupied", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.Column("connection", sa.Text(), nullable=True),
        sa.Column("held_by", sa.Text(), nullable=True),
        sa.Column("held_until_ms", sa.BigInteger(), nullable=True),
        sa.Column("renewed_ms", sa.BigInteger(), nullable=True),
        sa.CheckConstraint("(held_by IS NULL) = (held_until_ms IS NULL)", name="drone_held"),
        sa.PrimaryKeyConstraint("drone_id"),
    )
    op.create_index(
        "drone_links_held",
        "drone_links",
        ["drone_id"],
        unique=False,
        sqlite_where=sa.text("held_by IS NOT NULL"),
        postgresql_where=sa.text("held_by IS NOT NULL"),
    )
    op.create_index(
        "drone_links_occupied",
        "drone_links",
        ["drone_id"],
        unique=False,
        sqlite_where=sa.text("is_occupied = 1"),
        postgresql_where=sa.text("is_occupied"),
    )
    op.create_table(
        "networks",
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("published_ms", sa.BigInteger(), nullable=False),
        sa.Column("oldest_version", sa.Integer(), server_default="1", nullable=False),
        sa.Column("conditions", sa.BigInteger(), server_default="0", nullable=False),
        sa.PrimaryKeyConstraint("network_id"),
    )
    op.create_table(
        "offer_holds",
        sa.Column("hold_id", sa.Text(), nullable=False),
        sa.Column("customer_id", sa.Text(), nullable=False),
        sa.Column("slot", sa.SmallInteger(), nullable=True),
        sa.Column("until_ms", sa.BigInteger(), nullable=False),
        sa.Column("offers", sa.Text(), nullable=False),
        sa.CheckConstraint("slot >= 1", name="hold_slot_counts"),
        sa.PrimaryKeyConstraint("hold_id"),
        sa.UniqueConstraint("customer_id", "slot", name="hold_slot"),
    )
    op.create_index("offer_holds_by_end", "offer_holds", ["until_ms"], unique=False)
    op.create_table(
        "outbox",
        sa.Column("id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("channel", sa.Text(), nullable=False),
        sa.Column("stream", sa.Text(), nullable=False),
        sa.Column("address", sa.Text(), nullable=False),
        sa.Column("payload", sa.LargeBinary(), nullable=False),
        sa.Column("confirmed_by", sa.Text(), nullable=False),
        sa.Column("message_id", sa.Text(), nullable=True),
        sa.Column("mqtt_qos", sa.Integer(), nullable=False),
        sa.Column("is_retained", sa.Boolean(), nullable=False),
        sa.Column("traceparent", sa.Text(), nullable=True),
        sa.Column("attempts", sa.Integer(), server_default="0", nullable=False),
        sa.Column("due_at_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.Column("stored_wall_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.Column("claimed_by", sa.Text(), nullable=True),
        sa.Column("claimed_until_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    op.create_index("outbox_message", "outbox", ["message_id"], unique=False)
    op.create_index("outbox_stream", "outbox", ["channel", "stream", "id"], unique=False)
    op.create_table(
        "quarantine",
        sa.Column("quarantine_id", sa.Text(), nullable=False),
        sa.Column("topic", sa.Text(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.Column("payload", sa.LargeBinary(), nullable=False),
        sa.Column("payload_sha256", sa.Text(), nullable=False),
        sa.Column("size_bytes", sa.BigInteger(), nullable=False),
        sa.Column("times", sa.BigInteger(), nullable=False),
        sa.Column("first_ms", sa.BigInteger(), nullable=False),
        sa.Column("last_ms", sa.BigInteger(), nullable=False),
        sa.Column("last_wall_ms", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("quarantine_id"),
        sa.UniqueConstraint("topic", "payload_sha256", name="quarantine_once"),
    )
    op.create_index(
        "quarantine_by_provider", "quarantine", ["provider_id", "drone_id"], unique=False
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
        "cancellations",
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("cancellation_id", sa.Text(), nullable=False),
        sa.Column("answer", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["delivery_id"],
            ["deliveries.delivery_id"],
        ),
        sa.PrimaryKeyConstraint("delivery_id", "cancellation_id"),
    )
    op.create_table(
        "closures",
        sa.Column("closure_id", sa.Text(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("network_id", sa.Text(), nullable=True),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("pad", sa.Integer(), nullable=True),
        sa.Column("to_station_id", sa.Text(), nullable=True),
        sa.Column("area", sa.Text(), nullable=True),
        sa.Column("provider_id", sa.Text(), nullable=True),
        sa.Column("drone_model_id", sa.Text(), nullable=True),
        sa.Column("reason", sa.Text(), nullable=True),
        sa.Column("from_ms", sa.BigInteger(), nullable=False),
        sa.Column("until_ms", sa.BigInteger(), nullable=True),
        sa.Column("made_ms", sa.BigInteger(), nullable=False),
        sa.Column("lifted_ms", sa.BigInteger(), nullable=True),
        sa.CheckConstraint(
            "kind IN ('STATION', 'PAD', 'SEGMENT', 'ZONE', 'GROUND_STOP')", name="closure_kind"
        ),
        sa.CheckConstraint("until_ms IS NULL OR from_ms < until_ms", name="closure_lasts"),
        sa.ForeignKeyConstraint(
            ["network_id"],
            ["networks.network_id"],
        ),
        sa.PrimaryKeyConstraint("closure_id"),
    )
    op.create_index("closures_by_station", "closures", ["station_id"], unique=False)
    op.create_index(
        "closures_in_force", "closures", ["network_id", "lifted_ms", "until_ms"], unique=False
    )
    op.create_table(
        "forecasts",
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("received_ms", sa.BigInteger(), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.Column("measured", sa.Text(), nullable=True),
        sa.ForeignKeyConstraint(
            ["network_id"],
            ["networks.network_id"],
        ),
        sa.PrimaryKeyConstraint("network_id"),
    )
    op.create_table(
        "missions",
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("trip", sa.Integer(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("start_ms", sa.BigInteger(), nullable=False),
        sa.Column("released_ms", sa.BigInteger(), nullable=False),
        sa.Column("expires_ms", sa.BigInteger(), nullable=False),
        sa.Column("body", sa.Text(), nullable=False),
        sa.Column("request", sa.Text(), nullable=False),
        sa.Column("candidate", sa.Text(), nullable=False),
        sa.Column("report_seq", sa.Integer(), nullable=False),
        sa.Column("told", sa.Text(), nullable=True),
        sa.Column("stuck", sa.Text(), nullable=True),
        sa.Column("trouble", sa.Text(), nullable=True),
        sa.Column("proposal", sa.Text(), nullable=True),
        sa.Column("aims", sa.Text(), server_default="[]", nullable=False),
        sa.Column("loading", sa.Text(), server_default="AUTOMATIC", nullable=False),
        sa.Column("retry_wall_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.Column("next_end_ms", sa.BigInteger(), nullable=True),
        sa.Column("stays", sa.Text(), nullable=True),
        sa.Column("served_ms", sa.BigInteger(), nullable=False),
        sa.Column("planned_version", sa.Integer(), nullable=True),
        sa.Column("planned_conditions", sa.BigInteger(), nullable=True),
        sa.Column("traceparent", sa.Text(), nullable=True),
        sa.Column("promised", sa.Text(), nullable=True),
        sa.Column("shares", sa.Text(), nullable=True),
        sa.Column("pooling_at", sa.Text(), nullable=True),
        sa.Column("cuts", sa.Integer(), server_default="0", nullable=False),
        sa.Column("claimed_by", sa.Text(), nullable=True),
        sa.Column("claimed_until_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.ForeignKeyConstraint(
            ["delivery_id"],
            ["deliveries.delivery_id"],
        ),
        sa.ForeignKeyConstraint(
            ["network_id"],
            ["networks.network_id"],
        ),
        sa.PrimaryKeyConstraint("mission_id"),
        sa.UniqueConstraint("delivery_id", "attempt", "trip", name="mission_attempt"),
    )
    op.create_index(
        "mission_drone",
        "missions",
        ["drone_id"],
        unique=True,
        sqlite_where=sa.text("state IN ('BOOKED', 'ACCEPTED', 'ACTIVE')"),
        postgresql_where=sa.text("state IN ('BOOKED', 'ACCEPTED', 'ACTIVE')"),
    )
    op.create_index(
        "missions_by_next_end",
        "missions",
        ["next_end_ms"],
        unique=False,
        sqlite_where=sa.text("state IN ('ACCEPTED', 'ACTIVE')"),
        postgresql_where=sa.text("state IN ('ACCEPTED', 'ACTIVE')"),
    )
    op.create_index("missions_by_provider", "missions", ["provider_id", "mission_id"], unique=False)
    op.create_index("missions_by_state", "missions", ["state", "released_ms"], unique=False)
    op.create_index(
        "missions_queued",
        "missions",
        ["drone_id", "start_ms"],
        unique=False,
        sqlite_where=sa.text("state = 'QUEUED'"),
        postgresql_where=sa.text("state = 'QUEUED'"),
    )
    op.create_index(
        "missions_to_join",
        "missions",
        ["pooling_at"],
        unique=False,
        sqlite_where=sa.text("state = 'QUEUED' AND pooling_at IS NOT NULL"),
        postgresql_where=sa.text("state = 'QUEUED' AND pooling_at IS NOT NULL"),
    )
    op.create_table(
        "network_versions",
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("published_ms", sa.BigInteger(), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["network_id"],
            ["networks.network_id"],
        ),
        sa.PrimaryKeyConstraint("network_id", "version"),
    )
    op.create_table(
        "stations",
        sa.Column("station_id", sa.Text(), nullable=False),
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=True),
        sa.Column("pads", sa.Integer(), nullable=False),
        sa.Column("longitude_deg", sa.Double(), nullable=False),
        sa.Column("latitude_deg", sa.Double(), nullable=False),
        sa.ForeignKeyConstraint(
            ["network_id"],
            ["networks.network_id"],
        ),
        sa.PrimaryKeyConstraint("station_id"),
    )
    op.create_index("stations_by_network", "stations", ["network_id", "station_id"], unique=False)
    op.create_table(
        "custody",
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("package_id", sa.Text(), nullable=False),
        sa.Column("seq", sa.Integer(), nullable=False),
        sa.Column("custodian_kind", sa.Text(), nullable=False),
        sa.Column("custodian_id", sa.Text(), nullable=False),
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), nullable=False),
        sa.CheckConstraint(
            "custodian_kind IN ('STATION', 'DRONE', 'RECIPIENT')", name="custodian_kind"
        ),
        sa.ForeignKeyConstraint(
            ["mission_id"],
            ["missions.mission_id"],
        ),
        sa.PrimaryKeyConstraint("delivery_id", "package_id", "seq"),
    )
    op.create_index("custody_by_mission", "custody", ["mission_id"], unique=False)
    op.create_index(
        "custody_delivered",
        "custody",
        ["delivery_id", "package_id"],
        unique=True,
        sqlite_where=sa.text("custodian_kind = 'RECIPIENT'"),
        postgresql_where=sa.text("custodian_kind = 'RECIPIENT'"),
    )
    op.create_table(
        "cut_steps",
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.Column("seq", sa.BigInteger(), nullable=False),
        sa.Column("step_id", sa.Integer(), nullable=True),
        sa.Column("kind", sa.Text(), nullable=True),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("started_ms", sa.BigInteger(), nullable=False),
        sa.Column("ended_ms", sa.BigInteger(), nullable=False),
        sa.Column("event", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"],
            ["missions.mission_id"],
        ),
        sa.PrimaryKeyConstraint("mission_id", "seq"),
    )
    op.create_index("cut_steps_by_time", "cut_steps", ["ended_ms"], unique=False)
    op.create_table(
        "guests",
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.Column("host_id", sa.Text(), nullable=False),
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(
            ["delivery_id"],
            ["deliveries.delivery_id"],
        ),
        sa.ForeignKeyConstraint(
            ["host_id"],
            ["missions.mission_id"],
        ),
        sa.PrimaryKeyConstraint("mission_id"),
        sa.UniqueConstraint("delivery_id", "attempt", name="guest_attempt"),
    )
    op.create_index("guests_by_host", "guests", ["host_id"], unique=False)
    op.create_table(
        "instructions",
        sa.Column("instruction_id", sa.Text(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("stream", sa.Integer(), nullable=False),
        sa.Column("seq", sa.Integer(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("mission_id", sa.Text(), nullable=True),
        sa.Column("mission_revision", sa.Integer(), nullable=True),
        sa.Column("status", sa.Text(), nullable=False),
        sa.Column("body", sa.Text(), nullable=False),
        sa.CheckConstraint(
            "status IN ('SENT', 'RECEIVED', 'ACCEPTED', 'REJECTED', 'REISSUED')",
            name="instruction_status",
        ),
        sa.ForeignKeyConstraint(
            ["mission_id"],
            ["missions.mission_id"],
        ),
        sa.PrimaryKeyConstraint("instruction_id"),
        sa.UniqueConstraint("drone_id", "stream", "seq", name="instruction_order"),
    )
    op.create_index("instructions_by_mission", "instructions", ["mission_id"], unique=False)
    op.create_table(
        "mission_steps",
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.Column("step_id", sa.Integer(), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("status", sa.Text(), nullable=False),
        sa.Column("step", sa.Text(), nullable=False),
        sa.Column("started_ms", sa.BigInteger(), nullable=True),
        sa.Column("ended_ms", sa.BigInteger(), nullable=True),
        sa.Column("event", sa.Text(), nullable=True),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("pad", sa.Integer(), nullable=True),
        sa.Column("planned_start_ms", sa.BigInteger(), nullable=False),
        sa.Column("planned_end_ms", sa.BigInteger(), nullable=False),
        sa.Column("from_station_id", sa.Text(), nullable=True),
        sa.Column("to_station_id", sa.Text(), nullable=True),
        sa.Column("lands", sa.Boolean(), nullable=True),
        sa.CheckConstraint("status IN ('PLANNED', 'ENDED', 'FAILED')", name="mission_step_status"),
        sa.ForeignKeyConstraint(
            ["mission_id"],
            ["missions.mission_id"],
        ),
        sa.PrimaryKeyConstraint("mission_id", "step_id"),
    )
    op.create_index("mission_steps_by_time", "mission_steps", ["ended_ms"], unique=False)
    op.create_index(
        "mission_steps_to_fly",
        "mission_steps",
        ["to_station_id", "from_station_id"],
        unique=False,
        sqlite_where=sa.text("status = 'PLANNED' AND kind = 'FLY'"),
        postgresql_where=sa.text("status = 'PLANNED' AND kind = 'FLY'"),
    )
    op.create_table(
        "no_shows",
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("code", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"],
            ["missions.mission_id"],
        ),
        sa.PrimaryKeyConstraint("mission_id"),
    )
    op.create_index("no_shows_by_time", "no_shows", ["at_ms", "provider_id"], unique=False)
    op.create_table(
        "pad_reservations",
        sa.Column("station_id", sa.Text(), nullable=False),
        sa.Column("pad", sa.Integer(), nullable=False),
        sa.Column("start_ms", sa.BigInteger(), nullable=False),
        sa.Column("end_ms", sa.BigInteger(), nullable=False),
        sa.Column("mission_id", sa.Text(), nullable=True),
        sa.Column("hold_id", sa.Text(), nullable=True),
        sa.Column("held_until_ms", sa.BigInteger(), nullable=True),
        sa.CheckConstraint(
            "(mission_id IS NULL) = (hold_id IS NOT NULL) AND (hold_id IS NULL) = (held_until_ms "
            "IS NULL)",
            name="pad_reservation_owner",
        ),
        sa.CheckConstraint("start_ms < end_ms", name="pad_reservation_lasts"),
        sa.ForeignKeyConstraint(
            ["hold_id"],
            ["offer_holds.hold_id"],
        ),
        sa.ForeignKeyConstraint(
            ["mission_id"],
            ["missions.mission_id"],
        ),
        sa.PrimaryKeyConstraint("station_id", "pad", "start_ms"),
    )
    op.create_index("pad_reservations_by_mission", "pad_reservations", ["mission_id"], unique=False)
    op.create_index(
        "pad_reservations_held",
        "pad_reservations",
        ["hold_id"],
        unique=False,
        sqlite_where=sa.text("hold_id IS NOT NULL"),
        postgresql_where=sa.text("hold_id IS NOT NULL"),
    )

    is_postgresql = op.get_bind().dialect.name == "postgresql"
    for statement in _POSTGRESQL if is_postgresql else _SQLITE:
        op.execute(statement)

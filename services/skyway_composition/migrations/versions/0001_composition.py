"""Composition's first tables, and the rule that no pad has two overlapping reservations."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

# I1 on PostgreSQL. GiST can compare text and integers only with btree_gist.
_NO_OVERLAP_POSTGRESQL = (
    "CREATE EXTENSION IF NOT EXISTS btree_gist",
    (
        "ALTER TABLE pad_reservations ADD CONSTRAINT pad_taken EXCLUDE USING gist "
        "(station_id WITH =, pad WITH =, int8range(start_ms, end_ms) WITH &&)"
    ),
)

_OVERLAPS = (
    "SELECT 1 FROM pad_reservations AS other WHERE other.station_id = NEW.station_id "
    "AND other.pad = NEW.pad AND other.start_ms < NEW.end_ms AND NEW.start_ms < other.end_ms"
)

# I1 on SQLite. A check before the write is safe, because SQLite has one writer.
_NO_OVERLAP_SQLITE = (
    (
        "CREATE TRIGGER pad_taken_on_insert BEFORE INSERT ON pad_reservations "
        f"WHEN EXISTS ({_OVERLAPS}) BEGIN SELECT RAISE(ABORT, 'pad_taken'); END"
    ),
    (
        "CREATE TRIGGER pad_taken_on_update BEFORE UPDATE ON pad_reservations "
        f"WHEN EXISTS ({_OVERLAPS} AND other.rowid <> OLD.rowid) "
        "BEGIN SELECT RAISE(ABORT, 'pad_taken'); END"
    ),
)


def upgrade() -> None:
    _create_world()
    _create_missions()
    _create_talk()
    is_postgresql = op.get_bind().dialect.name == "postgresql"
    for statement in _NO_OVERLAP_POSTGRESQL if is_postgresql else _NO_OVERLAP_SQLITE:
        op.execute(statement)


def _create_world() -> None:
    op.create_table(
        "networks",
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("published_ms", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("network_id"),
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


def _create_missions() -> None:
    op.create_table(
        "deliveries",
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("closed_ms", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("delivery_id"),
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
        sa.Column("retry_wall_ms", sa.BigInteger(), server_default="0", nullable=False),
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
    op.create_index("missions_by_provider", "missions", ["provider_id", "mission_id"], unique=False)
    op.create_index("missions_by_state", "missions", ["state", "released_ms"], unique=False)
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
        sa.CheckConstraint("status IN ('PLANNED', 'ENDED', 'FAILED')", name="mission_step_status"),
        sa.ForeignKeyConstraint(
            ["mission_id"],
            ["missions.mission_id"],
        ),
        sa.PrimaryKeyConstraint("mission_id", "step_id"),
    )
    op.create_table(
        "pad_reservations",
        sa.Column("station_id", sa.Text(), nullable=False),
        sa.Column("pad", sa.Integer(), nullable=False),
        sa.Column("start_ms", sa.BigInteger(), nullable=False),
        sa.Column("end_ms", sa.BigInteger(), nullable=False),
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.CheckConstraint("start_ms < end_ms", name="pad_reservation_lasts"),
        sa.ForeignKeyConstraint(
            ["mission_id"],
            ["missions.mission_id"],
        ),
        sa.PrimaryKeyConstraint("station_id", "pad", "start_ms"),
    )
    op.create_index("pad_reservations_by_mission", "pad_reservations", ["mission_id"], unique=False)
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
    op.create_index(
        "custody_delivered",
        "custody",
        ["delivery_id", "package_id"],
        unique=True,
        sqlite_where=sa.text("custodian_kind = 'RECIPIENT'"),
        postgresql_where=sa.text("custodian_kind = 'RECIPIENT'"),
    )


def _create_talk() -> None:
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
        sa.Column("connection", sa.Text(), nullable=True),
        sa.PrimaryKeyConstraint("drone_id"),
    )
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
        sa.Column("claimed_by", sa.Text(), nullable=True),
        sa.Column("claimed_until_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    op.create_index("outbox_message", "outbox", ["message_id"], unique=False)
    op.create_index("outbox_stream", "outbox", ["channel", "stream", "id"], unique=False)

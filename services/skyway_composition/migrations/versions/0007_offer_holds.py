"""Offers that are held: their drones and pads are taken until the hold expires."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None

_OWNER = (
    "(mission_id IS NULL) = (hold_id IS NOT NULL) AND (hold_id IS NULL) = (held_until_ms IS NULL)"
)

_OVERLAPS = (
    "SELECT 1 FROM pad_reservations AS other WHERE other.station_id = NEW.station_id "
    "AND other.pad = NEW.pad AND other.start_ms < NEW.end_ms AND NEW.start_ms < other.end_ms"
)

# SQLite cannot make a column nullable, so the table is made again, with its triggers.
_NEW_TABLE_SQLITE = (
    (
        "CREATE TABLE new_pad_reservations (station_id TEXT NOT NULL, pad INTEGER NOT NULL, "
        "start_ms BIGINT NOT NULL, end_ms BIGINT NOT NULL, mission_id TEXT, hold_id TEXT, "
        "held_until_ms BIGINT, PRIMARY KEY (station_id, pad, start_ms), "
        "CONSTRAINT pad_reservation_lasts CHECK (start_ms < end_ms), "
        f"CONSTRAINT pad_reservation_owner CHECK ({_OWNER}), "
        "FOREIGN KEY(mission_id) REFERENCES missions (mission_id), "
        "FOREIGN KEY(hold_id) REFERENCES offer_holds (hold_id))"
    ),
    (
        "INSERT INTO new_pad_reservations (station_id, pad, start_ms, end_ms, mission_id) "
        "SELECT station_id, pad, start_ms, end_ms, mission_id FROM pad_reservations"
    ),
    "DROP TABLE pad_reservations",
    "ALTER TABLE new_pad_reservations RENAME TO pad_reservations",
    "CREATE INDEX pad_reservations_by_mission ON pad_reservations (mission_id)",
    (
        "CREATE TRIGGER pad_taken_on_insert BEFORE INSERT ON pad_reservations "
        f"WHEN EXISTS ({_OVERLAPS}) BEGIN SELECT RAISE(ABORT, 'pad_taken'); END"
    ),
    (
        "CREATE TRIGGER pad_taken_on_update BEFORE UPDATE ON pad_reservations "
        f"WHEN EXISTS ({_OVERLAPS} AND other.rowid <> OLD.rowid) "
        "BEGIN SELECT RAISE(ABORT, 'pad_taken'); END"
    ),
    # A column with a check can be added, but not a check for it later.
    "ALTER TABLE drone_links ADD COLUMN held_by TEXT",
    (
        "ALTER TABLE drone_links ADD COLUMN held_until_ms BIGINT "
        "CONSTRAINT drone_held CHECK ((held_by IS NULL) = (held_until_ms IS NULL))"
    ),
)

_NEW_COLUMNS_POSTGRESQL = (
    "ALTER TABLE pad_reservations ALTER COLUMN mission_id DROP NOT NULL",
    "ALTER TABLE pad_reservations ADD COLUMN hold_id TEXT REFERENCES offer_holds (hold_id)",
    "ALTER TABLE pad_reservations ADD COLUMN held_until_ms BIGINT",
    f"ALTER TABLE pad_reservations ADD CONSTRAINT pad_reservation_owner CHECK ({_OWNER})",
    "ALTER TABLE drone_links ADD COLUMN held_by TEXT",
    "ALTER TABLE drone_links ADD COLUMN held_until_ms BIGINT",
    (
        "ALTER TABLE drone_links ADD CONSTRAINT drone_held "
        "CHECK ((held_by IS NULL) = (held_until_ms IS NULL))"
    ),
)


def upgrade() -> None:
    op.create_table(
        "offer_holds",
        sa.Column("hold_id", sa.Text(), nullable=False),
        sa.Column("customer_id", sa.Text(), nullable=False),
        sa.Column("slot", sa.SmallInteger(), nullable=True),
        sa.Column("until_ms", sa.BigInteger(), nullable=False),
        sa.Column("offers", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("hold_id"),
        sa.UniqueConstraint("customer_id", "slot", name="hold_slot"),
        sa.CheckConstraint("slot >= 1", name="hold_slot_counts"),
    )
    op.create_index("offer_holds_by_end", "offer_holds", ["until_ms"])
    is_postgresql = op.get_bind().dialect.name == "postgresql"
    for statement in _NEW_COLUMNS_POSTGRESQL if is_postgresql else _NEW_TABLE_SQLITE:
        op.execute(statement)
    for name, table, column, condition in (
        ("pad_reservations_held", "pad_reservations", "hold_id", "hold_id IS NOT NULL"),
        ("drone_links_held", "drone_links", "drone_id", "held_by IS NOT NULL"),
    ):
        op.create_index(
            name,
            table,
            [column],
            sqlite_where=sa.text(condition),
            postgresql_where=sa.text(condition),
        )

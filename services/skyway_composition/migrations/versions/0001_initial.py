"""The tables of composition, as `tables` has them, and rules that no pad or drone is taken twice.

The first release writes the tables out here.
"""

from alembic import op
from skyway_composition.tables import metadata

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
    metadata.create_all(op.get_bind())
    is_postgresql = op.get_bind().dialect.name == "postgresql"
    for statement in _POSTGRESQL if is_postgresql else _SQLITE:
        op.execute(statement)

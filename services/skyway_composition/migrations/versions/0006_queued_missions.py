"""Missions that wait in their drone's calendar, and the rule that these do not overlap."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

# int8range with equal ends is empty and overlaps nothing.
_NO_OVERLAP_POSTGRESQL = (
    "ALTER TABLE missions ADD CONSTRAINT drone_time_taken EXCLUDE USING gist "
    "(drone_id WITH =, int8range(start_ms, served_ms) WITH &&) WHERE (state = 'QUEUED')"
)

_OVERLAPS = (
    "NEW.state = 'QUEUED' AND NEW.start_ms < NEW.served_ms AND EXISTS ("
    "SELECT 1 FROM missions AS other WHERE other.drone_id = NEW.drone_id "
    "AND other.mission_id <> NEW.mission_id AND other.state = 'QUEUED' "
    "AND other.start_ms < other.served_ms "
    "AND other.start_ms < NEW.served_ms AND NEW.start_ms < other.served_ms)"
)

# A check before the write is safe on SQLite, because SQLite has one writer.
_NO_OVERLAP_SQLITE = tuple(
    f"CREATE TRIGGER drone_time_taken_on_{verb.lower()} BEFORE {verb} ON missions "
    f"WHEN {_OVERLAPS} BEGIN SELECT RAISE(ABORT, 'drone_time_taken'); END"
    for verb in ("INSERT", "UPDATE")
)


def upgrade() -> None:
    for column in (
        sa.Column("stays", sa.Text(), nullable=True),
        sa.Column("served_ms", sa.BigInteger(), nullable=True),
        sa.Column("planned_version", sa.Integer(), nullable=True),
        sa.Column("planned_conditions", sa.BigInteger(), nullable=True),
    ):
        op.add_column("missions", column)
    op.create_index(
        "missions_queued",
        "missions",
        ["drone_id", "start_ms"],
        sqlite_where=sa.text("state = 'QUEUED'"),
        postgresql_where=sa.text("state = 'QUEUED'"),
    )
    if op.get_bind().dialect.name == "postgresql":
        op.execute(_NO_OVERLAP_POSTGRESQL)
    else:
        for statement in _NO_OVERLAP_SQLITE:
            op.execute(statement)

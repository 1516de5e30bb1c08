"""The planned end of each mission's next step, to find missions that are late."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

_IS_UNDER_WAY = "state IN ('ACCEPTED', 'ACTIVE')"


def upgrade() -> None:
    op.add_column("missions", sa.Column("next_end_ms", sa.BigInteger(), nullable=True))
    op.create_index(
        "missions_by_next_end",
        "missions",
        ["next_end_ms"],
        sqlite_where=sa.text(_IS_UNDER_WAY),
        postgresql_where=sa.text(_IS_UNDER_WAY),
    )
    missions = sa.table(
        "missions", *(sa.column(name) for name in ("mission_id", "state", "next_end_ms"))
    )
    steps = sa.table(
        "mission_steps", *(sa.column(name) for name in ("mission_id", "status", "planned_end_ms"))
    )
    first_end_ms = (
        sa.select(sa.func.min(steps.c.planned_end_ms))
        .where(steps.c.mission_id == missions.c.mission_id, steps.c.status == "PLANNED")
        .correlate(missions)
        .scalar_subquery()
    )
    is_under_way = missions.c.state.in_(("ACCEPTED", "ACTIVE"))
    op.execute(missions.update().where(is_under_way).values(next_end_ms=first_end_ms))

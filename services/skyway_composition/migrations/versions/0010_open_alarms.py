"""An index of the open alarms of each drone."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_index(
        "alarms_open_of_drone",
        "alarms",
        ["drone_id", "level"],
        sqlite_where=sa.text("acknowledged_ms IS NULL"),
        postgresql_where=sa.text("acknowledged_ms IS NULL"),
    )

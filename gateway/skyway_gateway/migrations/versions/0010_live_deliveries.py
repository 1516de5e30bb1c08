"""The deliveries of a customer that are not over can be counted."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

_IS_LIVE = "state IN ('SCHEDULED', 'REQUESTED', 'PLANNED', 'DISPATCHED', 'LOADING', 'IN_PROGRESS')"


def upgrade() -> None:
    op.create_index(
        "deliveries_live",
        "deliveries",
        ["customer_id", "state"],
        sqlite_where=sa.text(_IS_LIVE),
        postgresql_where=sa.text(_IS_LIVE),
    )

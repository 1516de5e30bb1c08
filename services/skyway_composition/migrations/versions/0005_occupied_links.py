"""Occupied drones found among those few, and room to rewrite links where they stand.

A link is written with every word of its drone. Where its page has room, PostgreSQL needs no new
entry in any index; where it has none, whoever looks for the link passes all that it was before.
"""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_index(
        "drone_links_occupied",
        "drone_links",
        ["drone_id"],
        sqlite_where=sa.text("is_occupied = 1"),
        postgresql_where=sa.text("is_occupied"),
    )
    if op.get_bind().dialect.name == "postgresql":
        op.execute("ALTER TABLE drone_links SET (fillfactor = 50)")

"""An index of occupied drones, and free space in the pages of links.

Every message of a drone rewrites its link. While the page has free space, PostgreSQL needs no new
index entry. Without free space, every search for the link also reads its old row versions.
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

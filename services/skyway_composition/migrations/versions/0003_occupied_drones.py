"""A column for drones that report a mission, or have landed away from every station."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column(
        "drone_links",
        sa.Column("is_occupied", sa.Boolean(), server_default=sa.false(), nullable=False),
    )
    links = sa.table(
        "drone_links", sa.column("state", sa.Text), sa.column("is_occupied", sa.Boolean)
    )
    says_so = links.c.state.contains('"mission_id":"', autoescape=True)
    op.execute(links.update().where(says_so).values(is_occupied=sa.true()))

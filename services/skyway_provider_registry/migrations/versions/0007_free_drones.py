"""When and where drones with missions can begin another mission."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    for column in (
        sa.Column("free_ms", sa.BigInteger(), nullable=True),
        sa.Column("free_station_id", sa.Text(), nullable=True),
        sa.Column("free_soc", sa.Double(), nullable=True),
    ):
        op.add_column("mission_hints", column)

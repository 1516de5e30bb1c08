"""What the flights of each drone have shown about it."""

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "learned_values",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("flights", sa.BigInteger(), nullable=False),
        sa.Column("recharges", sa.BigInteger(), nullable=False),
        sa.Column("still_air_factor", sa.Double(), nullable=False),
        sa.Column("state_of_health", sa.Double(), nullable=False),
        sa.Column("charge_rate_factor", sa.Double(), nullable=False),
        sa.Column("is_maintenance_due", sa.Boolean(), nullable=False),
        sa.Column("learned_session", sa.BigInteger(), nullable=False),
        sa.Column("learned_seq", sa.BigInteger(), nullable=False),
        sa.Column("learned_ms", sa.BigInteger(), nullable=False),
        sa.Column("since_ms", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
    )

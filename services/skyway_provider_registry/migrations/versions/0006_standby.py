"""What drones do when they are idle: a setting of each provider, and of a drone if it has one."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


_CHOICES = "standby IN ('HOME', 'STAY', 'PARKING')"


def upgrade() -> None:
    # Constraints of the columns themselves: SQLite adds no constraint to an existing table.
    op.add_column(
        "providers",
        sa.Column(
            "standby",
            sa.Text(),
            sa.CheckConstraint(_CHOICES, name="provider_standby"),
            server_default="HOME",
            nullable=False,
        ),
    )
    op.add_column(
        "drones",
        sa.Column("standby", sa.Text(), sa.CheckConstraint(_CHOICES, name="drone_standby")),
    )

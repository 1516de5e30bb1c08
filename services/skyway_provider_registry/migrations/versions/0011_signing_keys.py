"""The public keys with which drones sign their messages."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "drone_signing_keys",
        sa.Column(
            "drone_id",
            sa.Text,
            sa.ForeignKey("drones.drone_id", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column("is_required", sa.Boolean, nullable=False),
        sa.Column("public_key", sa.Text),
        sa.Column("next_public_key", sa.Text),
        sa.CheckConstraint("is_required OR public_key IS NULL", name="drone_signing_required"),
    )
    op.create_index("renewals_by_moment", "renewals", ["renewed_wall_ms"])

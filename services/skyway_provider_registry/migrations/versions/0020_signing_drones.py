"""A drone that has ever signed is noted in its own row, too."""

import sqlalchemy as sa
from alembic import op

revision = "0020"
down_revision = "0019"
branch_labels = None
depends_on = None


def upgrade() -> None:
    signing = sa.Column("is_signing", sa.Boolean, nullable=False, server_default=sa.false())
    op.add_column("drones", signing)
    op.execute(
        "UPDATE drones SET is_signing = (1 = 1) WHERE drone_id IN"
        " (SELECT drone_id FROM drone_signing_keys WHERE is_required)"
    )

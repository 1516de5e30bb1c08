"""How much the energy use of each drone varies from flight to flight."""

import sqlalchemy as sa
from alembic import op

revision = "0017"
down_revision = "0016"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # The default is that of a drone that has not flown: the square of 0.08.
    op.add_column(
        "learned_values",
        sa.Column("still_air_variance", sa.Double(), nullable=False, server_default="0.0064"),
    )

"""How much drones are ahead of what they can have flown and charged."""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None


def upgrade() -> None:
    for name in ("ahead_m", "ahead_soc"):
        op.add_column("presence", sa.Column(name, sa.Double(), nullable=False, server_default="0"))

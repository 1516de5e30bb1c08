"""The gateway keeps the table of cells, for the requests before it has read the table."""

import sqlalchemy as sa
from alembic import op

revision = "0020"
down_revision = "0019"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "known_cells",
        sa.Column("only", sa.SmallInteger(), nullable=False, autoincrement=False),
        sa.Column("cells", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("only"),
    )

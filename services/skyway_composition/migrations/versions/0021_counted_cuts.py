"""A mission counts its cut steps, so that a lost one is noticed."""

import sqlalchemy as sa
from alembic import op

revision = "0021"
down_revision = "0020"
branch_labels = None
depends_on = None


def upgrade() -> None:
    cuts = sa.Column("cuts", sa.Integer(), nullable=False, server_default="0")
    op.add_column("missions", cuts)
    op.execute(
        "UPDATE missions SET cuts = (SELECT count(*) FROM cut_steps"
        " WHERE cut_steps.mission_id = missions.mission_id)"
    )

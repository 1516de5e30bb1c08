"""The custody of a mission is found by its mission, so that the mission can be deleted."""

from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_index("custody_by_mission", "custody", ["mission_id"])

"""The tables of the gateway, as `tables` has them; the first release writes them out here."""

import sqlalchemy as sa
from alembic import op
from skyway_gateway.tables import audit_head, metadata

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    metadata.create_all(op.get_bind())
    # The audit log begins without entries.
    begin = {"only": 1, "entries": 0, "hash": "", "pruned_entries": 0, "pruned_hash": ""}
    op.execute(sa.insert(audit_head).values(begin))

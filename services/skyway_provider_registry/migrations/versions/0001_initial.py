"""The tables of the registry, as `tables` has them; the first release writes them out here."""

from alembic import op
from skyway_provider_registry.tables import metadata

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    metadata.create_all(op.get_bind())

"""Operators have broker accounts of their own."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

_ACCOUNTS = sa.Table(
    "broker_accounts",
    sa.MetaData(),
    sa.Column("user_name", sa.Text, primary_key=True),
    sa.Column("kind", sa.Text, nullable=False),
    sa.Column("password_hash", sa.Text, nullable=False),
    sa.Column("revoked_wall_ms", sa.BigInteger),
    sa.CheckConstraint("kind IN ('DRONE', 'CUSTOMER')", name="broker_account_kind"),
)


def upgrade() -> None:
    with op.batch_alter_table("broker_accounts", copy_from=_ACCOUNTS) as batch:
        batch.drop_constraint("broker_account_kind", type_="check")
        batch.create_check_constraint(
            "broker_account_kind", "kind IN ('DRONE', 'CUSTOMER', 'OPERATOR')"
        )

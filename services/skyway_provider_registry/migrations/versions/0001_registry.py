"""The registry's first tables."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "providers",
        sa.Column("provider_id", sa.Text, primary_key=True),
        sa.Column("name", sa.Text, nullable=False),
        sa.Column("tariff", sa.Text, nullable=False),
        sa.Column("terms", sa.Text),
        sa.Column("state", sa.Text, nullable=False),
        sa.Column("created_ms", sa.BigInteger, nullable=False),
        sa.CheckConstraint("state IN ('ACTIVE', 'SUSPENDED')", name="provider_state"),
    )
    op.create_table(
        "drone_models",
        sa.Column("model_id", sa.Text, primary_key=True),
        sa.Column("model", sa.Text, nullable=False),
    )
    op.create_table(
        "drones",
        sa.Column("drone_id", sa.Text, primary_key=True),
        sa.Column("provider_id", sa.Text, sa.ForeignKey("providers.provider_id"), nullable=False),
        sa.Column("model_id", sa.Text, nullable=False),
        sa.Column("home_station_id", sa.Text, nullable=False),
        sa.Column("home_longitude_deg", sa.Double, nullable=False),
        sa.Column("home_latitude_deg", sa.Double, nullable=False),
        sa.Column("name", sa.Text),
        sa.Column("registration", sa.Text),
        sa.Column("initial_soc", sa.Double, nullable=False),
        sa.Column("is_in_maintenance", sa.Boolean, nullable=False),
        sa.Column("created_ms", sa.BigInteger, nullable=False),
        sa.UniqueConstraint("provider_id", "registration", name="drone_registration"),
    )
    op.create_index("drones_by_provider", "drones", ["provider_id", "drone_id"])
    op.create_index("drones_by_model", "drones", ["model_id"])
    op.create_table(
        "presence",
        sa.Column(
            "drone_id",
            sa.Text,
            sa.ForeignKey("drones.drone_id", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column("connection_session", sa.BigInteger, nullable=False),
        sa.Column("connection_number", sa.BigInteger, nullable=False),
        sa.Column("connection_rank", sa.BigInteger, nullable=False),
        sa.Column("connection_status", sa.Text),
        sa.Column("state_session", sa.BigInteger, nullable=False),
        sa.Column("state_seq", sa.BigInteger, nullable=False),
        sa.Column("state_at_ms", sa.BigInteger),
        sa.Column("activity", sa.Text),
        sa.Column("mission_id", sa.Text),
        sa.Column("station_id", sa.Text),
        sa.Column("longitude_deg", sa.Double),
        sa.Column("latitude_deg", sa.Double),
        sa.Column("soc", sa.Double),
        sa.Column("sample_session", sa.BigInteger, nullable=False),
        sa.Column("sample_seq", sa.BigInteger, nullable=False),
        sa.Column("sample_at_ms", sa.BigInteger),
        sa.Column("sample_longitude_deg", sa.Double),
        sa.Column("sample_latitude_deg", sa.Double),
        sa.Column("sample_soc", sa.Double),
        sa.Column("last_seen_ms", sa.BigInteger),
        sa.Column("last_seen_wall_ms", sa.BigInteger),
    )
    op.create_table(
        "mission_hints",
        sa.Column("mission_id", sa.Text, primary_key=True),
        sa.Column(
            "drone_id",
            sa.Text,
            sa.ForeignKey("drones.drone_id", ondelete="CASCADE"),
            nullable=False,
        ),
        sa.Column("seq", sa.BigInteger, nullable=False),
        sa.Column("mission_state", sa.Text, nullable=False),
        sa.Column("is_live", sa.Boolean, nullable=False),
        sa.Column("reported_wall_ms", sa.BigInteger, nullable=False),
    )
    op.create_index("mission_hints_by_drone", "mission_hints", ["drone_id", "is_live"])
    op.create_table(
        "broker_accounts",
        sa.Column("user_name", sa.Text, primary_key=True),
        sa.Column("kind", sa.Text, nullable=False),
        sa.Column("password_hash", sa.Text, nullable=False),
        sa.CheckConstraint("kind IN ('DRONE', 'CUSTOMER')", name="broker_account_kind"),
    )
    op.create_table(
        "idempotency",
        sa.Column("key_hash", sa.Text, primary_key=True),
        sa.Column("body_hash", sa.LargeBinary, nullable=False),
        sa.Column("answer", sa.LargeBinary),
        sa.Column("created_at_ms", sa.BigInteger, nullable=False),
    )
    op.create_index("idempotency_age", "idempotency", ["created_at_ms"])

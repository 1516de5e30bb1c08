"""What happens in the world, plans that live, alarms and cancellations."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column(
        "networks", sa.Column("conditions", sa.BigInteger(), server_default="0", nullable=False)
    )
    for column in (
        sa.Column("trouble", sa.Text(), nullable=True),
        sa.Column("proposal", sa.Text(), nullable=True),
        sa.Column("aims", sa.Text(), server_default="[]", nullable=False),
        sa.Column("loading", sa.Text(), server_default="AUTOMATIC", nullable=False),
    ):
        op.add_column("missions", column)
    for column in (
        sa.Column("kind", sa.Text(), nullable=True),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("pad", sa.Integer(), nullable=True),
    ):
        op.add_column("mission_steps", column)
    op.create_index("mission_steps_by_time", "mission_steps", ["ended_ms"])
    _create_closures()
    _create_alarms()
    _create_cancellations()


def _create_closures() -> None:
    op.create_table(
        "closures",
        sa.Column("closure_id", sa.Text(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("network_id", sa.Text(), nullable=True),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("pad", sa.Integer(), nullable=True),
        sa.Column("to_station_id", sa.Text(), nullable=True),
        sa.Column("area", sa.Text(), nullable=True),
        sa.Column("provider_id", sa.Text(), nullable=True),
        sa.Column("drone_model_id", sa.Text(), nullable=True),
        sa.Column("reason", sa.Text(), nullable=True),
        sa.Column("from_ms", sa.BigInteger(), nullable=False),
        sa.Column("until_ms", sa.BigInteger(), nullable=True),
        sa.Column("made_ms", sa.BigInteger(), nullable=False),
        sa.Column("lifted_ms", sa.BigInteger(), nullable=True),
        sa.CheckConstraint(
            "kind IN ('STATION', 'PAD', 'SEGMENT', 'ZONE', 'GROUND_STOP')", name="closure_kind"
        ),
        sa.CheckConstraint("until_ms IS NULL OR from_ms < until_ms", name="closure_lasts"),
        sa.ForeignKeyConstraint(["network_id"], ["networks.network_id"]),
        sa.PrimaryKeyConstraint("closure_id"),
    )
    op.create_index("closures_in_force", "closures", ["network_id", "lifted_ms", "until_ms"])
    op.create_index("closures_by_station", "closures", ["station_id"])


def _create_alarms() -> None:
    op.create_table(
        "alarms",
        sa.Column("alarm_id", sa.Text(), nullable=False),
        sa.Column("level", sa.Text(), nullable=False),
        sa.Column("code", sa.Text(), nullable=False),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=True),
        sa.Column("drone_id", sa.Text(), nullable=True),
        sa.Column("mission_id", sa.Text(), nullable=True),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("data", sa.Text(), nullable=False),
        sa.Column("acknowledged_ms", sa.BigInteger(), nullable=True),
        sa.Column("acknowledged_by", sa.Text(), nullable=True),
        sa.Column("note", sa.Text(), nullable=True),
        sa.CheckConstraint("level IN ('WARNING', 'URGENT', 'CRITICAL')", name="alarm_level"),
        sa.PrimaryKeyConstraint("alarm_id"),
    )
    op.create_index("alarms_open", "alarms", ["acknowledged_ms", "alarm_id"])


def _create_cancellations() -> None:
    op.create_table(
        "cancellations",
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("cancellation_id", sa.Text(), nullable=False),
        sa.Column("answer", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["delivery_id"], ["deliveries.delivery_id"]),
        sa.PrimaryKeyConstraint("delivery_id", "cancellation_id"),
    )

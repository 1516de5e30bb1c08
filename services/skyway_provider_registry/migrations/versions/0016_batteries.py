"""Batteries of providers, what drones have flown, and rules for their maintenance."""

import sqlalchemy as sa
from alembic import op

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None


def upgrade() -> None:
    for name in ("flown_s", "used_soc"):
        op.add_column("presence", sa.Column(name, sa.Double(), nullable=False, server_default="0"))
        op.add_column(
            "drones",
            sa.Column(f"maintained_{name}", sa.Double(), nullable=False, server_default="0"),
        )
    for name in ("maintained_ms", "maintenance_due_ms", "battery_changed_ms"):
        op.add_column("drones", sa.Column(name, sa.BigInteger(), nullable=True))
    op.add_column(
        "learned_values",
        sa.Column("health_observations", sa.BigInteger(), nullable=False, server_default="0"),
    )
    op.execute("UPDATE learned_values SET health_observations = flights + recharges")
    op.create_table(
        "batteries",
        sa.Column("battery_id", sa.Text(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("model_id", sa.Text(), nullable=False),
        sa.Column("serial", sa.Text(), nullable=False),
        sa.Column("capacity_j", sa.Double(), nullable=False),
        sa.Column("state_of_health", sa.Double(), nullable=False),
        sa.Column("health_observations", sa.BigInteger(), nullable=False),
        sa.Column("used_soc", sa.Double(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=True),
        sa.Column("installed_ms", sa.BigInteger(), nullable=True),
        sa.Column("installed_used_soc", sa.Double(), nullable=True),
        sa.Column("created_ms", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["provider_id"], ["providers.provider_id"]),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"]),
        sa.PrimaryKeyConstraint("battery_id"),
        sa.UniqueConstraint("provider_id", "serial", name="battery_serial"),
        sa.UniqueConstraint("drone_id", name="battery_of_drone"),
    )
    op.create_index("batteries_by_provider", "batteries", ["provider_id", "battery_id"])
    op.create_table(
        "past_installations",
        sa.Column("battery_id", sa.Text(), nullable=False),
        sa.Column("installed_ms", sa.BigInteger(), nullable=False),
        sa.Column("removed_ms", sa.BigInteger(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("used_soc", sa.Double(), nullable=False),
        sa.ForeignKeyConstraint(["battery_id"], ["batteries.battery_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("battery_id", "installed_ms"),
    )
    op.create_table(
        "maintenance_rules",
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("model_id", sa.Text(), nullable=False),
        sa.Column("every_flight_s", sa.Double(), nullable=True),
        sa.Column("every_cycles", sa.Double(), nullable=True),
        sa.ForeignKeyConstraint(["provider_id"], ["providers.provider_id"]),
        sa.PrimaryKeyConstraint("provider_id", "model_id"),
    )

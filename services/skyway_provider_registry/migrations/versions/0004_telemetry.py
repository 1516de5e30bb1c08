"""What drones measured, for a while, and how they are."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("presence", sa.Column("condition", sa.Text()))
    op.create_table(
        "telemetry_samples",
        *_key_and_place(),
        sa.Column("soc", sa.Double(), nullable=False),
        sa.Column("power_w", sa.Double(), nullable=False),
        sa.Column("speed_mps", sa.Double(), nullable=False),
        sa.Column("voltage_v", sa.Double()),
        sa.Column("temperature_c", sa.Double()),
        sa.Column("range_m", sa.Double()),
        sa.PrimaryKeyConstraint("drone_id", "at_ms"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "telemetry_minutes",
        *_key_and_place(),
        sa.Column("samples", sa.BigInteger(), nullable=False),
        *(
            sa.Column(f"{prefix}{name}", sa.Double(), nullable=False)
            for name in ("soc", "power_w", "speed_mps")
            for prefix in ("", "min_", "max_")
        ),
        sa.PrimaryKeyConstraint("drone_id", "at_ms"),
        sqlite_with_rowid=False,
    )


def _key_and_place() -> tuple[sa.Column[str] | sa.Column[int] | sa.Column[float], ...]:
    return (
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), nullable=False),
        sa.Column("heard_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("longitude_deg", sa.Double(), nullable=False),
        sa.Column("latitude_deg", sa.Double(), nullable=False),
    )

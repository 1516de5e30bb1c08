"""Tables for closures, new revisions of plans, alarms and cancellations."""

import json
from datetime import datetime

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
    for of_step in (
        sa.Column("kind", sa.Text(), nullable=True),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("pad", sa.Integer(), nullable=True),
        sa.Column("planned_start_ms", sa.BigInteger(), nullable=True),
        sa.Column("planned_end_ms", sa.BigInteger(), nullable=True),
        sa.Column("from_station_id", sa.Text(), nullable=True),
        sa.Column("to_station_id", sa.Text(), nullable=True),
        sa.Column("lands", sa.Boolean(), nullable=True),
    ):
        op.add_column("mission_steps", of_step)
    op.create_index("mission_steps_by_time", "mission_steps", ["ended_ms"])
    op.create_index(
        "mission_steps_to_fly",
        "mission_steps",
        ["to_station_id", "from_station_id"],
        sqlite_where=sa.text("status = 'PLANNED' AND kind = 'FLY'"),
        postgresql_where=sa.text("status = 'PLANNED' AND kind = 'FLY'"),
    )
    _fill_planned_steps()
    _create_cut_steps()
    _create_closures()
    _create_alarms()
    _create_cancellations()


def _fill_planned_steps() -> None:
    """Fill the new columns of planned steps, so that closures find missions under way."""
    steps = sa.table(
        "mission_steps",
        *(sa.column(name) for name in ("mission_id", "step_id", "status", "step", "kind")),
        *(sa.column(name) for name in ("station_id", "pad", "planned_start_ms")),
        *(sa.column(name) for name in ("planned_end_ms", "from_station_id", "to_station_id")),
        sa.column("lands", sa.Boolean()),
    )
    bind = op.get_bind()
    planned = bind.execute(
        sa.select(steps.c.mission_id, steps.c.step_id, steps.c.step).where(
            steps.c.status == "PLANNED"
        )
    ).all()
    for row in planned:
        step = json.loads(row.step)
        bind.execute(
            sa.update(steps)
            .where(steps.c.mission_id == row.mission_id, steps.c.step_id == row.step_id)
            .values(
                kind=step["kind"],
                station_id=step.get("station_id"),
                pad=step.get("pad"),
                planned_start_ms=_unix_ms(step["planned_start_at"]),
                planned_end_ms=_unix_ms(step["planned_end_at"]),
                from_station_id=step.get("from"),
                to_station_id=step.get("to"),
                lands=step.get("lands"),
            )
        )


def _unix_ms(moment: str) -> int:
    return round(datetime.fromisoformat(moment).timestamp() * 1000)


def _create_cut_steps() -> None:
    op.create_table(
        "cut_steps",
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.Column("seq", sa.BigInteger(), nullable=False),
        sa.Column("step_id", sa.Integer(), nullable=True),
        sa.Column("kind", sa.Text(), nullable=True),
        sa.Column("station_id", sa.Text(), nullable=True),
        sa.Column("started_ms", sa.BigInteger(), nullable=False),
        sa.Column("ended_ms", sa.BigInteger(), nullable=False),
        sa.Column("event", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["mission_id"], ["missions.mission_id"]),
        sa.PrimaryKeyConstraint("mission_id", "seq"),
    )
    op.create_index("cut_steps_by_time", "cut_steps", ["ended_ms"])


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

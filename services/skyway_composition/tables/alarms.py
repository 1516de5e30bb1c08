"""The table of alarms."""

from sqlalchemy import BigInteger, CheckConstraint, Column, Index, Table, Text

from skyway_composition.tables.metadata import metadata

#: Problems that operators must acknowledge, or have acknowledged.
alarms = Table(
    "alarms",
    metadata,
    Column("alarm_id", Text, primary_key=True),
    Column("level", Text, nullable=False),
    Column("code", Text, nullable=False),
    Column("detail", Text, nullable=False),
    Column("at_ms", BigInteger, nullable=False),
    Column("provider_id", Text),
    Column("drone_id", Text),
    Column("mission_id", Text),
    Column("station_id", Text),
    Column("data", Text, nullable=False),  # JSON object
    Column("acknowledged_ms", BigInteger),
    Column("acknowledged_by", Text),
    Column("note", Text),  # the remark of the operator who acknowledged the alarm
    CheckConstraint("level IN ('WARNING', 'URGENT', 'CRITICAL')", name="alarm_level"),
    Index("alarms_open", "acknowledged_ms", "alarm_id"),
)

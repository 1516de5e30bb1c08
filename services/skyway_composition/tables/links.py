"""The tables of what drones send: their links, messages that were set aside, and no-shows."""

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    Table,
    Text,
    UniqueConstraint,
    false,
    text,
)

from skyway.runtime.sql.partial_index import partial_index
from skyway_composition.tables.networks import metadata

#: The instructions to drones, and how the drones answered.
instructions = Table(
    "instructions",
    metadata,
    Column("instruction_id", Text, primary_key=True),
    Column("drone_id", Text, nullable=False),
    Column("stream", Integer, nullable=False),
    Column("seq", Integer, nullable=False),
    Column("kind", Text, nullable=False),
    Column("mission_id", Text, ForeignKey("missions.mission_id")),
    Column("mission_revision", Integer),
    Column("status", Text, nullable=False),
    Column("body", Text, nullable=False),  # JSON of Instruction
    CheckConstraint(
        "status IN ('SENT', 'RECEIVED', 'ACCEPTED', 'REJECTED', 'REISSUED')",
        name="instruction_status",
    ),
    UniqueConstraint("drone_id", "stream", "seq", name="instruction_order"),
    Index("instructions_by_mission", "mission_id"),
)

#: The link to each drone: the number of our last instruction, and the drone's last messages.
drone_links = Table(
    "drone_links",
    metadata,
    Column("drone_id", Text, primary_key=True),
    Column("provider_id", Text, nullable=False),
    Column("stream", Integer, nullable=False),  # 0 before the first instruction
    Column("last_seq", Integer, nullable=False),  # of the instructions in this stream
    Column("acked_stream", Integer, nullable=False),  # the last stream that the drone confirmed
    Column("acked_session", BigInteger, nullable=False),  # the session in which it did so
    Column("last_event_seq", BigInteger, nullable=False),
    Column("report_asked_wall_ms", BigInteger, nullable=False),
    Column("state", Text),  # JSON of DroneState, the newest
    # Whether this state reports a mission, or a landing away from every station.
    Column("is_occupied", Boolean, nullable=False, server_default=false()),
    Column("connection", Text),  # JSON of Connection, the newest
    # The hold that keeps the drone for a customer, and until when: no other booking gets the drone.
    Column("held_by", Text),
    Column("held_until_ms", BigInteger),
    # The number of its calendar: raised whenever it changes (`calendar.snapshot`).
    Column("calendar_version", BigInteger, nullable=False, server_default="0"),
    # When the drone's credentials were renewed last; earlier messages may be anybody's.
    Column("renewed_ms", BigInteger),
    CheckConstraint("(held_by IS NULL) = (held_until_ms IS NULL)", name="drone_held"),
    # Finds occupied drones without reading the links of all others.
    Index(
        "drone_links_occupied",
        "drone_id",
        sqlite_where=text("is_occupied = 1"),
        postgresql_where=text("is_occupied"),
    ),
    # Finds held drones without reading the links of all others.
    partial_index("drone_links_held", "drone_id", where="held_by IS NOT NULL"),
)


#: The messages of drones that were not taken, each once however often it came.
quarantine = Table(
    "quarantine",
    metadata,
    Column("quarantine_id", Text, primary_key=True),
    Column("topic", Text, nullable=False),
    Column("provider_id", Text, nullable=False),
    Column("drone_id", Text, nullable=False),
    Column("reason", Text, nullable=False),
    Column("detail", Text, nullable=False),
    Column("payload", LargeBinary, nullable=False),  # the first bytes of it
    Column("payload_sha256", Text, nullable=False),  # of the whole payload
    Column("size_bytes", BigInteger, nullable=False),  # of the whole payload
    Column("times", BigInteger, nullable=False),
    Column("first_ms", BigInteger, nullable=False),
    Column("last_ms", BigInteger, nullable=False),
    Column("last_wall_ms", BigInteger, nullable=False),
    UniqueConstraint("topic", "payload_sha256", name="quarantine_once"),
    Index("quarantine_by_provider", "provider_id", "drone_id"),
)


#: A mission that ended because its drone did not answer, or fell silent. Rows are only added.
no_shows = Table(
    "no_shows",
    metadata,
    Column("mission_id", Text, ForeignKey("missions.mission_id"), primary_key=True),
    Column("provider_id", Text, nullable=False),
    Column("drone_id", Text, nullable=False),
    Column("code", Text, nullable=False),
    Column("at_ms", BigInteger, nullable=False),
    Index("no_shows_by_time", "at_ms", "provider_id"),
)

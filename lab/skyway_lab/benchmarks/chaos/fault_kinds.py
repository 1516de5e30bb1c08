"""The kinds of faults: what they hit, how long they last, what they are and what to expect."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from skyway_lab.benchmarks.load.burst import Storage

_SERVICES: Final = ("gateway", "composition", "registry", "broker", "drones")
_ONE_OF_TWO: Final = ("one gateway", "one composition")
_WIRES: Final = (
    "gateway to registry",
    "gateway to composition",
    "composition to gateway",
    "composition to registry",
    "registry to broker",
    "gateway to broker",
    "composition to broker",
    "drones to broker",
    "customers to gateway",
    "gateway to webhooks",
)
_DATABASE_WIRES: Final = ("gateway to database", "composition to database")
_BUSY_WIRES: Final = ("gateway to composition", "composition to gateway", "drones to broker")
_DATABASES: Final = ("gateway", "composition", "registry")


@dataclass(frozen=True, slots=True)
class FaultKind:
    """A kind of fault; `lasts_s` are the shortest and the longest wall seconds until it heals."""

    name: str
    embedded: tuple[str, ...]
    production: tuple[str, ...]
    lasts_s: tuple[float, float]
    what: str
    expect: str
    #: Whether this machine must let us mount a file system, or change attributes of files.
    needs_root: bool = False

    def targets(self, storage: Storage) -> tuple[str, ...]:
        """What it hits on this pair."""
        return self.embedded if storage == "embedded" else self.production


KINDS: Final = (
    FaultKind(
        "kill",
        (*_SERVICES, "everything"),
        (*_SERVICES, *_ONE_OF_TWO, "postgresql", "everything"),
        (0.5, 1.0),
        "Processes end without a warning (SIGKILL) and are started again within a second.",
        "Answered requests go on. A request without an answer is sent again under its "
        "Idempotency-Key.",
    ),
    FaultKind(
        "freeze",
        _SERVICES,
        (*_SERVICES, *_ONE_OF_TWO, "postgresql"),
        (3.0, 20.0),
        "Processes stand still (SIGSTOP) and go on later, as on a machine that swaps.",
        "What needs this part waits. Drones fly on. If one of two replicas freezes, the other "
        "one goes on when the claims of the first are over.",
    ),
    FaultKind(
        "away",
        ("gateway", "registry", "broker", "drones"),
        ("gateway", "registry", "broker", "drones", "postgresql"),
        (5.0, 30.0),
        "Processes are killed and are started again only after this time.",
        "The same as after a kill, from the moment when the part is back. Without the "
        "registry or composition requests are accepted and wait for their plan.",
    ),
    FaultKind(
        # Twice: it is the longest, and drones fly whole missions meanwhile.
        "long away",
        ("composition", "composition"),
        ("composition", "composition"),
        (25.0, 60.0),
        "All replicas are killed and away for so long that drones fly whole missions meanwhile.",
        "Drones fly what they have accepted, and report it when composition is back. Requests "
        "wait for their plan; those whose deadline passes meanwhile are rejected.",
    ),
    FaultKind(
        "cut",
        _WIRES,
        (*_WIRES, *_DATABASE_WIRES),
        (5.0, 25.0),
        "Connections between two parts break, and new ones are refused.",
        "Each side tries again until it succeeds. No message is lost, and none counts twice.",
    ),
    FaultKind(
        "silence",
        _BUSY_WIRES,
        (*_BUSY_WIRES, "composition to database"),
        (5.0, 25.0),
        "Connections stay open, but carry nothing until the fault heals.",
        "Calls end after their time limit and are made again.",
    ),
    FaultKind(
        "slow",
        _BUSY_WIRES,
        (*_BUSY_WIRES, "composition to database"),
        (5.0, 20.0),
        "Every piece of data between two parts arrives 0.2 to 2 s later.",
        "Everything goes on, more slowly.",
    ),
    FaultKind(
        "read-only",
        (),
        ("postgresql",),
        (10.0, 60.0),
        "PostgreSQL refuses to write, as a standby does.",
        "Requests are answered 503 with Retry-After. Drones fly on.",
    ),
    FaultKind(
        "locked",
        _DATABASES,
        (),
        (5.0, 20.0),
        "Another program holds the write lock of a SQLite database.",
        "Writes wait, then requests are answered 503. Drones fly on.",
    ),
    FaultKind(
        "immutable",
        _DATABASES,
        (),
        (5.0, 20.0),
        "A SQLite database cannot be opened for writing, and its service is killed.",
        "The service cannot start; it is started again and again until it can.",
        needs_root=True,
    ),
    FaultKind(
        "full disk",
        ("databases",),
        (),
        (5.0, 20.0),
        "The disk of the SQLite databases is full.",
        "Requests are answered 503 until there is room again.",
        needs_root=True,
    ),
    FaultKind(
        "unwritable journal",
        ("drones",),
        ("drones",),
        (5.0, 20.0),
        "Drones cannot write their journals.",
        "These drones begin no step that they cannot write down, and go on when they can.",
    ),
    FaultKind(
        "lost journal",
        ("drones",),
        ("drones",),
        (1.0, 3.0),
        "Drones are killed, and start again with empty journals.",
        "Missions that such a drone may have flown wait for an operator, and an alarm says so. No "
        "other drone gets their packages.",
    ),
    FaultKind(
        "no descriptors",
        _SERVICES[:4],
        ("gateway", "composition", "registry"),
        (5.0, 20.0),
        "A process may open no further file or connection.",
        "New connections wait or are refused; the process goes on when the limit is lifted.",
    ),
    FaultKind(
        "no memory",
        ("gateway", "composition", "registry"),
        ("one gateway", "one composition", "registry"),
        (5.0, 15.0),
        "A process gets no further memory.",
        "Requests fail, also with 500; the process may end and is started again.",
    ),
    FaultKind(
        "poison",
        ("drones", "another drone"),
        ("drones", "another drone"),
        (4.0, 8.0),
        "Messages on drones' topics that cannot be read, or whose values are extreme or false.",
        "These messages are dropped and counted. Messages of other drones are not affected.",
    ),
)

KIND_BY_NAME: Final[Mapping[str, FaultKind]] = {kind.name: kind for kind in KINDS}

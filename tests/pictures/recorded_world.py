"""A world that was recorded once: what the gateway answered to the console, and at which moment.

Pictures of the console are taken from it, so they show the same each time.
"""

import gzip
import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qsl

FILE: Final = Path(__file__).parents[1] / "data/console-world.json.gz"

#: Moments in a query change from one reading to the next.
_MOMENT: Final = re.compile(r"\d{4}-\d\d-\d\d(T\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d))?")


def question(path: str, query: str) -> str:
    """An address whose query has no moments: recording and replay ask at different ones."""
    pairs = [f"{name}={_MOMENT.sub('T', value)}" for name, value in parse_qsl(query)]
    return f"{path}?{'&'.join(sorted(pairs))}"


@dataclass(frozen=True)
class RecordedWorld:
    """What each role saw.

    Attributes
    ----------
    now
        The fleet time of the recording, RFC 3339.
    rate
        Seconds of fleet time in a second of wall time.
    wall_ms
        The browser's clock then, milliseconds since 1970.
    shown
        Ids that addresses of views contain: `drone`, `station`, `delivery`, and the `link` of a
        tracking page.
    answers
        By role and question: JSON. The role of the tracking page is `link`.
    streams
        By role and address: the first events of the console's streams, as kind and JSON.
    """

    now: str
    rate: float
    wall_ms: int
    shown: dict[str, str]
    answers: dict[str, dict[str, Any]]
    streams: dict[str, dict[str, list[tuple[str, Any]]]]

    def save(self) -> None:
        """Write the file, with the same bytes for the same world."""
        text = json.dumps(asdict(self), sort_keys=True, separators=(",", ":"))
        FILE.write_bytes(gzip.compress(text.encode(), mtime=0))


def recorded_world() -> RecordedWorld:
    """The world of the file."""
    return RecordedWorld(**json.loads(gzip.decompress(FILE.read_bytes())))

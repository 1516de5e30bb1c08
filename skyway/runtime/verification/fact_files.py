"""Files of facts: each kind in a file of its own, sorted by key, one JSON line for each fact."""

from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Protocol, TypeVar

from skyway.contracts.service_facts import AnyFacts
from skyway.runtime.sql.database import Database
from skyway.runtime.verification.rule import Survey
from skyway.units import moment_to_ms

#: Reads all facts of one kind from a survey, in any order.
FactReader = Callable[[Survey], AsyncIterator[AnyFacts]]


class _Keyed(Protocol):
    @property
    def key(self) -> str:
        """The key by which facts are sorted and compared."""
        ...


FactsT = TypeVar("FactsT", bound=_Keyed)


async def read_facts(
    db: Database, readers: Mapping[str, FactReader], *, wall_at: datetime
) -> Mapping[str, str]:
    """The facts of one moment by their kind, each kind as the text of its file."""
    async with db.survey() as connection:
        survey = Survey(connection, db.dialect, moment_to_ms(wall_at))
        return {kind: await _sorted_lines(read(survey)) for kind, read in readers.items()}


async def _sorted_lines(facts: AsyncIterator[AnyFacts]) -> str:
    # Sorted here: the databases sort texts in different orders.
    lines = sorted([(fact.key, fact.model_dump_json()) async for fact in facts])
    return "".join(f"{line}\n" for _, line in lines)


def write_facts(files: Mapping[str, str], folder: Path) -> None:
    """Write facts into a file for each kind, in a new folder."""
    folder.mkdir(parents=True)
    for kind, text in files.items():
        (folder / f"{kind}.jsonl").write_text(text)


def side_by_side(
    first: Iterator[FactsT], second: Iterator[FactsT]
) -> Iterator[tuple[FactsT | None, FactsT | None]]:
    """The facts of two sorted iterators in pairs of equal keys; None where one has no such fact."""
    one, other = next(first, None), next(second, None)
    while one is not None or other is not None:
        if other is None or (one is not None and one.key < other.key):
            yield one, None
            one = next(first, None)
        elif one is None or other.key < one.key:
            yield None, other
            other = next(second, None)
        else:
            yield one, other
            one, other = next(first, None), next(second, None)

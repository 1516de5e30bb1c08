"""Plant small faults in the code, one after another, and see that a test fails for each.

python tools/plant_mutants.py           plants all mutants of tools/mutants.toml
python tools/plant_mutants.py 3 17      plants only these
python tools/plant_mutants.py --page    writes docs/reference/mutants.md

A fault is planted in the file itself and undone after its test: nobody may work there meanwhile.
"""

import argparse
import multiprocessing
import os
import signal
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Final

import pytest

ROOT: Final = Path(__file__).resolve().parent.parent
TABLE: Final = ROOT / "tools/mutants.toml"
PAGE: Final = ROOT / "docs/reference/mutants.md"

#: The longest run of one test, seconds: longer than a browser waits for a page (LONGEST_WAIT_MS).
LONGEST_S: Final = 420.0

#: Packages of others that most tests import. They are imported once, and each run starts with them.
IMPORTED: Final = (
    "alembic.command",
    "asyncpg",
    "fastapi",
    "httpx",
    "hypothesis",
    "numba",
    "pydantic",
    "pytest",
    "pytest_asyncio",
    "sqlalchemy.dialects.postgresql.asyncpg",
    "sqlalchemy.dialects.sqlite.aiosqlite",
    "sqlalchemy.ext.asyncio",
    "xdist.plugin",
)

HEAD: Final = """# Mutants

A mutant is a small fault that is planted in the code to see whether a test fails. These faults
would lose or repeat a message, a package or a booking, or would let a tenant, a drone or a caller
without a key harm others, mostly without being noticed at first.

`python tools/plant_mutants.py` plants one after another, runs its test, undoes it, and prints
`caught` or `survived`; `skipped` where the test needs PostgreSQL and there is none, and `unclear`
where the test did not end within seven minutes.

The table is `tools/mutants.toml`: the text that is replaced, and the text that replaces it. The
option `--page` writes this page. A test checks that each text stands in its file exactly once, and
that each test exists. If you change a line that the table names, change the table too, and plant
the mutant again.
"""


@dataclass(frozen=True, slots=True)
class Mutant:
    """A fault: in `file` the text `old` is replaced by `new`; `test` fails then."""

    place: str
    change: str
    file: str
    old: str
    new: str
    test: str


def mutants() -> list[Mutant]:
    """All mutants, in the order of their numbers."""
    return [Mutant(**row) for row in tomllib.loads(TABLE.read_text())["mutant"]]


def page() -> str:
    """The text of the page."""
    lines = [HEAD]
    numbered = enumerate(mutants(), 1)
    for place, group in groupby(numbered, key=lambda each: each[1].place):
        lines += [f"## {place}\n", "| | fault | file | caught by |", "|---|---|---|---|"]
        for number, each in group:
            lines.append(f"| {number} | {each.change} | `{each.file}` | `{each.test}` |")
        lines.append("")
    return "\n".join(lines)


@contextmanager
def planted(mutant: Mutant) -> Iterator[None]:
    """Plant a mutant for the block."""
    path = ROOT / mutant.file
    before, written = path.read_text(), path.stat()
    if before.count(mutant.old) != 1:
        raise SystemExit(f"{mutant.file} does not hold this text exactly once:\n{mutant.old}")
    path.write_text(before.replace(mutant.old, mutant.new))
    try:
        yield
    finally:
        path.write_text(before)
        # Compiled files are valid for this date, those of the mutant for another one.
        os.utime(path, ns=(written.st_atime_ns, written.st_mtime_ns))


def _pytest(tests: Sequence[str], output: Path) -> None:
    os.dup2(os.open(output, os.O_WRONLY), 1)
    options = ["-q", "-x", "--tb=no", "-p", "no:cacheprovider", "-m", "not long"]  # as `make test`
    options += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # of what is imported already
    code = 1
    try:
        code = int(pytest.main([*options, *tests]))
    finally:
        sys.stdout.flush()
        os._exit(code)  # waits for no thread that a failed test has left


def run(tests: Sequence[str]) -> tuple[int | None, str]:
    """The exit code of pytest and what it printed; without a code, it did not end in time."""
    with tempfile.NamedTemporaryFile("r") as output:
        child = multiprocessing.get_context("forkserver").Process(
            target=_pytest, args=(tests, Path(output.name))
        )
        child.start()
        child.join(LONGEST_S * len(tests))
        in_time = child.exitcode is not None
        if not in_time:
            os.kill(child.pid or 0, signal.SIGINT)  # lets the test stop its servers
            child.join()
        return (child.exitcode if in_time else None), output.read()


def outcome(mutant: Mutant) -> str:
    """What the mutant's test says about the mutant."""
    with planted(mutant):
        code, printed = run([mutant.test])
    if code is None:
        return "unclear: the test did not end"
    failed = [line for line in printed.splitlines() if line.startswith("FAILED")]
    if code == 1 and failed:
        return f"caught: {failed[0].partition('::')[2]}"
    if code == 0:
        return "survived" if " passed" in printed else "skipped"
    return "broken: the test could not run\n" + printed


def main() -> int:
    """Plant the named mutants; 1 if one was not caught."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("numbers", nargs="*", type=int, help="which mutants; without any, all")
    parser.add_argument("--page", action="store_true", help="only write the page")
    arguments = parser.parse_args()
    if arguments.page:
        PAGE.write_text(page())
        return 0
    os.chdir(ROOT)
    multiprocessing.get_context("forkserver").set_forkserver_preload(list(IMPORTED))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("stopped"))  # after undoing the mutant
    chosen = [
        (number, each)
        for number, each in enumerate(mutants(), 1)
        if not arguments.numbers or number in arguments.numbers
    ]
    code, printed = run(sorted({each.test for _, each in chosen}))
    if code != 0:
        sys.exit(f"the tests do not pass without a mutant:\n{printed}")
    caught = 0
    for number, each in chosen:
        found = outcome(each)
        caught += found.startswith("caught")
        print(f"{number:3} {found}  ({each.change})", flush=True)
    print(f"{caught} of {len(chosen)} caught")
    return 0 if caught == len(chosen) else 1


if __name__ == "__main__":
    sys.exit(main())

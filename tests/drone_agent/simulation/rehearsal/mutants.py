"""Bugs that the sweep must find, each in a private copy of the agent. Run by hand:

python -m tests.drone_agent.simulation.rehearsal.mutants
"""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

_ROOT = Path(__file__).parents[4]
AGENT = "services/skyway_drone_agent"


@dataclass(frozen=True, slots=True)
class Mutant:
    """A wrong line in place of a right line of the agent, and the scenario that shows it."""

    name: str
    file: str
    right: str
    wrong: str
    scenario: str = "calm"


MUTANTS = (
    Mutant("the journal is not synced", "journal/journal.py", "        self._sync(file)\n", ""),
    Mutant(
        "repeated instructions are carried out again",
        "messages/inbox.py",
        "envelope.seq < expected_seq:",
        "envelope.seq < 0:",
    ),
    Mutant(
        "gaps are accepted",
        "messages/inbox.py",
        "elif envelope.seq > expected_seq:",
        "elif envelope.seq < 0:",
    ),
    Mutant(
        "hand-overs begin again after a restart",
        "journal/logbook.py",
        "started_at=mission.began_at,",
        "started_at=mission.began_at.replace(microsecond=1),",
    ),
    Mutant(
        "packages are picked up again after a restart",
        "flying/pilot.py",
        "if not is_left_behind or not _is_hand_over(run):",
        "if not is_left_behind or not isinstance(run.step, DeliverStep | ReturnStep):",
    ),
    Mutant(
        "a step begins before it is written",
        "flying/pilot.py",
        "            self._recorder.record(begun)",
        "            self._recorder._count((begun,))",
    ),
    Mutant(
        "a low battery raises no alarm",
        "failsafes/failsafe.py",
        "Fault.BATTERY_LOW:         (_GO,    _GO,    _GO,    _GO,     _GO,     _WARN,",
        "Fault.BATTERY_LOW:         (_GO,    _GO,    _GO,    _GO,     _GO,     _GO,",
        "stormy",
    ),
    Mutant(
        "the session stays",
        "journal/flight_recorder.py",
        "max(self.logbook.session + 1, int(wall_now.timestamp()))",
        "max(self.logbook.session, 1)",
    ),
    Mutant(
        "a take-off without energy is allowed",
        "flying/mission.py",
        "    if shortfall is not None:\n        energy",
        "    if False:\n        energy",
        "stormy",
    ),
)


def _is_found(mutant: Mutant, folder: Path) -> bool:
    path = folder / AGENT / mutant.file
    text = path.read_text()
    if mutant.right not in text:
        raise LookupError(f"{mutant.name}: not in {mutant.file}")
    path.write_text(text.replace(mutant.right, mutant.wrong, 1))
    sweep = ["--seeds", "0:10", "--scenarios", mutant.scenario, "--crashes", "6"]
    found = subprocess.run(
        [sys.executable, "-m", "tests.drone_agent.simulation.rehearsal.sweep", *sweep],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": f"{folder}:{folder}/services"},
        capture_output=True,
        text=True,
        check=False,
    )
    path.write_text(text)
    said = (found.stdout or found.stderr).strip().splitlines()
    print(f"{mutant.name}: {said[0][:150] if said else 'nothing'}", flush=True)  # noqa: T201
    return found.returncode != 0


def main() -> int:
    """Try all mutants; the exit code is 1 when the sweep misses one."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as made:
        folder = Path(made)
        for part in ("skyway", AGENT, "tests/drone_agent/simulation"):
            shutil.copytree(_ROOT / part, folder / part)
        alive = [mutant.name for mutant in MUTANTS if not _is_found(mutant, folder)]
    print(f"{len(MUTANTS) - len(alive)} of {len(MUTANTS)} found; alive: {alive}")  # noqa: T201
    return 1 if alive else 0


if __name__ == "__main__":
    sys.exit(main())

"""The installed command without its extra."""

import subprocess
import sys

HIDE_TYPER = """
import sys
sys.modules["typer"] = None
from skyway.cli.entry import main
main()
"""


def test_without_its_extra_the_command_names_it() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", HIDE_TYPER], capture_output=True, text=True, check=False, timeout=60
    )

    assert ended.returncode == 1
    assert ended.stderr.splitlines() == [
        "skyway: the command needs typer: pip install 'skyway[cli]'"
    ]

"""Where the installed `skyway` command begins: says what is missing where only the library is."""

import sys


def main() -> None:
    """Run the command; without its extra installed, say so in one line."""
    try:
        from skyway.cli.main import main as run
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("skyway"):
            raise
        sys.exit(f"skyway: the command needs {error.name}: pip install 'skyway[cli]'")
    run()

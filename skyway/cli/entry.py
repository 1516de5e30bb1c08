"""The start of the installed `skyway` command; it works where only the library is installed."""

import sys


def main() -> None:
    """Run the command; when its extra is not installed, print how to install it."""
    try:
        from skyway.cli.main import main as run

        run()
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("skyway"):
            raise
        sys.exit(f"skyway: the command needs {error.name}: pip install 'skyway[cli]'")

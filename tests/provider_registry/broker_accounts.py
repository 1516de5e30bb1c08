"""The broker accounts in the password file that a test's registry has written."""

from pathlib import Path

from skyway.broker_setup.passwords import read_password_file


def accounts_in(folder: Path) -> dict[str, str]:
    """The password hash of each drone by its id, and of each other account by its name."""
    accounts = read_password_file(folder / "passwords")
    return {name.rpartition("/")[2]: hashed for name, hashed in accounts.items()}

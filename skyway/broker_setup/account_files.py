"""The files of a broker's accounts and access rules, which lie in one folder."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class AccountFiles:
    """The accounts that may log in at a listener, and their access rules."""

    password_file: Path
    acl_file: Path


def client_files(password_file: Path) -> AccountFiles:
    """The files of drones, customers and operators; the registry writes both."""
    return AccountFiles(password_file, password_file.with_name("client_acl"))


def service_files(password_file: Path) -> AccountFiles:
    """The files of services, beside the password file of all other accounts.

    Services have a listener of their own. Only services can log in there, and services can log in
    only there.
    """
    return AccountFiles(
        password_file.with_name(f"service_{password_file.name}"),
        password_file.with_name("service_acl"),
    )


def revoked_file(password_file: Path) -> Path:
    """The file beside it that lists the drones' certificates that ended before their time (PEM)."""
    return password_file.with_name("revoked.pem")


def refused_logins_file(password_file: Path) -> Path:
    """The file beside it in which the embedded broker counts the logins that it refused."""
    return password_file.with_name("refused_logins")

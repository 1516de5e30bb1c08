"""The accounts of Mosquitto and of the embedded broker, in three files beside each other."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skyway.broker_setup.account_files import client_files, revoked_file, service_files
from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.passwords import hash_password, write_password_file
from skyway.broker_setup.private_file import write_private
from skyway.contracts.broker_rules import BrokerRules, is_operator

#: No key of a drone has ended.
NOTHING_REVOKED: Final[Mapping[str, str]] = {}


@dataclass(frozen=True, slots=True)
class MosquittoAccounts:
    """Writes the password file, and beside it that of services and the rights of operators.

    The services' accounts are in a file of their own: Mosquitto lets services log in at their own
    listener only. With the authority of drones' certificates it writes which of them have ended.
    """

    password_file: Path
    authority: CertificateAuthority | None = None

    @property
    def lock_file(self) -> Path:
        """The file that a replica of the registry locks before it writes."""
        return self.password_file.with_name(f"{self.password_file.name}.lock")

    def hash_password(self, password: str) -> str:
        """The hash that is stored of a password."""
        return hash_password(password)

    def write(
        self,
        accounts: Mapping[str, str],
        services: Mapping[str, str],
        revoked: Mapping[str, str] = NOTHING_REVOKED,
        /,
    ) -> None:
        """Replace the files by these accounts, user name to hash.

        `revoked` are the hashes of ended keys of drones, each with the drone's user name.

        Raises
        ------
        InvalidInput
            A user name is not an identifier.
        OSError
            A file cannot be written.
        """
        locked_out = set(revoked.values()) - set(accounts)
        acl = BrokerRules().client_acl(filter(is_operator, accounts), locked_out)
        write_private(client_files(self.password_file).acl_file, acl)
        write_password_file(service_files(self.password_file).password_file, services)
        if self.authority is not None:
            write_private(revoked_file(self.password_file), self.authority.revoked_pem(revoked))
        # Last: when this file has changed, the others are written.
        write_password_file(self.password_file, accounts)

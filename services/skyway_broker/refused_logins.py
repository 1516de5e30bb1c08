"""Counts refused logins, in a file that the registry shows in its metrics."""

import logging
from pathlib import Path

from skyway.broker_setup.account_files import refused_logins_file
from skyway.broker_setup.private_file import write_private

log = logging.getLogger(__name__)


class RefusedLogins:
    """The logins that were refused since the start of this process."""

    def __init__(self, password_file: Path) -> None:
        self._file = refused_logins_file(password_file)
        self._count = 0
        self._written = -1

    def note(self) -> None:
        """Count a refused login."""
        self._count += 1

    def write(self) -> None:
        """Write the number if it has changed; a folder that cannot be written changes nothing."""
        if self._count == self._written:
            return
        try:
            write_private(self._file, f"{self._count}\n")
        except OSError as error:
            log.warning("refused logins not written", extra={"reason": str(error)})
        self._written = self._count

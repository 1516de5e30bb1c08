"""The deployment's own certificate authority for its drones and its broker, if it has one."""

from collections.abc import Sequence

from skyway.cli.data_folder import DataFolder
from skyway.cli.tls_files import tls_files
from skyway.runtime.certificates import CertificateAuthority
from skyway.runtime.private_file import write_private


def make_drone_ca(folder: DataFolder, broker_names: Sequence[str]) -> None:
    """Make the authority once, and each time a new certificate for the broker under these names."""
    authority = CertificateAuthority.make(folder.drone_ca)
    signed = authority.sign_broker(broker_names)
    files = tls_files(folder)
    # Copies beside the broker's other files: it needs no more of the authority's folder.
    write_private(files.ca_file, authority.certificate_pem)
    write_private(files.key_file, signed.private_key_pem)
    write_private(files.certificate_file, signed.certificate_pem)

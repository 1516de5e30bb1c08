"""What a drone with a certificate trusts and shows when it connects to the broker."""

import ssl
from pathlib import Path
from tempfile import NamedTemporaryFile

from skyway_drone_agent.enrolled_drone import ClientCertificate


def client_tls(certificate: ClientCertificate, *, scratch: Path) -> ssl.SSLContext:
    """Trusts the deployment's own authority alone, and shows the drone's certificate.

    `scratch` is a folder of this user's: Python reads a private key from files only.
    """
    context = ssl.create_default_context(cadata=certificate.ca_pem)
    with NamedTemporaryFile(dir=scratch, prefix=".tls-", suffix=".pem") as file:
        file.write(f"{certificate.private_key_pem}{certificate.certificate_pem}".encode())
        file.flush()
        context.load_cert_chain(file.name)
    return context

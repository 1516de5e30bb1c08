"""What a signature costs: time for each message, and memory of the library.

`python -m skyway_lab signatures` signs and checks a message as large as a drone's state, with
PyNaCl, which Skyway uses, and with cryptography. Each library is measured in a process of its own,
after the modules that every agent imports.
"""

import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

#: Bytes of a drone's state with its health.
_PAYLOAD_BYTES: Final = 900
_ROUNDS: Final = 7
_TIMES: Final = 1_000
_KIB_PER_MIB: Final = 1024


def _resident_mib() -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith("VmRSS"))
    return int(line.split()[1]) / _KIB_PER_MIB


def _best_us(do: Callable[[], object]) -> float:
    """Microseconds of one call, in the quickest of several rounds."""
    rounds = []
    for _ in range(_ROUNDS):
        begin = time.perf_counter()
        for _ in range(_TIMES):
            do()
        rounds.append(time.perf_counter() - begin)
    return min(rounds) / _TIMES * 1e6


def _measure_nacl(topic: str, payload: bytes) -> tuple[float, float]:
    from skyway.runtime.signing.key_pair import PrivateKey, is_signed_by, public_key_bytes

    key = PrivateKey.new()
    public, signed = public_key_bytes(key.public_key), key.signed(topic, payload)
    return (
        _best_us(lambda: key.signed(topic, payload)),
        _best_us(lambda: is_signed_by(public, topic, signed)),
    )


def _measure_openssl(topic: str, payload: bytes) -> tuple[float, float]:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    from skyway.contracts.signature import head_of, signed_bytes

    key = Ed25519PrivateKey.generate()
    public, text = key.public_key(), signed_bytes(topic, head_of(payload))
    signature = key.sign(text)
    return _best_us(lambda: key.sign(text)), _best_us(lambda: public.verify(signature, text))


_LIBRARIES: Final = {"pynacl": _measure_nacl, "cryptography": _measure_openssl}


def _measure(library: str) -> None:

    import skyway.contracts.topics  # noqa: F401 - every agent has these in memory

    before_mib = _resident_mib()
    payload = b'{"text":"' + b"x" * (_PAYLOAD_BYTES - 11) + b'"}'
    sign_us, check_us = _LIBRARIES[library]("skyway/v1/prv_1/drn_1/state", payload)
    sys.stdout.write(
        f"{library}: sign {sign_us:.0f} us, check {check_us:.0f} us, "
        f"{_resident_mib() - before_mib:.1f} MiB\n"
    )


def main(arguments: Sequence[str]) -> int:
    """Measure one library by its name, or all."""
    if arguments:
        _measure(arguments[0])
        return 0
    for library in _LIBRARIES:
        subprocess.run(
            [sys.executable, "-m", "skyway_lab.benchmarks.signatures", library], check=True
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

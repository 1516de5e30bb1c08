"""The socket under paho makes few system calls and loses nothing."""

import socket
import ssl
from collections.abc import Iterator
from contextlib import suppress

import pytest

from skyway.runtime.mqtt.buffered_socket import BufferedSocket


class Ends:
    """A buffered socket and the other end of it."""

    def __init__(self, kind: socket.SocketKind) -> None:
        near, self.far = socket.socketpair(socket.AF_UNIX, kind)
        for sock in (near, self.far):
            sock.setblocking(False)
        near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        self.near = BufferedSocket(near)

    def close(self) -> None:
        self.near.close()
        self.far.close()


def tls_without_certificates(protocol: int) -> ssl.SSLContext:
    """What trusts everybody, and needs nothing made."""
    context = ssl.SSLContext(protocol)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    context.set_ciphers("AECDH-AES128-SHA:@SECLEVEL=0")
    return context


def encrypted(sock: socket.socket, protocol: int) -> ssl.SSLSocket:
    sock.setblocking(False)
    return tls_without_certificates(protocol).wrap_socket(
        sock, server_side=protocol == ssl.PROTOCOL_TLS_SERVER, do_handshake_on_connect=False
    )


def send_until_full(sock: BufferedSocket) -> Iterator[bytes]:
    with suppress(BlockingIOError):
        for number in range(100):
            packet = bytes([number]) * 10_000
            sock.send(packet)
            yield packet


@pytest.fixture
def stream() -> Iterator[Ends]:
    ends = Ends(socket.SOCK_STREAM)
    yield ends
    ends.close()


@pytest.fixture
def packets() -> Iterator[Ends]:
    ends = Ends(socket.SOCK_SEQPACKET)  # keeps apart what different system calls wrote
    yield ends
    ends.close()


def test_packets_before_a_flush_are_sent_in_one_system_call(packets):
    assert packets.near.send(b"one,") == 4
    assert packets.near.send(bytearray(b"two")) == 3

    packets.near.flush()

    assert packets.far.recv(100) == b"one,two"
    assert not packets.near.has_unsent


def test_all_arrived_bytes_are_read_in_one_call_and_served_in_pieces(stream):
    stream.far.send(b"one,")
    stream.far.send(b"two")

    stream.near.fill()
    stream.far.send(b"later")

    assert [stream.near.recv(1), stream.near.recv(3), stream.near.recv(100)] == [
        b"o",
        b"ne,",
        b"two",
    ]
    assert not stream.near.has_unread
    with pytest.raises(BlockingIOError):
        stream.near.recv(1)


def test_unread_bytes_come_before_later_bytes(stream):
    stream.far.send(b"one,")
    stream.near.fill()
    stream.near.recv(1)
    stream.far.send(b"two")

    stream.near.fill()

    assert stream.near.recv(100) == b"ne,two"


def test_all_arrived_tls_records_are_read_in_one_fill():
    plain_near, plain_far = socket.socketpair()
    near = encrypted(plain_near, ssl.PROTOCOL_TLS_CLIENT)
    far = encrypted(plain_far, ssl.PROTOCOL_TLS_SERVER)
    for end in (near, far, near, far, near):
        with suppress(ssl.SSLWantReadError):
            end.do_handshake()
    with near, far:
        buffered = BufferedSocket(near)
        far.send(b"one record,")
        far.send(b"another")

        buffered.fill()

        assert buffered.recv(100) == b"one record,another"


def test_nothing_to_read_is_not_the_end(stream):
    stream.near.fill()

    assert not stream.near.has_unread
    with pytest.raises(BlockingIOError):
        stream.near.recv(1)


def test_the_end_is_read_after_all_that_came_before_it(stream):
    stream.far.send(b"last")
    stream.far.close()
    stream.near.fill()
    stream.near.fill()

    assert stream.near.recv(100) == b"last"
    assert stream.near.has_unread
    assert stream.near.recv(100) == b""


def test_a_full_system_is_written_to_later_and_holds_the_sender_back(stream):
    sent = list(send_until_full(stream.near))
    assert len(sent) < 100
    assert stream.near.has_unsent

    taken = b""
    while len(taken) < 10_000 * len(sent):
        taken += stream.far.recv(100_000)
        stream.near.flush()

    assert taken == b"".join(sent)
    assert not stream.near.has_unsent
    assert stream.near.send(b"again") == 5


def test_a_write_to_a_client_that_has_left_is_read_as_the_end(stream):
    stream.far.close()
    stream.near.send(b"to nobody")

    stream.near.flush()

    assert not stream.near.has_unsent
    assert stream.near.has_unread
    with pytest.raises(BrokenPipeError):
        stream.near.recv(1)


def test_a_goodbye_is_written_before_the_socket_closes(stream):
    stream.near.send(b"goodbye")

    stream.near.close()
    stream.near.close()

    assert stream.far.recv(100) == b"goodbye"
    assert stream.near.fileno() == -1

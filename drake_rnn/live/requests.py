"""Requests of HTTP, read within bounds of size and time, and refused if they are ambiguous."""

from __future__ import annotations

import ipaddress
import re
import socket
import time
from collections.abc import Callable
from email.message import Message

#: Longest head of a request: its first line and its headers [bytes].
MOST_HEAD = 16384
# How long a connection may be silent between two requests, and how long a request may take [s].
IDLE, WHOLE = 30.0, 10.0
# How long is waited for a connection that is closed to be emptied by the other side [s], and how
# much is still taken from it [bytes].
_EMPTIED, _TAKEN = 1.0, 1 << 18
_PIECE = 4096
# A host, by itself, and perhaps a port: a name, an address, or one of IPv6 in brackets.
_HOST = re.compile(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)(:[0-9]{0,5})?")
# Odd ends of lines, and lines that go on, which programs read differently; a first line; a header.
_ODD = re.compile(rb"\r(?!\n)|\0|\n[ \t]")
_LINE = re.compile(rb"[!-~]+ [!-~]+ HTTP/([0-9]\.[0-9])\r?")
_HEADER = re.compile(rb"[!#$%&'*+.^_`|~0-9A-Za-z-]+:")
#: Names and addresses of this machine that no other one can reach.
LOCAL = ("localhost", "127.0.0.1", "::1")
# Addresses that stand for every address of this machine.
_EVERY = ("", "0.0.0.0", "::")


class RefusedError(Exception):
    """A request that is not carried out.

    Args:
        status: Status of the answer.
        why: The answer, as a sentence.
    """

    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status = status


class Stream:
    """What comes over a connection.

    Args:
        connection: The connection.
        clock: Returns the time [s].
    """

    def __init__(
        self, connection: socket.socket, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._connection, self._clock = connection, clock
        self._held, self._until = b"", 0.0
        #: Whether a request has begun and is not yet answered.
        self.is_busy = False

    def head(self) -> bytes:
        """Return the next request's first line and headers, with the empty line after them.

        It is empty at the end of the connection, or after a long silence.

        Raises:
            RefusedError: If it is too long, or takes too long.
        """
        self.is_busy = False
        if not self._held.lstrip(b"\r\n"):
            self._held = b""
            self._until = self._clock() + IDLE
            if not self._more():
                return b""
        self.is_busy, self._until = True, self._clock() + WHOLE
        while True:
            # Empty lines before a request are passed over.
            self._held = self._held.lstrip(b"\r\n")
            ends = [at.end() for at in re.finditer(rb"\r?\n\r?\n", self._held[: MOST_HEAD + 4])]
            if ends and ends[0] <= MOST_HEAD:
                content, self._held = self._held[: ends[0]], self._held[ends[0] :]
                return content
            if len(self._held) > MOST_HEAD:
                raise RefusedError(431, f"the head of a request may have {MOST_HEAD} bytes")
            if not self._more():
                raise RefusedError(408, "the request was not complete in time")

    def body(self, length: int) -> bytes:
        """Return what follows a head.

        Raises:
            RefusedError: If it takes too long, or ends before.
        """
        while len(self._held) < length:
            if not self._more():
                raise RefusedError(408, "the request was not complete in time")
        content, self._held = self._held[:length], self._held[length:]
        return content

    def discard(self) -> None:
        """Take what still comes and throw it away, so that the other side can read the answer.

        A connection that is closed with something unread is reset, and the answer may be lost.
        """
        self._until, count = self._clock() + _EMPTIED, 0
        try:
            self._connection.shutdown(socket.SHUT_WR)
            while count < _TAKEN:
                self._held = b""
                if not self._more():
                    return
                count += len(self._held)
        except OSError:
            return

    def _more(self) -> bool:
        """Receive more; return whether there was any before it had to come."""
        left = self._until - self._clock()
        if left <= 0.0:
            return False
        self._connection.settimeout(left)
        try:
            piece = self._connection.recv(_PIECE)
        except TimeoutError:
            return False
        self._held += piece
        return bool(piece)


def check_head(head: bytes) -> None:
    """Refuse a head that is none of HTTP/1.0 or 1.1, or is read in more than one way.

    Raises:
        RefusedError: If it has lines that go on, end in an odd way or are no headers.
    """
    if _ODD.search(head):
        raise RefusedError(400, "the request has odd ends of lines")
    first, *lines = head.split(b"\n")
    if (match := _LINE.fullmatch(first)) is None:
        raise RefusedError(400, "the request must have a method, an address and a version")
    if match[1] not in (b"1.0", b"1.1"):
        raise RefusedError(505, "the version must be HTTP/1.1")
    for line in lines:
        if (line := line.rstrip(b"\r")) and not _HEADER.match(line):
            raise RefusedError(400, "a line of the request is no header")


def length_of(headers: Message, most: int) -> int:
    """Return the length of a request's body, by its headers [bytes]; 0 without one.

    Args:
        headers: The headers.
        most: Longest one that is taken.

    Raises:
        RefusedError: If it is longer, or not stated without doubt.
    """
    lengths, codings = headers.get_all("Content-Length"), headers.get_all("Transfer-Encoding")
    if codings is not None:
        if lengths is not None:
            raise RefusedError(400, "a length and a transfer coding contradict each other")
        if [each.strip().lower() for each in codings] == ["chunked"]:
            raise RefusedError(411, "the length of a message must be given")
        raise RefusedError(501, "there is no such transfer coding here")
    if lengths is None:
        return 0
    if len(lengths) > 1:
        raise RefusedError(400, "the length is given more than once")
    text = lengths[0].strip(" \t")
    if not re.fullmatch("[0-9]+", text):
        raise RefusedError(400, "the length must be a number of bytes")
    digits = text.lstrip("0")
    if len(digits) > len(str(most)) or int(digits or "0") > most:
        raise RefusedError(413, f"a message may have {most} bytes")
    return int(digits or "0")


def sole(headers: Message, name: str) -> str | None:
    """Return a header that may be given once; None without it.

    Raises:
        RefusedError: If it is given more often.
    """
    headers_of_name = headers.get_all(name)
    if headers_of_name is None:
        return None
    if len(headers_of_name) > 1:
        raise RefusedError(400, f"{name} is given more than once")
    return str(headers_of_name[0]).strip(" \t")


def host_in(text: str) -> str:
    """Return the host in the header of that name, without its port, in small letters.

    Raises:
        RefusedError: If it is none.
    """
    match = _HOST.fullmatch(text)
    if match is None:
        raise RefusedError(400, "Host must be a host, perhaps with a port")
    return _plain(match[1].strip("[]"))


def hosts_of(host: str, address: str) -> Callable[[str], bool]:
    """Return what tells whether a host that is asked for is this one.

    A name of another site can be made to lead to this machine, and a page of that site then asks
    for that name. So only what this server was told to listen at is answered: its name, and its
    address. Where it listens at every address of the machine, it is asked for by any of them, by
    ``localhost`` and by the machine's own name: an address is no name of another site.

    Args:
        host: Name or address that the server was told to listen at.
        address: The address that it listens at.
    """
    hosts, every = {_plain(host), _plain(address)}, host in _EVERY
    if every or _plain(host) in LOCAL:
        hosts |= {*LOCAL}
    if every:
        hosts.add(_plain(socket.gethostname()))

    def is_this(host: str) -> bool:
        return host in hosts or (every and _address(host) is not None)

    return is_this


def _plain(host: str) -> str:
    """Return a host as others write it: in small letters, an address in its shortest form."""
    return _address(host) or host.rstrip(".").lower()


def _address(host: str) -> str | None:
    try:
        return str(ipaddress.ip_address(host))
    except ValueError:
        return None

"""The page and its messages over HTTP, of one address of this machine.

- Requests, read within bounds of size and time, and refused if they are ambiguous.
- Who has the controls: one page at a time, and what it has sent.
"""

from __future__ import annotations

import contextlib
import functools
import io
import ipaddress
import json
import re
import secrets
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from email.message import Message
from http.server import BaseHTTPRequestHandler
from socketserver import TCPServer, ThreadingMixIn
from typing import Any
from urllib.parse import urlsplit

from ..errors import InvalidInputError

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


#: A page that has not been heard of for so long loses the controls [s].
SILENCE = 5.0
#: Largest message that is read [bytes], and most settings in it.
MOST_BYTES, MOST_SETTINGS = 16384, 64
# Most presses of buttons, and names, that wait for the next slice.
_MOST_WAITING = 64


class Lease:
    """The right to set controls, which one page holds, and what it has set since the last slice.

    The page that asks first gets a key, and holds the controls until it gives them back or is
    silent for some seconds. Of what is set more than once between two slices, the last counts.
    Its methods may be called by several threads.

    Args:
        clock: Returns the time [s].
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._key, self._heard = "", 0.0
        #: Whether any page has asked for the controls.
        self.was_asked = False
        self._waiting: dict[str, Any] = {}

    def ask(self, key: str = "") -> str:
        """Return the key of a page that holds the controls from now on; empty if another does.

        Args:
            key: The key that the page had, if any.
        """
        with self._lock:
            self.was_asked = True
            if self._is_held and not secrets.compare_digest(key.encode(), self._key.encode()):
                return ""
            if not (self._is_held and key):
                self._key = secrets.token_urlsafe(24)
            self._heard = self._clock()
            return self._key

    def give_back(self, key: str) -> None:
        """Let another page have the controls."""
        with self._lock:
            if self._fits(key):
                self._key = ""

    def fits(self, key: str) -> bool:
        """Return whether this is the key of the page that has the controls."""
        with self._lock:
            return self._fits(key)

    def take(self, key: str, text: bytes) -> None:
        """Take a message of the page that holds the controls: a list of pairs of name and value.

        Args:
            key: The page's key.
            text: The message, as JSON.

        Raises:
            PermissionError: If that page does not hold the controls.
            InvalidInputError: If it is no such message.
        """
        with self._lock:
            if not self._fits(key):
                raise PermissionError("another page has the controls")
            self._heard = self._clock()
        settings = _read(text)
        with self._lock:
            for name, value in settings:
                if name in self._waiting or len(self._waiting) < _MOST_WAITING:
                    # What is set again comes later.
                    self._waiting.pop(name, None)
                    self._waiting[name] = value

    def take_all(self) -> dict[str, Any]:
        """Return what was set since the last call, by name, in its order."""
        with self._lock:
            settings, self._waiting = self._waiting, {}
            return settings

    @property
    def is_held(self) -> bool:
        """Whether a page has the controls."""
        with self._lock:
            return self._is_held

    @property
    def _is_held(self) -> bool:
        return bool(self._key) and self._clock() - self._heard < SILENCE

    def _fits(self, key: str) -> bool:
        same = secrets.compare_digest(key.encode(), self._key.encode())
        return bool(self._key) and same


def _read(text: bytes) -> list[tuple[str, Any]]:
    """Return the settings of a message.

    Raises:
        InvalidInputError: If it is none.
    """
    if len(text) > MOST_BYTES:
        raise InvalidInputError(f"message: may have {MOST_BYTES} bytes, not {len(text)}")
    try:
        contents = json.loads(text)
    except (ValueError, RecursionError):
        raise InvalidInputError("message: must be JSON") from None
    if not isinstance(contents, list) or len(contents) > MOST_SETTINGS:
        raise InvalidInputError(f"message: must be a list of up to {MOST_SETTINGS} settings")
    for each in contents:
        if not (isinstance(each, list) and len(each) == 2 and isinstance(each[0], str)):
            raise InvalidInputError("message: must be a list of pairs of name and value")
    return [(name, value) for name, value in contents]


#: Most connections at once; for one more, the one that has been silent for longest is closed.
MOST_CONNECTIONS = 32
# Time after which a connection that could not be taken is tried again [s].
_AGAIN = 0.05
# How often it is looked whether the server is to end [s].
_POLL = 0.05
# What may be asked of each address.
_METHODS = {
    "/": ("GET", "HEAD"),
    "/state": ("GET", "HEAD"),
    "/controls": ("POST",),
    "/return": ("POST",),
    "/set": ("POST",),
}
_HTTP_METHODS = ("GET", "HEAD", "POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT")


@dataclass(frozen=True)
class Content:
    """What is served.

    Attributes:
        page: The page, as text.
        told: Returns what the page asks for from time to time, as plain data.
        lease: Who has the controls, and what is sent.
    """

    page: str
    told: Callable[[], Any]
    lease: Lease


class Server:
    """A server of one page, in threads of its own.

    It answers five addresses: ``/`` is the page and ``/state`` what it asks for; ``/controls``
    grants the controls, ``/return`` gives them back, and ``/set`` takes what is set. Messages must
    come from the page itself: a page of another site that runs in the same browser is refused by
    its origin, and by the host that it asks for. Who may send is looked at before what is sent.

    Args:
        host: Address to listen at.
        port: Port; 0 for any that is free.
        content: What is served.

    Raises:
        InvalidInputError: If it cannot listen there.
    """

    def __init__(self, host: str, port: int, content: Content) -> None:
        try:
            self._server = _Threads(host, port, content)
        except (OSError, OverflowError) as error:
            raise InvalidInputError(f"--host {host} --port {port}: {error}") from None
        serve = functools.partial(self._server.serve_forever, _POLL)
        self._thread = threading.Thread(target=serve, daemon=True)
        self._thread.start()
        name = f"[{host}]" if ":" in host else host
        self.url = f"http://{name}:{self._server.server_address[1]}/"

    def close(self) -> None:
        """Stop listening, and close every connection."""
        self._server.shutdown()
        self._server.server_close()
        self._server.close_connections()
        self._thread.join()


class _Threads(ThreadingMixIn, TCPServer):
    """A thread for each connection, of which there are only so many."""

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True
    request_queue_size = 64

    def __init__(self, host: str, port: int, content: Content) -> None:
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self.served = content
        self._lock = threading.Lock()
        # Connections that are open, from the one that has been silent for longest.
        self._open: dict[socket.socket, _Handler | None] = {}
        super().__init__((host, port), _Handler)
        self.is_this = hosts_of(host, str(self.server_address[0]))

    def get_request(self) -> tuple[Any, Any]:
        """Take a connection; for one too many, close another one."""
        try:
            request, address = super().get_request()
        except OSError:
            # As when no descriptors are left: it is tried again, but not at once.
            time.sleep(_AGAIN)
            raise
        with self._lock:
            if len(self._open) >= MOST_CONNECTIONS:
                _close(self._oldest())
            self._open[request] = None
        return request, address

    def _oldest(self) -> socket.socket:
        """Return the connection that has been silent for longest, rather than one that is busy."""
        idle = [each for each, by in self._open.items() if by is None or not by.stream.is_busy]
        oldest = (idle or list(self._open))[0]
        del self._open[oldest]
        return oldest

    def note_request(self, request: socket.socket, handler: _Handler) -> None:
        """Note that a request came over a connection, or that it is waited for."""
        with self._lock:
            if request in self._open:
                del self._open[request]
                self._open[request] = handler

    def shutdown_request(self, request: Any) -> None:
        """Close a connection that has been served."""
        with self._lock:
            self._open.pop(request, None)
        super().shutdown_request(request)

    def close_connections(self) -> None:
        """Close all connections."""
        with self._lock:
            for each in self._open:
                _close(each)
            self._open.clear()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Pass over a connection that breaks off."""


class _Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    server: _Threads
    protocol_version = "HTTP/1.1"
    # An answer is sent whole and at once: a part of one is confirmed only after 40 ms.
    disable_nagle_algorithm = True
    wbufsize = -1

    def setup(self) -> None:
        """Read within bounds."""
        super().setup()
        self.stream = Stream(self.connection)
        self.server.note_request(self.connection, self)

    def handle_one_request(self) -> None:
        """Answer the next request of the connection."""
        self.close_connection = True
        # What an answer to something that is no request is made with.
        self.command, self.request_version, self.requestline = "", "HTTP/1.1", ""
        try:
            if not (head := self.stream.head()):
                return
            self.server.note_request(self.connection, self)
            self._carry_out(head)
        except RefusedError as error:
            self.close_connection = True
            self._answer(error.status, "text/plain", str(error).encode())
        except PermissionError as error:
            self._answer(403, "text/plain", str(error).encode())
        except InvalidInputError as error:
            self._answer(400, "text/plain", str(error).encode())
        self.wfile.flush()
        if self.close_connection:
            self.stream.discard()

    def _carry_out(self, head: bytes) -> None:
        """Read a request and answer it.

        Raises:
            RefusedError: If it is refused.
        """
        check_head(head)
        line, _, rest = head.partition(b"\n")
        self.raw_requestline, self.rfile = line + b"\n", io.BytesIO(rest)
        if not self.parse_request():
            # It has been answered.
            self.close_connection = True
            return
        closes, self.close_connection = self.close_connection, True
        self._check_host()
        self._check_method()
        if self.command == "POST":
            self._check_origin()
            self._check_key()
        length = length_of(self.headers, MOST_BYTES)
        if length and self.headers.get("Expect", "").lower() == "100-continue":
            self.send_response_only(100)
            self.end_headers()
            self.wfile.flush()
        body = self.stream.body(length)
        # From here on it is known where the next request begins.
        self.close_connection = closes
        self._reply(body)

    def handle_expect_100(self) -> bool:
        """Wait with the consent to a message until it is known who sends it."""
        return True

    def _reply(self, body: bytes) -> None:
        key, lease = self.headers.get("X-Key", ""), self.server.served.lease
        if self.path == "/":
            page = self.server.served.page.encode()
            self._answer(200, "text/html; charset=utf-8", page)
        elif self.path == "/state":
            self._tell(self.server.served.told())
        elif self.path == "/controls":
            self._tell({"key": lease.ask(key)})
        elif self.path == "/return":
            lease.give_back(key)
            self._tell({})
        else:
            lease.take(key, body)
            self._tell({})

    def _check_host(self) -> None:
        """Refuse a host other than this one: a name that leads here by deceit."""
        host = sole(self.headers, "Host")
        if host is None and self.request_version == "HTTP/1.1":
            raise RefusedError(400, "Host must be given")
        if host is None or not self.server.is_this(host_in(host)):
            raise RefusedError(403, "another host was asked for")

    def _check_method(self) -> None:
        able = _METHODS.get(self.path)
        if self.command not in _HTTP_METHODS:
            raise RefusedError(501, "there is no such method")
        if able is None:
            raise RefusedError(404, "there is no such page")
        if self.command not in able:
            raise RefusedError(405, f"may be {' or '.join(able)}")

    def _check_origin(self) -> None:
        """Refuse what is not of the page that was served, by the browser's own account."""
        origin, host = sole(self.headers, "Origin"), sole(self.headers, "Host")
        if origin is not None and not _is_of(origin, host):
            raise RefusedError(403, "messages come from the page alone")

    def _check_key(self) -> None:
        """Refuse what is set by another page than the one that has the controls."""
        key = sole(self.headers, "X-Key") or ""
        if self.path == "/set" and not self.server.served.lease.fits(key):
            raise RefusedError(403, "another page has the controls")

    def _tell(self, data: Any) -> None:
        self._answer(200, "application/json", json.dumps(data, allow_nan=False).encode())

    def _answer(self, status: int, kind: str, body: bytes) -> None:
        # A connection that does not take the answer is closed.
        self.connection.settimeout(IDLE)
        self.send_response(status)
        if status == 405:
            self.send_header("Allow", ", ".join(_METHODS[self.path]))
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("X-Frame-Options", "DENY")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""


def _is_of(origin: str, host: str | None) -> bool:
    try:
        return urlsplit(origin).netloc == host
    except ValueError:
        return False


def _close(connection: socket.socket) -> None:
    """End a connection that another thread may be reading."""
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)

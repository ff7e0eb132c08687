"""The page and its messages over HTTP, of one address of this machine."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from ..errors import InvalidInputError
from .lease import MOST_BYTES, Lease

# A connection from which nothing comes for so long is closed [s].
_PATIENCE = 30.0
#: Addresses of this machine that no other one can reach.
LOCAL = ("localhost", "127.0.0.1", "::1")


@dataclass(frozen=True)
class Served:
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

    It answers four addresses: ``/`` is the page and ``/state`` what it asks for; ``/controls``
    grants the controls and gives them back, and ``/set`` takes what is set. Messages must come from
    the page itself: a page of another site that runs in the same browser is refused by its origin.

    Args:
        host: Address to listen at.
        port: Port; 0 for any that is free.
        served: What is served.

    Raises:
        InvalidInputError: If it cannot listen there.
    """

    def __init__(self, host: str, port: int, served: Served) -> None:
        handler = type("Handler", (_Handler,), {"served": served, "host": host})
        try:
            self._server = _Threads((host, port), handler)
        except (OSError, OverflowError) as error:
            raise InvalidInputError(f"--host {host} --port {port}: {error}") from None
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        name = f"[{host}]" if ":" in host else host
        self.url = f"http://{name}:{self._server.server_address[1]}/"

    def close(self) -> None:
        """Stop listening."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Threads(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Pass over a connection that breaks off."""


class _Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    served: Served
    host: str
    protocol_version = "HTTP/1.1"
    timeout = _PATIENCE

    def do_GET(self) -> None:
        """Answer with the page, or with what it asks for."""
        if not self._is_addressed():
            self._answer(403, "text/plain", b"another host was asked for")
        elif self.path == "/":
            self._answer(200, "text/html; charset=utf-8", self.served.page.encode())
        elif self.path == "/state":
            self._tell(self.served.told())
        else:
            self._answer(404, "text/plain", b"there is no such page")

    def do_POST(self) -> None:
        """Take a message."""
        text = self._body()
        if text is None:
            return
        if not (self._is_addressed() and self._is_from_page()):
            self._answer(403, "text/plain", b"messages come from the page alone")
            return
        key, lease = self.headers.get("X-Key", ""), self.served.lease
        try:
            if self.path == "/controls":
                self._tell({"key": lease.ask(key)})
            elif self.path == "/return":
                lease.give_back(key)
                self._tell({})
            elif self.path == "/set":
                lease.take(key, text)
                self._tell({})
            else:
                self._answer(404, "text/plain", b"there is no such address")
        except PermissionError as error:
            self._answer(403, "text/plain", str(error).encode())
        except InvalidInputError as error:
            self._answer(400, "text/plain", str(error).encode())

    def _body(self) -> bytes | None:
        """Return what was sent; None, with an answer, if it is too much."""
        length = self.headers.get("Content-Length", "0")
        if not length.isascii() or not length.isdigit() or int(length[:9]) > MOST_BYTES:
            self.close_connection = True
            self._answer(413, "text/plain", b"the message is too long")
            return None
        return self.rfile.read(int(length))

    def _is_addressed(self) -> bool:
        """Return whether this host was asked for, and not a name that leads here by deceit."""
        asked = urlsplit(f"//{self.headers.get('Host', '')}").hostname or ""
        return self.host not in LOCAL or asked in LOCAL

    def _is_from_page(self) -> bool:
        """Return whether a message is of the page that was served, by the browser's own account."""
        origin = self.headers.get("Origin")
        return origin is None or urlsplit(origin).netloc == self.headers.get("Host")

    def _tell(self, data: Any) -> None:
        self._answer(200, "application/json", json.dumps(data, allow_nan=False).encode())

    def _answer(self, status: int, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("X-Frame-Options", "DENY")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""

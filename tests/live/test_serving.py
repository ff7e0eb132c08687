"""Who is answered, and what a stranger can do."""

import http.client
import json
import os
import re
import socket
import threading
from contextlib import ExitStack, contextmanager
from select import select
from urllib.parse import urlsplit

import pytest

from drake_rnn import InvalidInputError
from drake_rnn.live import serving
from drake_rnn.live.serving import (
    MOST_BYTES,
    MOST_CONNECTIONS,
    MOST_HEAD,
    SILENCE,
    Content,
    Lease,
    Server,
    hosts_of,
)
from process_helpers import PATIENCE, wait_for


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@contextmanager
def served(host="localhost"):
    lease = Lease(Clock())
    server = Server(host, 0, Content("<p>page</p>", lambda: {"version": 1}, lease))
    try:
        yield urlsplit(server.url), lease
    finally:
        server.close()


def ask(url, method, path, body=None, **headers):
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=PATIENCE)
    names = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body, names)
    answer = connection.getresponse()
    text = answer.read()
    connection.close()
    return answer.status, text


def key_of(url, **headers):
    return json.loads(ask(url, "POST", "/controls", **headers)[1])["key"]


def test_the_page_gets_the_controls_and_a_second_one_does_not():
    with served() as (url, lease):
        assert ask(url, "GET", "/") == (200, b"<p>page</p>")
        assert json.loads(ask(url, "GET", "/state")[1]) == {"version": 1}
        key = key_of(url)
        assert key
        assert key_of(url) == ""
        assert key_of(url, X_Key=key) == key
        assert ask(url, "POST", "/set", '[["a", 1], ["b", null], ["a", 2]]', X_Key=key)[0] == 200
        assert list(lease.take_all().items()) == [("b", None), ("a", 2)]
        for wrong in ("", "guess", key[:-1]):
            assert ask(url, "POST", "/set", '[["a", 3]]', X_Key=wrong)[0] == 403
        assert lease.take_all() == {}
        ask(url, "POST", "/return", X_Key=key)
        assert key_of(url) not in ("", key)


def test_a_page_that_is_silent_loses_the_controls():
    clock = Clock()
    lease = Lease(clock)
    first = lease.ask()
    clock.now = SILENCE - 0.1
    assert lease.ask() == ""
    clock.now = SILENCE + 0.1
    second = lease.ask()
    assert second not in ("", first)
    with pytest.raises(PermissionError):
        lease.take(first, b"[]")
    lease.take(second, b"[]")


def test_pages_of_other_sites_are_refused():
    with served() as (url, lease):
        origin = f"http://localhost:{url.port}"
        assert ask(url, "POST", "/controls", Origin="https://evil.example")[0] == 403
        assert ask(url, "POST", "/controls", Origin="null")[0] == 403
        # A name of another site that leads to this machine.
        assert ask(url, "GET", "/", Host=f"evil.example:{url.port}")[0] == 403
        assert ask(url, "POST", "/controls", Origin=origin)[0] == 200
        assert lease.is_held


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "null",
        "{}",
        '[["a"]]',
        '[["a", 1, 2]]',
        "[[1, 1]]",
        '["ab"]',
        json.dumps([["a", 1]] * 65),
        "[" * 3000,
        "1" * 5000,
    ],
)
def test_what_is_no_message_is_refused(text):
    lease = Lease(Clock())
    with pytest.raises(InvalidInputError, match="message"):
        lease.take(lease.ask(), text.encode())
    assert lease.take_all() == {}


def test_a_flood_is_bounded():
    lease = Lease(Clock())
    key = lease.ask()
    for k in range(1000):
        lease.take(key, json.dumps([[f"name {k}", k], ["target", k]]).encode())
    found = lease.take_all()
    assert len(found) <= 64
    assert found["target"] == 999


def test_what_is_too_long_or_nowhere_is_refused():
    with served() as (url, _):
        key = key_of(url)
        assert ask(url, "POST", "/set", " " * (MOST_BYTES + 1), X_Key=key)[0] == 413
        assert ask(url, "POST", "/set", Content_Length="-1", X_Key=key)[0] == 400
        assert ask(url, "POST", "/other")[0] == 404
        assert ask(url, "GET", "/../etc/passwd")[0] == 404


def test_a_port_that_is_taken_is_refused_by_name():
    with served() as (url, lease), pytest.raises(InvalidInputError, match="--port"):
        Server("localhost", url.port, Content("", dict, lease))


def connected(url):
    connection = socket.create_connection((url.hostname, url.port), timeout=PATIENCE)
    connection.settimeout(PATIENCE)
    return connection


def told(connection):
    """Return the status that a connection answers, after which it may be open."""
    first = connection.makefile("rb").readline()
    return int(first.split()[1]) if first else None


def status(url, text):
    with connected(url) as connection:
        connection.sendall(text.encode("latin-1"))
        return told(connection)


# What follows the first line where nothing is wrong with it, by its name in the table below.
HOST, KEY = "Host: localhost\r\n", "Host: localhost\r\nX-Key: {key}\r\n"
REQUESTS = {
    # Who sends is looked at before what is sent.
    "a long message of who has no key": ("POST /set", HOST + "Content-Length: 300000000", 403),
    "of another site": ("POST /set", "Host: evil.example\r\nContent-Length: 300000000", 403),
    "of another page": (
        "POST /controls",
        HOST + "Origin: http://evil.example\r\nContent-Length: 300000000",
        403,
    ),
    "of who waits for consent": (
        "POST /set",
        HOST + "Expect: 100-continue\r\nContent-Length: 9",
        403,
    ),
    # Lengths.
    "too long, with zeros before it": (
        "POST /set",
        KEY + "Content-Length: 000000000300000000",
        413,
    ),
    "too long by thousands of digits": ("POST /set", KEY + "Content-Length: " + "9" * 5000, 413),
    "a number with a sign": ("POST /set", KEY + "Content-Length: +2", 400),
    "a negative one": ("POST /set", KEY + "Content-Length: -2", 400),
    "one in other digits": ("POST /set", KEY + "Content-Length: \xb2", 400),
    "one with an underscore": ("POST /set", KEY + "Content-Length: 1_0", 400),
    "one that is none": ("POST /set", KEY + "Content-Length: 0x2", 400),
    "two in one": ("POST /set", KEY + "Content-Length: 2, 2", 400),
    "two": ("POST /set", KEY + "Content-Length: 2\r\nContent-Length: 2", 400),
    "none, in pieces": ("POST /set", KEY + "Transfer-Encoding: chunked", 411),
    "in an odd coding": ("POST /set", KEY + "Transfer-Encoding: gzip, chunked", 501),
    "both": ("POST /set", KEY + "Content-Length: 2\r\nTransfer-Encoding: chunked", 400),
    # Heads.
    "a long address": ("GET /" + "a" * MOST_HEAD, HOST, 431),
    "a long header": ("GET /", HOST + "X: " + "a" * MOST_HEAD, 431),
    "many headers": ("GET /", HOST + "X: y\r\n" * 150, 431),
    "no host": ("GET /", "X: y", 400),
    "two hosts": ("GET /", HOST + HOST, 400),
    "half a host": ("GET /", "Host: [", 400),
    "a user at a host": ("GET /", "Host: localhost@evil.example", 400),
    "a name that begins like the host": ("GET /", "Host: localhost.evil.example", 403),
    "the host in capitals": ("GET /", "Host: LOCALHOST.:8040", 200),
    "a line that goes on": ("GET /", HOST + "X: a\r\n b", 400),
    "a line with an odd end": ("GET /", HOST + "X: a\rContent-Length: 5", 400),
    "a line that is none": ("GET /", HOST + "garbage", 400),
    "a name with a space": ("POST /set", KEY + "Content-Length : 2", 400),
    "two keys": ("POST /set", KEY + "X-Key: a", 400),
    "two origins": ("POST /controls", HOST + "Origin: http://localhost\r\nOrigin: null", 400),
    "half an origin": ("POST /controls", HOST + "Origin: http://[", 403),
    # Methods and addresses.
    "an odd method": ("FETCH /", HOST, 501),
    "a method that is not for it": ("GET /set", HOST, 405),
    "another": ("PUT /", HOST, 405),
    "what a browser asks before": ("OPTIONS /set", HOST + "Origin: http://evil.example", 405),
    "a head alone": ("HEAD /", HOST, 200),
    "a file": ("GET /../../etc/passwd", HOST, 404),
    "a whole address": ("GET http://evil.example/", HOST, 404),
}


@pytest.fixture(scope="module")
def one_server():
    with served() as (url, lease):
        yield url, lease


@pytest.mark.parametrize("name", REQUESTS)
def test_a_request_is_answered_by_its_status(one_server, name):
    (url, lease), (first, headers, answer) = one_server, REQUESTS[name]
    key = lease.ask(lease.ask())
    lease.give_back(key)
    key = lease.ask()
    text = f"{first} HTTP/1.1\r\n{headers.format(key=key)}".removesuffix("\r\n")
    assert status(url, f"{text}\r\n\r\n") == answer
    lease.give_back(key)


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("GET / HTTP/1.0", 200),
        ("GET / HTTP/2.0", 505),
        ("GET /", 400),
        ("GET  / HTTP/1.1", 400),
        ("GET / HTTQ/1.1", 400),
        ("\x16\x03\x01", 400),
        ("\r\n\r\nGET / HTTP/1.1", 200),
    ],
)
def test_a_first_line_is_answered_by_its_status(one_server, line, answer):
    assert status(one_server[0], f"{line}\r\n{HOST}\r\n") == answer


def test_a_message_comes_after_consent_and_the_next_one_after_it(one_server):
    url, lease = one_server
    key = lease.ask()
    with connected(url) as connection:
        head = f"POST /set HTTP/1.1\r\n{KEY.format(key=key)}Expect: 100-continue\r\n"
        connection.sendall(f"{head}Content-Length: 00010\r\n\r\n".encode())
        answers = connection.makefile("rb")
        assert answers.readline().split()[1] == b"100"
        connection.sendall(b'[["a", 1]]GET /nothing HTTP/1.1\r\nHost: localhost\r\n\r\n')
        assert re.findall(rb"HTTP/1.1 (\d+)", answers.read()) == [b"200", b"404"]
    assert lease.take_all() == {"a": 1}
    lease.give_back(key)


@pytest.mark.parametrize(
    ("host", "address", "asked", "is_this"),
    [
        ("localhost", "127.0.0.1", ("localhost", "127.0.0.1", "::1"), True),
        ("localhost", "127.0.0.1", ("evil.example", "127.0.0.2", "192.168.1.7", ""), False),
        ("127.0.0.2", "127.0.0.2", ("127.0.0.2",), True),
        ("127.0.0.2", "127.0.0.2", ("evil.example", "localhost", "127.0.0.1"), False),
        ("robot.lab", "192.168.1.7", ("robot.lab", "192.168.1.7"), True),
        ("robot.lab", "192.168.1.7", ("evil.example", "localhost", "192.168.1.8"), False),
        ("0:0:0:0:0:0:0:1", "::1", ("::1", "localhost"), True),
        ("0.0.0.0", "0.0.0.0", ("192.168.1.7", "localhost", socket.gethostname().lower()), True),
        ("0.0.0.0", "0.0.0.0", ("evil.example", "127.0.0.1.evil.example"), False),
        ("::", "::", ("2001:db8::1", "192.168.1.7"), True),
    ],
)
def test_only_what_is_listened_at_may_be_asked_for(host, address, asked, is_this):
    assert {hosts_of(host, address)(each) for each in asked} == {is_this}


def test_no_address_gives_its_key_to_a_name_of_another_site():
    with served("127.0.0.2") as (url, lease):
        assert ask(url, "POST", "/controls", Host=f"evil.example:{url.port}")[0] == 403
        assert not lease.is_held
        assert key_of(url)


def test_an_answer_is_not_held_back(monkeypatch):
    """A second part of one would be sent only once the first is confirmed, 40 ms later."""
    parts, at_once = [], []
    write, setup = socket.SocketIO.write, serving._Handler.setup

    def written(self, part):
        parts.append(bytes(part))
        return write(self, part)

    def told(self):
        setup(self)
        at_once.append(self.connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))

    monkeypatch.setattr(socket.SocketIO, "write", written)
    monkeypatch.setattr(serving._Handler, "setup", told)
    with served() as (url, _):
        for asked in range(1, 4):
            assert ask(url, "POST", "/controls", "null")[0] == 200
            assert len(parts) == len(at_once) == asked
    assert all(part.startswith(b"HTTP/1.1 200 ") and b"key" in part for part in parts)
    assert all(at_once)


def test_connections_that_say_nothing_keep_nobody_out():
    files, threads = len(os.listdir("/proc/self/fd")), threading.active_count()
    with served() as (url, _), ExitStack() as stack:
        for k in range(4 * MOST_CONNECTIONS):
            connection = stack.enter_context(connected(url))
            connection.sendall((b"", b"POST /set HT", b"GET / HTTP/1.1\r\nX: ")[k % 3])
            if k % 16 == 15:
                assert ask(url, "GET", "/state")[0] == 200
        assert threading.active_count() - threads < 2 * MOST_CONNECTIONS
    assert wait_for(lambda: len(os.listdir("/proc/self/fd")) <= files)


def test_a_request_that_trickles_in_is_given_up(monkeypatch):
    monkeypatch.setattr(serving, "WHOLE", 0.2)
    with served() as (url, _), connected(url) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n")
        answers = connection.makefile("rb")
        while not select([connection], [], [], 0.01)[0]:
            connection.sendall(b"X: y\r\n")
        assert answers.readline().split()[1] == b"408"


def test_a_silent_connection_is_closed(monkeypatch):
    monkeypatch.setattr(serving, "IDLE", 0.1)
    with served() as (url, _), connected(url) as connection:
        assert told(connection) is None


def test_a_body_that_ends_before_its_length_sets_nothing(one_server):
    url, lease = one_server
    key = lease.ask()
    with connected(url) as connection:
        head = f"POST /set HTTP/1.1\r\n{KEY.format(key=key)}Content-Length: 99\r\n\r\n"
        connection.sendall(f'{head}[["a", 1]]'.encode())
        connection.shutdown(socket.SHUT_WR)
        assert told(connection) == 408
    assert lease.take_all() == {}
    lease.give_back(key)


def test_the_end_of_a_server_ends_its_connections():
    with served() as (url, _):
        open_one = http.client.HTTPConnection(url.hostname, url.port, timeout=PATIENCE)
        open_one.request("GET", "/")
        open_one.getresponse().read()
        ended = open_one.sock
    assert ended.recv(1) == b""
    open_one.close()

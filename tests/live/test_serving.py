"""Who is answered, and what a stranger can do."""

import http.client
import json
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

from drake_rnn import InvalidInputError
from drake_rnn.live.lease import MOST_BYTES, SILENCE, Lease
from drake_rnn.live.serving import Served, Server


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@contextmanager
def served():
    lease = Lease(Clock())
    server = Server("localhost", 0, Served("<p>page</p>", lambda: {"version": 1}, lease))
    try:
        yield urlsplit(server.url), lease
    finally:
        server.close()


def ask(url, method, path, body=None, **headers):
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=10)
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
        assert list(lease.taken().items()) == [("b", None), ("a", 2)]
        for wrong in ("", "guess", key[:-1]):
            assert ask(url, "POST", "/set", '[["a", 3]]', X_Key=wrong)[0] == 403
        assert lease.taken() == {}
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
    assert lease.taken() == {}


def test_a_flood_is_bounded():
    lease = Lease(Clock())
    key = lease.ask()
    for k in range(1000):
        lease.take(key, json.dumps([[f"name {k}", k], ["target", k]]).encode())
    found = lease.taken()
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
        Server("localhost", url.port, Served("", dict, lease))

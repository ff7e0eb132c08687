"""What is public stays as it was in the last release, or the changelog says what has changed."""

import re
import runpy
from pathlib import Path
from typing import NamedTuple

import pytest

import drake_rnn

ROOT = Path(__file__).parents[1]
#: The interfaces of past releases, each made by `docs/make_interface.py` there.
RELEASES = {
    file.stem.removeprefix("interface_"): file.read_text().splitlines()
    for file in (ROOT / "tests" / "data").glob("interface_*.txt")
}
LAST = max(RELEASES, key=lambda version: tuple(map(int, version.split("."))))
_LINE = re.compile(
    r"(?P<kind>\w+) (?P<name>\w+)(?:\((?P<parameters>.*?)\))?(?::\s*(?P<members>.*))?"
)


class Entry(NamedTuple):
    """A public name: its kind, its parameters, those that must be given, and its members."""

    kind: str
    parameters: set[str]
    needed: set[str]
    members: set[str]


def entries(lines):
    found = {}
    for line in lines:
        parts = _LINE.fullmatch(line.strip())
        given, members = (
            set(filter(None, (parts[name] or "").split(", "))) for name in ("parameters", "members")
        )
        needed = {each for each in given if not each.endswith("=")}
        names = {each.removesuffix("=") for each in given}
        found[parts["name"]] = Entry(parts["kind"], names, needed, members)
    return found


LINES = list(runpy.run_path(str(ROOT / "docs" / "make_interface.py"))["interface"]())
BEFORE, NOW = entries(RELEASES[LAST]), entries(LINES)


def announced():
    """Return what the changelog says names as it tells of changes since the last release."""
    text = (ROOT / "CHANGELOG.md").read_text().partition(f"## [{LAST}]")[0]
    return set(re.findall(r"\w+", " ".join(re.findall(r"`([^`]+)`", text))))


def test_the_last_release_is_the_version_that_the_package_has():
    """Or an older one, while a new release is being made."""
    assert drake_rnn.__version__ == LAST


def test_a_public_name_is_there_or_works_with_a_warning():
    gone = BEFORE.keys() - NOW.keys()
    assert gone == {"Driven", "Paced", "Tuned"}
    for name in gone:
        with pytest.warns(DeprecationWarning, match=f"drake_rnn.{name} is now drake_rnn."):
            assert drake_rnn.__getattr__(name)
        assert name in announced()


def test_what_may_be_given_may_be_given_or_the_changelog_has_it():
    words, unannounced = announced(), []
    for name in BEFORE.keys() & NOW.keys():
        before, now = BEFORE[name], NOW[name]
        changes = {
            "no longer there": before.parameters - now.parameters,
            "to be given": now.needed - before.parameters,
            "no longer a member": before.members - now.members,
            f"is no {before.kind} any longer": {name} if before.kind != now.kind else set(),
        }
        for what, items in changes.items():
            unannounced += [f"{name}: {item} {what}" for item in sorted(items - words)]
    assert unannounced == []


def test_a_lost_parameter_would_be_seen():
    """The comparison itself: `simulate` without its argument `compiled`."""
    (line,) = (each for each in LINES if each.startswith("def simulate("))
    now = entries([line.replace(", compiled=", "")])["simulate"]
    assert entries([line])["simulate"].parameters - now.parameters == {"compiled"}

"""Libraries of steps in C: broken ones in the cache are built anew; compilers that are none."""

import os
import resource
import subprocess
import sys
from errno import ENOSPC

import pytest

from drake_rnn import DrakeRnnError, InvalidInputError
from drake_rnn.compiled import library
from drake_rnn.compiled.library import build_library, compiler, open_library
from row_helpers import assert_each

pytestmark = pytest.mark.skipif(compiler() is None, reason="needs a C compiler")
SOURCE = "int answer(void);\nint answer(void) { return %d; }\n"


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    compiler.cache_clear()
    yield tmp_path / "cache" / "drake_rnn" / "compiled"
    compiler.cache_clear()


def answer(number):
    return open_library(build_library(SOURCE % number), "answer").answer()


def flipped(content):
    return content[:1000] + bytes([content[1000] ^ 1]) + content[1001:]


def test_a_broken_library_is_built_anew(cache):
    """Before, one that was cut short was a bus error when it was loaded."""
    breaks = {
        "empty": lambda content: b"",
        "cut short": lambda content: content[: len(content) // 2],
        "a byte short": lambda content: content[:-1],
        "a bit flipped": flipped,
        "text": lambda content: b"hello",
        "of another machine": lambda content: content[:18] + b"\xf3\x00" + content[20:],
    }
    for number, (name, broken) in enumerate(breaks.items()):
        file = build_library(SOURCE % number)
        file.write_bytes(broken(file.read_bytes()))
        assert answer(number) == number, name
    file = build_library(SOURCE % 0)
    content = file.read_bytes()
    file.unlink()
    file.mkdir()
    with pytest.raises(InvalidInputError, match="XDG_CACHE_HOME: cannot keep "):
        build_library(SOURCE % 0)
    file.rmdir()
    file.with_name("other-" + file.name).write_bytes(content)
    assert answer(0) == 0
    assert len(list(cache.iterdir())) == len(breaks) + 1


def test_a_compiler_that_is_none_is_told(cache, tmp_path, monkeypatch):
    """Before, FileNotFoundError, or another compiler than the one that was named."""

    def script(text, mode=0o755):
        file = tmp_path / f"cc{len(list(tmp_path.glob('cc*')))}"
        file.write_text(text)
        file.chmod(mode)
        return str(file)

    output = 'while [ "$1" != -o ]; do shift; done; '
    cases = {
        "no such file": ("/no/such/cc", "CC: must name a C compiler that can be run, not '/no"),
        "no such name": ("no_such_cc", "CC: must name a C compiler that can be run, not 'no"),
        "a folder": (str(tmp_path), "CC: must name a C compiler that can be run, not"),
        "an open quote": ("gcc '", 'CC: must name a C compiler that can be run, not "gcc \'"'),
        "not executable": (script("#!/bin/sh\n", 0o644), "CC: must name a C compiler"),
        "no program": (script("hello"), "compiled: cc1 cannot be run: Exec format error"),
        "writes nothing": ("/bin/true", "compiled: true has written no library"),
        "fails": ("/bin/false", "compiled: false refuses the step: status 1"),
        "is killed": (script("#!/bin/sh\nkill -9 $$"), "refuses the step: it is ended by signal 9"),
        "no text": (script("#!/bin/sh\nprintf '\\377' >&2; exit 2"), "refuses the step: \ufffd"),
        "an empty file": (script(f'#!/bin/sh\n{output}: > "$2"'), "has written no library"),
        "a text": (script(f'#!/bin/sh\n{output}echo no > "$2"'), "what the C compiler has built"),
        "another library": (
            script(f'#!/bin/sh\n{output}echo "int x;" | gcc -shared -x c -o "$2" -'),
            "what the C compiler has built cannot be loaded",
        ),
    }  # fmt: skip

    def assert_told(command, said):
        monkeypatch.setenv("CC", command)
        compiler.cache_clear()
        # What was built wrongly must not be there the second time.
        for _ in range(2):
            with pytest.raises(InvalidInputError) as caught:
                answer(1)
            assert said in str(caught.value)

    assert_each(assert_told, cases)


def test_a_compiler_that_does_not_end_is_ended(cache, tmp_path, monkeypatch):
    file = tmp_path / "endless"
    file.write_text("#!/bin/sh\nexec sleep 60")
    file.chmod(0o755)
    monkeypatch.setattr(library, "_LONGEST", 0.2)
    monkeypatch.setenv("CC", str(file))
    with pytest.raises(InvalidInputError, match="endless has not ended with the step in"):
        answer(1)


def test_a_compiler_may_have_options(cache, monkeypatch):
    monkeypatch.setenv("CC", f"{' '.join(compiler())} -g0")
    compiler.cache_clear()
    assert compiler()[1:] == ("-g0",)
    assert answer(2) == 2


def limited():
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))


def test_no_room_for_files_is_told(cache, tmp_path, monkeypatch):
    """As on a full disk; before, a traceback, and a file that nobody removed."""
    script = (
        "from drake_rnn.compiled.library import build_library\n"
        "from drake_rnn import InvalidInputError\n"
        "try: build_library({!r})\n"
        "except InvalidInputError as error: print(error)\n"
    )
    for source in (SOURCE % 1, "/*" + 3000 * " " + "*/"):
        command = [sys.executable, "-c", script.format(source)]
        process = subprocess.run(
            command, capture_output=True, text=True, preexec_fn=limited, check=False
        )
        assert process.returncode == 0, process.stderr
        assert process.stdout.startswith("compiled: ")
        assert process.stdout.count("\n") == 1

    def full(*names):
        raise OSError(ENOSPC, os.strerror(ENOSPC))

    monkeypatch.setattr("drake_rnn.inputs.files.os.replace", full)
    with pytest.raises(DrakeRnnError, match=r"cannot keep .*: No space left on device; give"):
        build_library(SOURCE % 3)
    assert not list(cache.iterdir())

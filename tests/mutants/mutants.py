"""Mutants of laws, limits, metrics and evaluation: whether the quick tests see a changed sign.

A mutant is a module with one change: another operator, comparison or number, a loop that does not
run. Annotations and decorators are left alone, and so are changes that raise a TypeError at once.
The tests that `tests_of.yaml` names for the module run against it until one fails. A mutant that
passes them all shows something that is not tested, or a change that makes no difference; the latter
stand with their reason in `explained.yaml`.

Run ``python tests/mutants/mutants.py [number] [module ...]``. The sample is the same in each run,
and a larger one holds the smaller one. Files are not changed: a mutant is imported in place of its
module, in a process of its own.
"""

import argparse
import ast
import difflib
import importlib
import multiprocessing
import os
import random
import re
import resource
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path

import parso
import pytest
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names
from hypothesis import Phase, settings

from tables import PACKAGE, explained, tests_of

#: Processor time after which a test is taken to hang, which kills its mutant [s]; and real time
#: after which all of its tests are, for what hangs without computing.
CPU_TIME, WALL_TIME = 120, 3600
#: Memory that a mutant may ask for [bytes].
MEMORY = 16 * 2**30

# Shifts, and bitwise operators in place of arithmetic ones, raise TypeError with floats: killing
# such mutants shows nothing. The same is true of `is` in place of a comparison.
_TRIVIAL = re.compile(
    "Shift|Bit(Or|And|Xor)|FloorDiv|Mod|_Is|Is_|IsNot|Pow|Variable|RemoveDecorator"
)


@dataclass(frozen=True)
class Mutant:
    """A module with one change."""

    module: str
    code: str
    was: str
    now: str
    line: int


@dataclass(frozen=True)
class Outcome:
    """What came of a mutant: the test that failed, or none."""

    mutant: Mutant
    killer: str | None
    seconds: float


def places_of(module: str) -> list[tuple[str, int, int]]:
    """Return where what a module does can be changed, in an order of its own.

    Each place is an operator, the number of its occurrence, and the line.
    """
    code = (PACKAGE / module).read_text()
    nodes, spared = list(ast_nodes(get_ast(code))), _declarations(code) | _stars(code)
    places = []
    for name in sorted(name for name in operator_names() if not _TRIVIAL.search(name)):
        operator = get_operator(name)()
        starts = [start for node in nodes for start, _ in operator.mutation_positions(node)]
        places += [(name, occurrence, start) for occurrence, start in enumerate(starts)]
    random.Random(module).shuffle(places)
    return [(name, k, start[0]) for name, k, start in places if start not in spared]


def _declarations(code: str) -> set[tuple[int, int]]:
    """Return the places of all tokens in annotations and decorators, which say and do nothing."""
    within = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.arg | ast.AnnAssign):
            within.append(node.annotation)
        if isinstance(node, ast.FunctionDef):
            within.append(node.returns)
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            within += node.decorator_list
    spans = [
        ((node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset))
        for node in within
        if node is not None
    ]
    starts = [leaf.start_pos for leaf in _leaves(code)]
    return {start for start in starts if any(begin <= start < end for begin, end in spans)}


def _stars(code: str) -> set[tuple[int, int]]:
    """Return the places of stars that multiply nothing, as in ``*args``."""
    return {
        leaf.start_pos
        for leaf in _leaves(code)
        if leaf.value in ("*", "**", "/") and leaf.parent.type not in ("term", "power")
    }


def _leaves(code: str) -> Iterator[parso.tree.Leaf]:
    leaf = parso.parse(code).get_first_leaf()
    while leaf is not None:
        yield leaf
        leaf = leaf.get_next_leaf()


def mutant_at(module: str, place: tuple[str, int, int]) -> Mutant:
    """Return the mutant with a change at a place."""
    name, occurrence, line = place
    code = (PACKAGE / module).read_text()
    mutated = mutate_code(code, get_operator(name)(), occurrence)
    changes = list(difflib.unified_diff(code.splitlines(), mutated.splitlines(), n=0))[3:]
    was, now = (
        " ".join(change[1:].strip() for change in changes if change.startswith(sign))
        for sign in "-+"
    )
    return Mutant(module, mutated, was, now, line)


def sample(number: int, modules: list[str], only: list[str]) -> list[Mutant]:
    """Return some mutants of each module: at least one, and as many as its share of them all.

    Of some modules ``only`` they are those that are in the sample of all modules.
    """
    every = {module: places_of(module) for module in modules}
    total = sum(map(len, every.values()))
    return [
        mutant_at(module, place)
        for module, places in every.items()
        if not only or module in only
        for place in places[: max(1, round(number * len(places) / total))]
    ]


class _InPlaceOf(MetaPathFinder):
    """Imports a mutant in place of its module."""

    def __init__(self, mutant: Mutant) -> None:
        self._mutant = mutant
        self._name = "drake_rnn." + mutant.module.removesuffix(".py").replace("/", ".")

    def find_spec(self, name, path=None, target=None):
        if name != self._name:
            return None
        file, code = PACKAGE / self._mutant.module, self._mutant.code

        class Loader(SourceFileLoader):
            def get_code(self, fullname):
                return compile(code, str(file), "exec")

        return spec_from_file_location(name, file, loader=Loader(name, str(file)))


class _FirstFailure:
    """The test that fails first, or the file that cannot be read; each has its time."""

    found: str | None = None

    def pytest_sessionstart(self):
        # Which numbers a test fails with is not asked: looking for simple ones takes minutes.
        phases = (Phase.explicit, Phase.generate)
        settings.register_profile("mutants", settings.get_profile("repeatable"), phases=phases)
        settings.load_profile("mutants")

    def pytest_runtest_logstart(self):
        until = int(time.process_time()) + CPU_TIME
        resource.setrlimit(resource.RLIMIT_CPU, (until, resource.RLIM_INFINITY))

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.found = self.found or report.nodeid

    def pytest_collectreport(self, report):
        if report.failed:
            self.found = self.found or report.nodeid


def _run(mutant: Mutant | None, tests: list[str], answer) -> None:
    """Run tests in a process of its own, and send what failed first."""
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_TIME, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    # A shell that runs this in the background lets it ignore Ctrl-C, which tests send themselves.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    silence = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(silence, stream)
    if mutant is not None:
        sys.meta_path.insert(0, _InPlaceOf(mutant))
    failure = _FirstFailure()
    options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    # Of files the quick tests, then the long ones that are named one by one.
    long = [test for test in tests if "::" in test]
    for of, marks in ((tests, "not long and not nightly"), (long, "long")):
        code = pytest.main([*options, "-m", marks, *of], plugins=[failure]) if of else 0
        if code not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
            failure.found = failure.found or "importing"
        if failure.found:
            break
    answer.send(failure.found)


def outcome(mutant: Mutant | None, tests: list[str]) -> tuple[str | None, float]:
    """Return what failed first with a mutant in place of its module, and how long it took [s]."""
    began = time.monotonic()
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_run, args=(mutant, tests, sender))
    process.start()
    sender.close()
    process.join(WALL_TIME)
    if process.is_alive():
        process.kill()
        process.join()
    try:
        killer = receiver.recv()
    except EOFError:  # It hung, or brought the process down.
        killer = "no answer"
    return killer, time.monotonic() - began


def load_what_never_changes() -> None:
    """Import what is not ours once for all processes: it takes longer than most tests."""
    importlib.import_module("drake_rnn.cli")
    for name in ("hypothesis", "scipy.optimize", "scipy.integrate", "scipy.linalg"):
        importlib.import_module(name)
    for name in [name for name in sys.modules if name.split(".")[0] == "drake_rnn"]:
        del sys.modules[name]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("number", type=int, nargs="?", default=160, help="mutants, about")
    parser.add_argument("modules", nargs="*", help="of these alone, such as laws/law.py")
    arguments = parser.parse_args()
    os.chdir(PACKAGE.parent)
    table = tests_of()
    mutants = sample(arguments.number, list(table), arguments.modules)
    load_what_never_changes()
    reasons, outcomes = _reasons(), []
    for k, mutant in enumerate(mutants, start=1):
        if (mutant.module, mutant.was, mutant.now) in reasons:
            # It would pass all tests, and take the longest.
            outcomes.append(Outcome(mutant, None, 0.0))
            continue
        tests = [str(Path("tests") / file) for file in table[mutant.module]]
        outcomes.append(Outcome(mutant, *outcome(mutant, tests)))
        _say(k, len(mutants), outcomes[-1])
    return report(outcomes)


def _reasons() -> dict[tuple[str, str, str], str]:
    """Return why a mutant cannot be killed, by module, what was and what is."""
    return {
        (module, entry["was"], entry["now"]): entry["why"]
        for module, entries in explained().items()
        for entry in entries
    }


def _say(k: int, of: int, outcome: Outcome) -> None:
    mutant = outcome.mutant
    said = f"killed by {outcome.killer}" if outcome.killer else "SURVIVES"
    place = f"{mutant.module}:{mutant.line}"
    print(
        f"{k}/{of} {outcome.seconds:.0f} s {place}: {mutant.now or '(nothing)'}: {said}", flush=True
    )


def report(outcomes: list[Outcome]) -> int:
    """Print the table and the survivors; return 1 if one of them is not explained."""
    reasons = _reasons()
    survivors = [o.mutant for o in outcomes if o.killer is None]
    unexplained = [m for m in survivors if (m.module, m.was, m.now) not in reasons]
    print(f"\n{'module':40} {'mutants':>8} {'killed':>8} {'explained':>10}")
    for module in sorted({o.mutant.module for o in outcomes}):
        print(_row(module, [o for o in outcomes if o.mutant.module == module], unexplained))
    print(_row("all", outcomes, unexplained))
    for mutant in unexplained:
        print(f"\n{mutant.module}:{mutant.line}\n- {mutant.was}\n+ {mutant.now}")
    # A test that also fails without a mutant kills nothing.
    killers = {o.killer for o in outcomes if o.killer and ".py" in o.killer}
    broken, _ = outcome(None, sorted(killers))
    if killers and broken:
        print(f"\nfails without a mutant: {broken}")
    return 1 if unexplained or (killers and broken) else 0


def _row(name: str, outcomes: list[Outcome], unexplained: list[Mutant]) -> str:
    survivors = [o.mutant for o in outcomes if o.killer is None]
    told = len(survivors) - sum(mutant in unexplained for mutant in survivors)
    return f"{name:40} {len(outcomes):8} {len(outcomes) - len(survivors):8} {told:10}"


if __name__ == "__main__":
    sys.exit(main())

"""What all tests share."""

import gc
import importlib
import json
import os
import pickle
import signal
import sys
import time
from copy import deepcopy
from functools import cache, lru_cache

import numpy as np
import pytest
from hypothesis import settings
from typer import testing

import shared_runs
from browsing import chromium
from drake_rnn import LAWS, METRICS, OBJECTIVES, features, load_arm, shipped_arms
from drake_rnn.experiment import components as arms
from drake_rnn.experiment import experiment as reach
from drake_rnn.inputs import documents
from drake_rnn.jobs import campaign as perform
from drake_rnn.runs import simulation

# The same examples in each run, and none refused for the machine being busy.
settings.register_profile("repeatable", derandomize=True, deadline=None)
# Of `make test`; whole runs of the tests draw twice as many.
settings.register_profile("quick", settings.get_profile("repeatable"), max_examples=50)
settings.load_profile("repeatable")


def pytest_collection_modifyitems(items):
    """Long tests come first: short ones fill what is left of the time of several processes."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


def pytest_runtest_setup(item):
    """Skip long tests for which a slow machine has no time left, with a reason that is counted.

    A whole run that is stopped from outside tells nothing of the tests that come after.
    """
    until = os.environ.get("LONG_TESTS_UNTIL")
    if until and time.time() > float(until) and item.get_closest_marker("long"):
        pytest.skip("no time is left for long tests: this machine is too slow, see .ci/run")


def pytest_collection_finish():
    """Let garbage be looked for among new objects alone.

    There are half a million that stay, and each drive collects garbage before it begins.
    """
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def surroundings(tmp_path_factory):
    """A cache folder of the tests' own, no ROS, and Ctrl-C: results depend on nobody's machine."""
    before = os.environ.copy()
    # Of several processes, each has a folder in that of all. A law is built in C for all of them.
    base = tmp_path_factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in before else base
    for variable, name in (("XDG_CACHE_HOME", "cache"), (shared_runs.FOLDER, "shared_runs")):
        shared = base / name
        shared.mkdir(exist_ok=True)
        os.environ[variable] = str(shared)
    # Steps of NumPy are the same in each run, whatever was built before.
    os.environ["DRAKE_RNN_COMPILE"] = "never"
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        os.environ.pop(name, None)
    # A shell that starts the tests in the background lets them, and what they start, ignore it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    os.environ.clear()
    os.environ.update(before)


#: What is in the place of functions while tests are collected and run.
PATCH = pytest.MonkeyPatch()


def pytest_configure():
    """Parse files and load arms once: modules of tests do so while they are collected."""
    parse_a_file_once(PATCH)
    load_a_shipped_arm_once(PATCH)


def pytest_unconfigure():
    """Put back what was there."""
    PATCH.undo()


def parse_a_file_once(patch):
    """The same text gives the same contents, of which each test has a copy of its own.

    A fifth of the time in which an experiment is made goes into parsing its document and those of
    its arm, and nearly all of the time in which experiments are listed.
    """
    parse = lru_cache(maxsize=1000)(documents.parse_yaml)
    patch.setattr(documents, "parse_yaml", lambda *given: deepcopy(parse(*given)))


def load_a_shipped_arm_once(patch):
    """Experiments share it, as those of a campaign do: an arm never changes after it was made.

    To load it takes two thirds of the time in which an experiment is made.
    """
    shipped, made = shipped_arms(), {}

    def known(model, **fields):
        # A field that names a file may mean another one next time.
        if model not in shipped or not fields.keys() <= {"frame", "joints", "lock", "tool"}:
            return load_arm(model, **fields)
        said = model, json.dumps(fields, default=id)
        if said not in made:
            made[said] = load_arm(model, **fields)
        return made[said]

    patch.setattr(arms, "load_arm", known)


@pytest.fixture(scope="session", autouse=True)
def a_path_is_followed_once():
    """Inverse kinematics along a path takes half of a short run, and many runs have the same one.

    The same arm, from the same posture, to the same points.
    """
    follow, known = reach.follow, {}

    def once(experiment, samples=reach._SAMPLES, whole=True):
        desired, kinematics = experiment.desired, experiment.arm.kinematics()
        times = reach.reach_times(experiment, samples).tolist()
        points = [desired.position(t)[:2] for t in times]
        if experiment.holds_orientation:
            points += [desired.orientation(t)[:2] for t in times]
        contact = experiment.contact
        surface = None if contact is None else contact.surface
        shift = np.zeros(3) if surface is None else surface.gap * surface.normal_W
        plant = kinematics._plant
        said = samples, whole, id(plant), experiment.arm.frame, experiment.arm.joints
        said += experiment.task.axes, experiment.law_task
        said += experiment.start.tobytes(), shift.tobytes(), pickle.dumps((times, points))
        if said not in known:
            # The plant is held, so that no other one gets its number.
            known[said] = plant, follow(experiment, samples, whole)
        return known[said][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reach, "follow", once)
        yield


@pytest.fixture(scope="session", autouse=True)
def the_command_line_is_built_once():
    """A call of it takes as long as a quick command: Typer reads all signatures each time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(testing, "_get_command", cache(testing._get_command))
        yield


@pytest.fixture(scope="module")
def laws_as_before():
    """Laws and objectives that tests add are taken away again: others look at all there are."""
    before = dict(LAWS), dict(OBJECTIVES)
    yield
    for kinds, known in zip((LAWS, OBJECTIVES), before, strict=True):
        for added in kinds.keys() - known:
            del kinds[added]


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Return a function that installs a package of one module, with entry points of a group."""
    monkeypatch.syspath_prepend(str(tmp_path))
    modules = []

    def install(group, package, module, text, **offers):
        (tmp_path / f"{module}.py").write_text(text)
        modules.append(module)
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = "".join(f"{name} = {value}\n" for name, value in offers.items())
        (info / "entry_points.txt").write_text(f"[{group}]\n{lines}")
        importlib.invalidate_caches()

    known = METRICS.names
    yield install
    METRICS.remove(*(metric for metric in METRICS if metric.name not in known))
    features._load.cache_clear()
    for module in modules:
        sys.modules.pop(module, None)


@pytest.fixture
def interrupts(monkeypatch):
    """Return a function that lets every run be interrupted, as by Ctrl-C, after a time [s]."""
    record = simulation.Recorder.__call__

    def interrupts(after):
        def interrupt(self, context):
            record(self, context)
            if context.get_time() > after:
                raise KeyboardInterrupt

        monkeypatch.setattr(simulation.Recorder, "__call__", interrupt)

    return interrupts


@pytest.fixture(scope="module")
def browser():
    """Chromium without a network; a test is skipped where it is not installed."""
    with chromium() as driver:
        yield driver


@pytest.fixture
def simulated(monkeypatch):
    """Names of all that campaigns and reports simulate in this process."""
    names, simulate = [], perform.simulate

    def counted(experiment, **how):
        names.append(experiment.name)
        return simulate(experiment, **how)

    monkeypatch.setattr(perform, "simulate", counted)
    return names

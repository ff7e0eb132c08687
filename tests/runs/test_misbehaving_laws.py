"""Laws that declare or return what is wrong: refused by name, in an experiment and in a Diagram."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    LAWS,
    AddLoop,
    Circle,
    ContinuousController,
    ContinuousLaw,
    IdealArm,
    InvalidInputError,
    JointLimits,
    Layout,
    PathSource,
    SampledController,
    SampledLaw,
    SimulationError,
    load_arm,
    make_experiment,
    simulate,
    validated,
)
from process_helpers import within
from seeing_law import SeesTask

ARM = load_arm("panda")
N = ARM.n
CIRCLE = {"size": 0.02, "period": 2.0, "timing": "sin2"}
#: Time from which some laws misbehave, and duration of the runs [s].
LATE, END = 0.0195, 0.04


@pytest.fixture(autouse=True)
def no_hanging():
    """A run that never ends is a failure: Drake's error control can shorten its steps for ever."""
    with within(60.0, "still running"):
        yield


class Good(SeesTask, SampledLaw, ContinuousLaw):
    """A law with a low pass, in both readings, with which nothing is wrong."""

    limits: JointLimits

    @property
    def observables(self):
        return Layout(distance=(1,))

    def derivatives(self, t, x, u):
        wanted = 5.0 * u["J"].T @ (u["p_WE_desired"] - u["p_WE"])
        return 10.0 * (wanted - x)

    def step(self, t, x, u, period):
        return x + period * self.derivatives(t, x, u)

    def diagnostics(self, t, x, u):
        off = np.linalg.norm(u["p_WE_desired"] - u["p_WE"], axis=-1, keepdims=True)
        return {"distance": off}


def late(t, wrong, right):
    return wrong if t > LATE else right


def named(**members):
    """A law like `Good` with other members."""
    fields = {"limits": JointLimits}
    return validated(type("Mine", (Good,), {"__annotations__": fields, **members}))


def stepping(step):
    return named(step=lambda self, t, x, u, period: step(self, t, x, u, period))


def commanding(command):
    return named(commanded_velocity=lambda self, t, x: command(t, x))


def telling(diagnostics):
    return named(diagnostics=lambda self, t, x, u: diagnostics(t, x, u))


def having(**members):
    return named(**{name: property(lambda self, v=value: v) for name, value in members.items()})


def give(value):
    return lambda *arguments: value


def fail(*arguments):
    raise ZeroDivisionError("division by zero")


def modify_state(self, t, x, u, period):
    x += 0.1
    return x


def modify_signals(self, t, x, u, period):
    u["p_WE_desired"] -= u["p_WE"]
    return u["J"].T @ u["p_WE_desired"]


def ask_for_more(self, t, x, u, period):
    return u["velocity"]


SHAPE = rf"must return a NumPy array of floats, shape \({N},\), not "
AT_START = r" \(at t = 0 s\)$"

#: What is refused before anything moves: a law, and what is said of it.
AT_THE_START = {
    "step: None": (stepping(give(None)), rf"Mine\.step: {SHAPE}None{AT_START}"),
    "step: a list": (stepping(give([0.0] * N)), rf"Mine\.step: {SHAPE}a list{AT_START}"),
    "step: a number": (stepping(give(0.0)), rf"Mine\.step: {SHAPE}a float"),
    "step: too short": (stepping(give(np.zeros(3))), rf"Mine\.step: {SHAPE}\(3,\)"),
    "step: a column": (stepping(give(np.zeros((N, 1)))), rf"Mine\.step: {SHAPE}\({N}, 1\)"),
    "step: integers": (stepping(give(np.zeros(N, int))), rf"Mine\.step: {SHAPE}of int64"),
    "step: complex": (stepping(give(np.zeros(N, complex))), rf"Mine\.step: {SHAPE}of complex128"),
    "step: objects": (stepping(give(np.zeros(N, object))), rf"Mine\.step: {SHAPE}of object"),
    "step: masked": (stepping(give(np.ma.zeros(N))), rf"Mine\.step: {SHAPE}a MaskedArray"),
    "step: NaN": (
        stepping(give(np.full(N, np.nan))),
        rf"Mine\.step: must return finite numbers, not \[nan, .*{AT_START}",
    ),
    "step: infinite": (stepping(give(np.full(N, np.inf))), r"Mine\.step: must return finite"),
    "step: fails": (
        stepping(fail),
        rf"^Mine\.step raised ZeroDivisionError: division by zero{AT_START}",
    ),
    "step: other arguments": (
        named(step=lambda self, x, u: x),
        r"Mine\.step raised TypeError: .* takes 3 positional arguments but 5 were given",
    ),
    "step: modifies the state": (
        stepping(modify_state),
        r"Mine\.step raised ValueError: output array is read-only",
    ),
    "step: modifies its signals": (
        stepping(modify_signals),
        r"Mine\.step raised ValueError: output array is read-only",
    ),
    "step: asks for what it does not see": (
        stepping(ask_for_more),
        r"Mine\.step raised KeyError: .*velocity is not among its inputs, p_WE, p_WE_desired, J",
    ),
    "state: a dict": (
        having(state={"v": (N,)}),
        r"Mine\.state: must be of class Layout, not \{'v'",
    ),
    "state: a method": (
        named(state=lambda self: Layout(v=(N,))),
        r"^Mine\.state: is a method; decorate it with @property$",
    ),
    "state: fails": (named(state=property(fail)), r"Mine\.state raised ZeroDivisionError"),
    "state: without v": (
        having(state=Layout(velocity_sum=(N,))),
        r"Mine\.state: must have the part v, .* it has velocity_sum",
    ),
    "state: v is a matrix": (
        having(state=Layout(v=(1, N))),
        r"Mine\.state: its part v must have the shape \(joints,\), not \(1, 7\)",
    ),
    "state: the name of a series": (
        having(state=Layout(v=(N,), position=(N,))),
        r"Mine\.state: 'position' is the name of another recorded signal",
    ),
    "state: a negative size": (
        named(state=property(lambda self: Layout(v=(-1,)))),
        r"Layout: the shape of 'v' must be positive whole numbers, .*not \[-1\]",
    ),
    "state: a fractional size": (
        named(state=property(lambda self: Layout(v=(7.9,)))),
        r"Layout: the shape of 'v' must be positive whole numbers, .*not \[7\.9\]",
    ),
    "inputs: a dict": (having(inputs={"p_WE": (3,)}), r"Mine\.inputs: must be of class Layout"),
    "inputs: a Jacobian turned round": (
        having(inputs=Layout(J=(N, 3))),
        r"Mine\.inputs: J must have one column for each of 7 joints.*, not \(7, 3\)",
    ),
    "initial_state: None": (
        named(initial_state=give(None)),
        rf"Mine\.initial_state: {SHAPE}None{AT_START}",
    ),
    "initial_state: too long": (
        named(initial_state=give(np.zeros(N + 1))),
        rf"Mine\.initial_state: {SHAPE}\(8,\)",
    ),
    "initial_state: NaN": (
        named(initial_state=give(np.full(N, np.nan))),
        r"Mine\.initial_state: must return finite numbers",
    ),
    "initial_state: fails": (named(initial_state=fail), r"Mine\.initial_state raised ZeroDivision"),
    "commanded_velocity: None": (
        commanding(give(None)),
        rf"Mine\.commanded_velocity: {SHAPE}None{AT_START}",
    ),
    "commanded_velocity: a number": (commanding(give(0.0)), r"Mine\.commanded_velocity: .*a float"),
    "commanded_velocity: NaN": (
        commanding(give(np.full(N, np.nan))),
        r"Mine\.commanded_velocity: must return finite numbers",
    ),
    "observables: a dict": (having(observables={}), r"Mine\.observables: must be of class Layout"),
    **{
        f"observables: {name}": (
            having(observables=Layout(**{name: (1,)})),
            rf"Mine\.observables: '{name}' is the name of another recorded signal",
        )
        for name in ("v", "state", "time", "commanded_velocity", "position")
    },
    "diagnostics: None": (
        telling(give(None)),
        r"Mine\.diagnostics: must return a mapping of names to arrays, not None",
    ),
    "diagnostics: a name is missing": (
        telling(give({})),
        r"Mine\.diagnostics: must return its observables, distance; it returns none",
    ),
    "diagnostics: another name": (
        telling(give({"distance": np.zeros(1), "time": np.zeros(1)})),
        r"Mine\.diagnostics: must return its observables, distance; it returns distance, time",
    ),
    "diagnostics: a number": (
        telling(give({"distance": 0.0})),
        r"Mine\.diagnostics: distance must be an array of numbers, not 0\.0",
    ),
    "diagnostics: another shape": (
        telling(give({"distance": np.zeros(3)})),
        r"Mine\.diagnostics: distance must have the shape \(1,\), not \(3,\)",
    ),
    "diagnostics: of one instant alone": (
        telling(lambda t, x, u: {"distance": np.array([np.linalg.norm(x)])}),
        r"Mine\.diagnostics: distance must have the shape \(2, 1\) for 2 instants at once, not",
    ),
    "diagnostics: fails": (telling(fail), r"Mine\.diagnostics raised ZeroDivisionError"),
    "sampled: None": (
        named(sampled=give(None)),
        r"Mine\.sampled\(\): must be of class SampledReading, not None",
    ),
    "sampled: something else": (
        named(sampled=give(SimpleNamespace())),
        r"Mine\.sampled\(\): must be of class SampledReading, not SimpleNamespace",
    ),
    "loop_gains: a list": (having(loop_gains=[5.0]), r"Mine\.loop_gains: must be of class Mapping"),
    "loop_gains: negative": (
        having(loop_gains={"gain": -1.0}),
        r"Mine\.loop_gains\['gain'\]: must be a number of at least 0, not -1",
    ),
    "loop_gains: too high for the period": (
        having(loop_gains={"slow": 9.0, "gain": 20_000.0}),
        r"^period: must be below 5e-05 s with law\.gain at 20000 /s, not 0\.001; or give law\.gain "
        r"below 1000 /s$",
    ),
    "sampled_gains: too high for the period": (
        having(sampled_gains={"stiffness": 1000.0}),
        r"^period: must be below 0\.001 s with law\.stiffness at 1000 /s",
    ),
    "sampled_gains: infinite": (
        having(sampled_gains={"gain": np.inf}),
        r"Mine\.sampled_gains\['gain'\]: must be a number of at least 0, not inf",
    ),
    "keeps: a text": (having(keeps="velocity"), r"Mine\.keeps: must be of class tuple, not 'vel"),
    "keeps: no limit": (
        having(keeps=("speed",)),
        r"Mine\.keeps: may name position, velocity, .*crackle, envelope, not 'speed'",
    ),
    "takes_many: a text": (named(takes_many="yes"), r"Mine\.takes_many: must be of class bool"),
    "takes_many: one after all": (
        named(takes_many=True),
        r"^Mine\.step: called with two robots, as takes_many allows, raised ValueError: .* \(at "
        rf"t = 0 s\); arguments were x \(2, {N}\), p_WE \(2, 3\), p_WE_desired \(2, 3\), J ",
    ),
    "takes_many: for all together": (
        named(takes_many=True, step=give(np.zeros(N))),
        rf"^Mine\.step: called with two robots, .* must return .*shape \(2, {N}\), not \({N},\) ",
    ),
    "takes_many: one moves the other": (
        named(takes_many=True, step=lambda self, t, x, u, period: x + x.size / N),
        r"^Mine\.step: called with two .* must return \[\[1\.0, .*what each gets alone, not \[\[2",
    ),
    "takes_many: a command of one": (
        named(takes_many=True, commanded_velocity=lambda self, t, x: x.ravel()),
        rf"^Mine\.commanded_velocity: called with two .*shape \(2, {N}\), not \({2 * N},\)",
    ),
    "joint_preview: a number": (
        having(joint_preview=3),
        r"Mine\.joint_preview: must be of class JointPreview or None, not 3",
    ),
    "integration_scheme: unknown": (
        having(integration_scheme="runge_kuta3"),
        r"Mine\.integration_scheme: must be one of Drake's, .*nearest: runge_kutta3",
    ),
    "integration_scheme: None": (
        having(integration_scheme=None),
        r"Mine\.integration_scheme: must be of class str, not None",
    ),
    "stays_on_path: a text": (having(stays_on_path="yes"), r"Mine\.stays_on_path: must be of clas"),
}

#: What goes wrong only later: a law, and what is said of it.
LATER = {
    "step: None": (
        stepping(lambda self, t, x, u, period: late(t, None, x)),
        rf"controller: Mine\.step: {SHAPE}None",
    ),
    "step: another shape": (
        stepping(lambda self, t, x, u, period: late(t, x[:3], x)),
        rf"controller: Mine\.step: {SHAPE}\(3,\)",
    ),
    "step: NaN": (
        stepping(lambda self, t, x, u, period: late(t, x + np.nan, x)),
        r"controller: Mine\.step: v is no longer finite",
    ),
    "step: fails": (
        stepping(lambda self, t, x, u, period: 0.1 / late(t, 0, 1) + x),
        r"controller: Mine\.step raised ZeroDivisionError: float division by zero",
    ),
    "commanded_velocity: NaN": (
        commanding(lambda t, x: late(t, x * np.nan, x)),
        r"controller: Mine\.commanded_velocity: must be finite, not \[nan",
    ),
    "commanded_velocity: infinite": (
        commanding(lambda t, x: late(t, x + np.inf, x)),
        r"controller: Mine\.commanded_velocity: must be finite, not \[inf",
    ),
    "commanded_velocity: another shape": (
        commanding(lambda t, x: late(t, x[:3], x)),
        rf"controller: Mine\.commanded_velocity: {SHAPE}\(3,\)",
    ),
    "commanded_velocity: fails": (
        commanding(lambda t, x: 0.1 / late(t, 0, 1) + x),
        r"controller: Mine\.commanded_velocity raised ZeroDivisionError",
    ),
}


def deriving(derivatives):
    return named(derivatives=lambda self, t, x, u: derivatives(t, x, u))


#: The same for laws that Drake integrates.
INTEGRATED_AT_THE_START = {
    "derivatives: None": (deriving(give(None)), rf"Mine\.derivatives: {SHAPE}None{AT_START}"),
    "derivatives: too short": (deriving(give(np.zeros(2))), rf"Mine\.derivatives: {SHAPE}\(2,\)"),
    "derivatives: NaN": (
        deriving(give(np.full(N, np.nan))),
        r"Mine\.derivatives: must return finite numbers",
    ),
    "derivatives: fails": (deriving(fail), r"Mine\.derivatives raised ZeroDivisionError"),
    "continuous: None": (
        named(continuous=give(None)),
        r"Mine\.continuous\(\): must be of class ContinuousReading, not None",
    ),
}
INTEGRATED_LATER = {
    "derivatives: NaN": (
        deriving(lambda t, x, u: late(t, x + np.nan, -x)),
        r"controller: Mine\.derivatives: the rate of v is no longer finite",
    ),
    "derivatives: None": (
        deriving(lambda t, x, u: late(t, None, -x)),
        rf"controller: Mine\.derivatives: {SHAPE}None",
    ),
    "derivatives: fails": (
        deriving(lambda t, x, u: 0.1 / late(t, 0, 1) - x),
        r"controller: Mine\.derivatives raised ZeroDivisionError",
    ),
    "commanded_velocity: NaN": LATER["commanded_velocity: NaN"],
    "commanded_velocity: another shape": LATER["commanded_velocity: another shape"],
}


def cases(*tables):
    """Law, message and whether Drake integrates it."""
    return [
        pytest.param(law, message, integrated, id=name + " (integrated)" * integrated)
        for table, integrated in tables
        for name, (law, message) in table.items()
    ]


START = cases((AT_THE_START, False), (INTEGRATED_AT_THE_START, True))
RUNNING = cases((LATER, False), (INTEGRATED_LATER, True))


def run_experiment(monkeypatch, law, integrated=False, **document):
    monkeypatch.setitem(LAWS, "mine", law)
    clock = {"integrator": {"scheme": "runge_kutta3", "accuracy": 1e-6}} if integrated else {}
    return simulate(
        make_experiment(
            {
                "arm": "panda",
                "path": {"kind": "circle", **CIRCLE},
                "law": {"kind": "mine"},
                "duration": END,
                "log_period": 5e-3,
                **(clock or {"period": 1e-3}),
                **document,
            }
        )
    )


def run_diagram(law, integrated=False):
    """Run with Drake's own default integrator, which controls its error."""
    law = law(limits=ARM.limits)
    builder = DiagramBuilder()
    path = PathSource(Circle(**CIRCLE), ARM.kinematics().p_WE(ARM.home))
    builder.AddNamedSystem("path", path)
    controller = ContinuousController(law) if integrated else SampledController(law, 1e-3)
    AddLoop(builder, IdealArm(ARM), controller, path)
    # A name for the Simulator, so that an error's traceback keeps it alive: its frames hold
    # references to contexts that it owns, and newer Drake aborts if another takes their place.
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(END)


@pytest.mark.parametrize("integrated", [False, True])
def test_the_law_that_the_others_are_made_of_runs(monkeypatch, integrated):
    result = run_experiment(monkeypatch, named(), integrated)
    assert result.time[-1] == END
    assert result.series["distance"].shape == (result.time.size, 1)
    run_diagram(named(), integrated)


def test_there_are_many():
    assert len({case.id.split(" (")[0] for case in (*START, *RUNNING)}) >= 50


@pytest.mark.parametrize(("law", "message", "integrated"), START)
def test_it_is_refused_before_an_experiment_runs(monkeypatch, law, message, integrated):
    with pytest.raises(InvalidInputError, match=message) as caught:
        run_experiment(monkeypatch, law, integrated)
    assert "\n" not in str(caught.value)
    if "raised" in message:
        assert type(caught.value.__cause__).__name__ in str(caught.value)


@pytest.mark.parametrize(("law", "message", "integrated"), START)
def test_it_is_refused_in_a_diagram(law, message, integrated):
    with pytest.raises(InvalidInputError, match=message) as caught:
        run_diagram(law, integrated)
    if "raised" in message:
        assert type(caught.value.__cause__).__name__ in str(caught.value)


@pytest.mark.parametrize(("law", "message", "integrated"), RUNNING)
def test_it_stops_an_experiment_which_keeps_what_it_had(monkeypatch, law, message, integrated):
    with pytest.raises(SimulationError, match=message) as caught:
        run_experiment(monkeypatch, law, integrated)
    error = caught.value
    assert LATE <= error.time <= END
    assert f"(at t = {error.time:.6g} s)" in str(error)
    assert error.result.time[-1] <= error.time
    assert np.isfinite(error.result.series["position"]).all()
    if "raised" in message:
        assert isinstance(error.__cause__, ZeroDivisionError)


@pytest.mark.parametrize(("law", "message", "integrated"), RUNNING)
def test_it_stops_a_diagram(law, message, integrated):
    with pytest.raises(SimulationError, match=message) as caught:
        run_diagram(law, integrated)
    assert LATE <= caught.value.time <= END + 0.1
    if "raised" in message:
        assert isinstance(caught.value.__cause__, ZeroDivisionError)


# What only an experiment asks a law for.


@pytest.mark.parametrize(
    ("doubts", "message"),
    [
        (give(None), r"^Mine\.doubts: must return a list of texts, not None$"),
        (give("all is lost"), r"^Mine\.doubts: must return a list of texts, not 'all is lost'$"),
        (give([1]), r"^Mine\.doubts: must return a list of texts, not \[1\]$"),
        (fail, r"^Mine\.doubts raised ZeroDivisionError"),
    ],
)
def test_doubts_that_are_none_are_refused(monkeypatch, doubts, message):
    with pytest.raises(InvalidInputError, match=message):
        run_experiment(monkeypatch, named(doubts=doubts))


def fail_for_all(t, x, u):
    if len(x) > 10:
        raise ZeroDivisionError("division by zero")
    return {"distance": np.zeros((*x.shape[:-1], 1))}


def modify_history(t, x, u):
    if len(x) > 10:
        u["p_WE"] -= u["p_WE_desired"]
    return {"distance": np.zeros((*x.shape[:-1], 1))}


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (named(caveats=give(None)), r"^Mine\.caveats: must return a list of texts, not None"),
        (named(caveats=fail), r"^Mine\.caveats raised ZeroDivisionError"),
        (telling(fail_for_all), r"^Mine\.diagnostics for 41 instants at once raised ZeroDivision"),
        (telling(modify_history), r"^Mine\.diagnostics .*raised ValueError: .*read-only"),
    ],
)
def test_what_is_wrong_after_a_run_does_not_lose_it(monkeypatch, law, message):
    with pytest.raises(SimulationError, match=message) as caught:
        run_experiment(monkeypatch, law)
    result = caught.value.result
    assert result.time[-1] == caught.value.time == END
    assert result.metrics["position_error_max_m"] > 0.0
    # The path is what it was.
    assert np.linalg.norm(result.series["p_WE"] - result.series["p_WE_desired"], axis=1).max() > 0.0


def test_chance_and_time_are_allowed(monkeypatch):
    def step(self, t, x, u, period):
        return x + 1e-3 * np.random.default_rng(int(1e6 * t)).standard_normal(N)

    run_diagram(stepping(step))
    assert run_experiment(monkeypatch, stepping(step)).time[-1] == END
    varying = commanding(lambda t, x: 0.01 * np.sin(t) * np.ones(N))
    assert run_experiment(monkeypatch, varying).time[-1] == END
    run_diagram(varying)


def test_large_numbers_are_finite(monkeypatch):
    """Although their sum is not."""

    class Large(Good):
        limits: JointLimits

        @property
        def state(self):
            return Layout(v=(N,), large=(3,))

        def step(self, t, x, u, period):
            return np.append(np.zeros(N), [1e308] * 3)

    run_diagram(validated(Large))

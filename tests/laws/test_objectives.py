"""Objectives of a user's own in the adaptive law, which its own file knows nothing of."""

import sys
from typing import Annotated

import numpy as np
import pytest
from many_helpers import LAWS, PERIOD, adaptive, readings, row, signals, states

from drake_rnn import (
    OBJECTIVES,
    InvalidInputError,
    Meaning,
    Moment,
    NonNegative,
    Objective,
    Only,
    Positive,
    load_experiment,
    make_experiment,
    simulate,
    validated,
)
from row_helpers import each

KEEP_ELBOW_UP = '''
from functools import cached_property
from typing import Annotated

from drake_rnn import Arm, Finite, Meaning, Objective, Positive, validated


@validated
class KeepElbowUp(Objective):
    """Lift a frame of the arm where it comes near a height from above, or below it."""

    arm: Arm
    frame: Annotated[str, Meaning("Frame of the elbow.")]
    height: Annotated[Finite, Meaning("The height.", unit="m")]
    zone: Annotated[Positive, Meaning("Way above it in which it is lifted.", unit="m")] = 0.05
    weight: Annotated[Positive, Meaning("Weight at the height.", unit="rad^2/(m s)")] = 10.0

    @cached_property
    def _elbow(self):
        return self.arm.replace(frame=self.frame).kinematics()

    def velocity(self, moment):
        above = self._elbow.p_WE(moment.q)[2] - self.height
        return self.weight * max(1.0 - above / self.zone, 0.0) ** 2 * self._elbow.J(moment.q)[2]
'''


def elbow_heights(experiment):
    """Heights of the elbow along a run [m], and the error of the end effector at its end [m]."""
    kinematics = experiment.arm.replace(frame="panda_link4").kinematics()
    result = simulate(experiment)
    error = result.series["p_WE"][-1] - result.series["p_WE_desired"][-1]
    return np.array([kinematics.p_WE(q)[2] for q in result.series["position"][::10]]), error


@pytest.mark.long
def test_an_elbow_stays_above_a_height(monkeypatch, tmp_path):
    """0.58 m, which it sinks below on its way; the task is done as well as without."""
    (tmp_path / "elbow_module.py").write_text(KEEP_ELBOW_UP)
    monkeypatch.syspath_prepend(tmp_path)
    own = {"kind": "elbow_module:KeepElbowUp", "frame": "panda_link4", "height": 0.58}
    name, slow = "adaptive_nephroid_known", {"duration": 5.0, "period": 4e-3, "law.kappa": 100}
    without, error = elbow_heights(load_experiment(name, slow))
    made = load_experiment(name, {**slow, "law.secondary.objectives": [own]})
    heights, own_error = elbow_heights(made)
    assert without.min() < 0.57
    assert heights.min() > 0.58
    assert np.abs(own_error).max() < max(2.0 * np.abs(error).max(), 1e-7)
    # A document holds it as it was given, and imports no module unless it may.
    assert made.document.law["secondary"]["objectives"] == [own]
    with pytest.raises(InvalidInputError, match=r"objectives\[0\].height: must be a number"):
        load_experiment(name, {"law.secondary.objectives": [{**own, "height": "high"}]})
    with pytest.raises(InvalidInputError, match=r"objectives\[0\].arm: follows from arm; leave"):
        load_experiment(name, {"law.secondary.objectives": [{**own, "arm": "panda"}]})
    monkeypatch.delitem(sys.modules, "elbow_module")
    with pytest.raises(InvalidInputError, match="imported only when told to"):
        make_experiment(made.document, modules=False)


def test_a_wrong_frame_of_an_objective_is_told_as_its_own_key(monkeypatch, tmp_path):
    """Not as that of the arm, which is right; of two objectives the one that has it."""
    (tmp_path / "elbow_module.py").write_text(KEEP_ELBOW_UP)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "elbow_module", raising=False)
    own = {"kind": "elbow_module:KeepElbowUp", "frame": "panda_link4", "height": 0.58}
    changes = {"duration": 0.1, "law.secondary.objectives": [own, {**own, "frame": "panda_lnk4"}]}
    with pytest.raises(InvalidInputError) as refused:
        simulate(load_experiment("adaptive_nephroid_known", changes))
    assert str(refused.value).startswith(
        "law.secondary.objectives[1].frame: no frame 'panda_lnk4' in panda.urdf; nearest: panda_l"
    )


def still(moment):
    return 0.0 * moment.q


@validated
class Told(Objective):
    """An objective that does what a test tells it."""

    def velocity(self, moment):
        return ACTS["velocity"](moment)

    @property
    def inputs(self):
        return ACTS["inputs"]

    def doubts(self, circumstances):
        return ACTS["doubts"]


ACTS = {}


def changed(moment):
    moment.q[0] = 1.0
    return moment.q


@pytest.mark.parametrize(
    ("member", "acts", "complaint"),
    [
        ("velocity", lambda moment: np.zeros(3), "floats, shape (7,), not (3,) (at t = 0 s)"),
        ("velocity", lambda moment: None, "Told.velocity: must return a NumPy array of floats"),
        ("velocity", lambda moment: moment.q + np.inf, "Told.velocity: must be finite, not [inf"),
        ("velocity", lambda moment: moment.u["w"], "Told.velocity raised KeyError: 'w is not amo"),
        ("velocity", changed, "Told.velocity raised ValueError: assignment destination is read"),
        ("inputs", {"p_WE": (2,)}, "Told.inputs: p_WE has the shape (3,) here, not (2,)"),
        ("inputs", {"smell": (2,)}, "nothing in this diagram offers 'smell'"),
        ("inputs", still, "Told.inputs: must be a mapping of names to shapes"),
        ("doubts", "none", "Told.doubts: must return a list of texts, not 'none'"),
    ],
)
def test_what_an_objective_gives_is_checked(monkeypatch, member, acts, complaint):
    """Before the arm moves, with the name of the objective and of its member."""
    monkeypatch.setitem(OBJECTIVES, "told", Told)
    for name, given in {"velocity": still, "inputs": {}, "doubts": [], member: acts}.items():
        monkeypatch.setitem(ACTS, name, given)
    changes = {"law.secondary.objectives": [{"kind": "told"}], "duration": 0.1}
    with pytest.raises(InvalidInputError) as refused:
        simulate(load_experiment("adaptive_nephroid_known", changes))
    assert complaint in str(refused.value)


def test_a_warning_of_an_objective_is_that_of_the_experiment(monkeypatch):
    monkeypatch.setitem(OBJECTIVES, "told", Told)
    acts = {"velocity": still, "inputs": {"velocity": (7,)}, "doubts": ["elbow: hits the ceiling"]}
    for name, given in acts.items():
        monkeypatch.setitem(ACTS, name, given)
    changes = {"law.secondary.objectives": [{"kind": "told"}]}
    made = load_experiment("adaptive_nephroid_known", changes)
    assert made.warnings == ("elbow: hits the ceiling",)
    assert made.law.sees_velocity
    assert not made.law.takes_many


def components(reading):
    """The parts of a reading with memory."""
    return getattr(reading, "_components", ())


@each("name", [name for name in LAWS if components(readings(LAWS[name])["step"])])
def test_parts_with_memory_name_their_parts_of_the_state(name):
    """They are those that `init` returns, and together with the law's own all that there is."""
    rng = np.random.default_rng(0)
    reading = readings(LAWS[name])["step"]
    u = row(signals(reading.inputs, rng, 1), 0)
    seen = reading._view(u) if hasattr(reading, "_view") else u
    named = {}
    for part in components(reading):
        given = {k: np.shape(y) for k, y in part.init({"J": np.ones((3, 7)), **seen}, rng).items()}
        assert given == part.shapes
        assert not given.keys() & named.keys()
        named |= given
    own = reading.state.shapes.keys() - named.keys()
    assert own <= {"v", "commanded", "samples"}
    assert reading.step(0.0, states(reading, rng, 1)[0], u, PERIOD).shape == (reading.state.size,)


def test_a_key_of_an_objective_that_does_nothing_is_told(monkeypatch):
    @validated
    class Zoned(Objective):
        weight: NonNegative = 0.0
        zone: Annotated[Positive, Meaning("A way.", unit="rad", only=(Only("weight"),))] = 0.1

        def velocity(self, moment):
            return still(moment)

    monkeypatch.setitem(OBJECTIVES, "zoned", Zoned)
    objectives = [{"kind": "zoned", "weight": 1.0, "zone": 0.2}, {"kind": "zoned", "zone": 0.3}]
    made = load_experiment("adaptive_nephroid_known", {"law.secondary.objectives": objectives})
    assert made.warnings == (
        "law.secondary.objectives[1].zone: does nothing here; it acts only with "
        "law.secondary.objectives[1].weight, which is 0",
    )


def test_a_moment_is_what_the_law_sees():
    """Its commanded positions and velocities, its Jacobian and its signals."""
    seen = []

    @validated
    class Looks(Objective):
        def velocity(self, moment):
            seen.append(moment)
            return still(moment)

    law = adaptive(secondary={"objectives": [Looks()]})
    reading = law.sampled(PERIOD)
    rng = np.random.default_rng(1)
    x, u = states(reading, rng, 1)[0], row(signals(reading.inputs, rng, 1), 0)
    reading.step(0.25, x, u, PERIOD)
    (moment,) = seen
    assert isinstance(moment, Moment)
    assert (moment.t, moment.period) == (0.25, PERIOD)
    np.testing.assert_array_equal(moment.q, reading.state.part(x, "commanded"))
    np.testing.assert_array_equal(moment.v, reading.state.part(x, "v"))
    assert moment.J.shape == (3, 7)
    assert moment.u.keys() == reading.inputs.parts.keys()

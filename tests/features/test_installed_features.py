"""A package of a user's own adds a feature, by an entry point: nothing of drake_rnn names it."""

import json
import re
from operator import attrgetter

import numpy as np
import pytest

from drake_rnn import (
    Contact,
    InvalidInputError,
    Result,
    load_experiment,
    run_many,
    simulate,
    systems,
    write_playback,
)
from drake_rnn.figures.result_figures import figure

PUSH = '''
from typing import Annotated

import numpy as np
from pydrake.geometry import Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.systems.primitives import Adder

from drake_rnn import InvalidInputError, Meaning, NonNegative, Positive, validated
from drake_rnn.features.feature import (
    Feature, Guarantee, JointVelocity, LegendEntry, LoopPart, Moment, SceneItem,
)
from drake_rnn.features.pairs import Pair
from drake_rnn.measures import Metric
from drake_rnn.systems.block import Block


@validated
class PushSettings:
    """A velocity of the last joint from a time on, whatever the law commands."""

    speed: Annotated[Positive, Meaning("Its size.", unit="rad/s")]
    time: Annotated[NonNegative, Meaning("Time at which it begins.", unit="s")] = 0.0


class PushSource(Block):
    def __init__(self, push, n):
        super().__init__()

        def pushed(context, output):
            begun = context.get_time() >= push.time - 1e-9
            output.set_value(push.speed * begun * np.eye(n)[-1])

        self.DeclareVectorOutputPort("push", n, pushed, {self.time_ticket()})


class Push(LoopPart):
    def __init__(self, settings):
        self.settings = settings

    def change_command(self, loop):
        n = loop.body.arm.n
        source = loop.wiring.add("push", PushSource(self.settings, n))
        adder = loop.wiring.add("pushed_velocity", Adder(2, n))
        loop.wiring.connect(loop.velocity.moved, adder.get_input_port(0))
        loop.wiring.connect(source.get_output_port(), adder.get_input_port(1))
        pushed = adder.get_output_port()
        loop.velocity = JointVelocity(pushed, pushed, pushed)
        loop.recorded["push"] = source.get_output_port()


class DrawnPush(SceneItem):
    legend = (LegendEntry("ball", "pushed"),)

    def __init__(self, stage, time):
        self.stage, self.time = stage, time

    @property
    def corners(self):
        return np.array([[0.0, 0.0, 3.0]])

    def draw(self):
        self.stage.meshcat.SetObject("/push", Sphere(0.05), Rgba(1, 0, 0))
        self.stage.meshcat.SetTransform("/push", RigidTransform([0, 0, 1]))
        return []

    def record(self, frames):
        frames.show("/push", self.time)


class PushFeature(Feature):
    key = "push"
    section = Annotated[PushSettings | None, Meaning("A push of the last joint.")]
    pairs = (Pair("push", "disturbance", "push", "must be left out with a disturbance"),)
    metrics = (
        Metric(
            "push_max_rad_s",
            "largest velocity of the push",
            of=lambda motion, against: (
                np.abs(motion.features["push"]).max(axis=-1) if "push" in motion.features else None
            ),
        ),
    )

    def make(self, section, parts):
        if section.speed > 10.0 * parts.arm.limits.velocity[-1]:
            raise InvalidInputError("push.speed: is more than the joint can do")
        return Push(section)

    def doubts(self, experiment):
        push = experiment.features.get("push")
        late = push is not None and push.settings.time >= experiment.document.duration
        return ["push: begins after the run"] if late else []

    def guarantee(self, arm, experiment):
        return Guarantee() if "push" in {f.key for f in experiment.document.further} else arm

    def moments(self, experiment):
        if (push := experiment.features.get("push")) is not None:
            yield Moment(push.settings.time, "push")

    def observe(self, experiment, run):
        return {"push": run.steps.series("push")} if "push" in experiment.features else {}

    def caveats(self, experiment, metrics, run):
        if metrics.get("push_max_rad_s", 0.0) > 0.5:
            yield "push: was more than 0.5 rad/s"

    def items(self, stage):
        if (push := stage.experiment.features.get("push")) is not None:
            yield DrawnPush(stage, push.settings.time - stage.begin)
'''
LOOK = """
from typing import Annotated

from drake_rnn import Meaning, validated
from drake_rnn.features.feature import Feature


@validated
class LookSettings:
    frame: Annotated[str, Meaning("A link.")]


class LookFeature(Feature):
    key = "look"
    section = Annotated[LookSettings | None, Meaning("A look at a link.")]

    def make(self, section, parts):
        1 / len(section.frame)
        return parts.arm.replace(frame=section.frame)
"""
GROUP = "drake_rnn.features"
CHANGES = {"duration": 0.2, "window": None, "accept": {}}


@pytest.fixture
def push(install):
    install(GROUP, "pushing", "push_feature", PUSH, push="push_feature:PushFeature")


def pushed(**section):
    return load_experiment("pinv_line", {**CHANGES, "push": section})


def test_an_installed_feature_runs_in_a_diagram(push, tmp_path):
    experiment = pushed(speed=0.1, time=0.1)
    assert not experiment.guarantees.arm.limits
    result = simulate(experiment)
    assert result.metrics["push_max_rad_s"] == 0.1
    begun = result.time > 0.1 + 1e-6
    np.testing.assert_allclose(result.series["push"][begun, -1], 0.1)
    assert not result.series["push"][result.time < 0.1 - 1e-6].any()
    # The arm moves with it, the law's own velocity does not.
    free = simulate(load_experiment("pinv_line", CHANGES))
    moved = result.series["velocity"][-1, -1] - result.series["network_velocity"][-1, -1]
    assert moved == pytest.approx(0.1)
    assert (free.series["velocity"][-1] == free.series["network_velocity"][-1]).all()

    folder = result.save(tmp_path / "run")
    again = Result.load(folder)
    assert again.metrics == result.metrics
    assert again.experiment.document.contents()["push"] == {"speed": 0.1, "time": 0.1}


def test_it_is_drawn_and_marked(push, tmp_path):
    result = simulate(pushed(speed=0.1, time=0.1))
    assert [tuple(each)[:2] for each in result.experiment.moments] == [(0.1, "push")]
    page = write_playback(result, tmp_path / "playback.html").read_text()
    assert '<i class="ball"></i>pushed' in page
    data = re.search(r'<script[^>]*id="playback-data"[^>]*>(.*?)</script>', page, re.DOTALL)[1]
    assert json.loads(data)["marks"] == [{"time": 0.1, "name": "push"}]
    axes = figure(result, "position_error").get_axes()
    assert "push" in {line.get_label() for ax in axes for line in ax.get_lines()}


def test_it_warns_and_is_refused_as_any_other(push):
    assert "push: begins after the run" in pushed(speed=0.1, time=0.3).warnings
    assert "push: was more than 0.5 rad/s" in simulate(pushed(speed=0.6)).warnings
    disturbance = {"kind": "constant", "size": 1e-3}
    for changes, said in (
        ({"push": {"speed": -1.0}}, "push.speed: must be greater than 0, not -1.0"),
        ({"push": {"sped": 1.0}}, "push.sped: no such key"),
        ({"push": {"speed": 50.0}}, "push.speed: is more than the joint can do"),
        ({"push": {"speed": 0.1}, "disturbance": disturbance}, "push: must be left out with a"),
        ({"shove": {"speed": 0.1}}, "shove: no such key"),
    ):
        with pytest.raises(InvalidInputError) as refused:
            load_experiment("pinv_line", {**CHANGES, **changes})
        assert str(refused.value).startswith(said)
    with pytest.raises(InvalidInputError, match="push: must be left out; only a simulation"):
        run_many([pushed(speed=0.1)])


def test_a_package_that_is_broken_is_told_only_where_its_key_is_given(install):
    install(GROUP, "broken", "broken_feature", "1 / 0\n", lift="broken_feature:Lift")
    install(GROUP, "other", "other_feature", "Lift = int\n", raised="other_feature:Lift")
    install(GROUP, "taken", "taken_feature", "1 / 0\n", filter="taken_feature:Filter")
    assert load_experiment("pinv_line", CHANGES).name == "pinv_line"
    for key, said in (
        ("lift", "lift: is offered by the package broken as broken_feature:Lift, which cannot be"),
        ("raised", "raised: is offered by the package other as other_feature:Lift, which is no"),
        ("filter", "filter: is a key of drake_rnn, but is also offered by the package taken; that"),
    ):
        with pytest.raises(InvalidInputError) as refused:
            load_experiment("pinv_line", {key: {}})
        assert str(refused.value).startswith(said)


def test_what_a_feature_gives_the_arm_is_told_as_its_own_key(install):
    """A frame, by `Arm.replace` in its `make`; what raises there is named."""
    install(GROUP, "looking", "look_feature", LOOK, look="look_feature:LookFeature")
    for frame, said in (
        ("panda_lnk4", "look.frame: no frame 'panda_lnk4' in panda.urdf; nearest: panda_link4"),
        ("", "LookFeature.make raised ZeroDivisionError: "),
    ):
        with pytest.raises(InvalidInputError) as refused:
            load_experiment("pinv_line", {**CHANGES, "look": {"frame": frame}})
        assert str(refused.value).startswith(said)


def test_names_that_went_from_systems_to_features_work_with_a_warning():
    with pytest.warns(DeprecationWarning, match=r"Contact is now drake_rnn\.features\.contact\.C"):
        assert attrgetter("Contact")(systems) is Contact
    with pytest.raises(AttributeError, match=r"drake_rnn\.systems' has no attribute 'Kontakt'"):
        attrgetter("Kontakt")(systems)

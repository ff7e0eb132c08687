"""What a user may hand over by mistake in Python is refused by name."""

import numpy as np
import pytest

import drake_rnn as d

ARM = d.load_arm("panda")
LAW = d.SimultaneousLearning(limits=ARM.limits, home=ARM.home, jacobian="known")

#: Calls, and the name of what is wrong.
CALLS = {
    "a controller without a law": (lambda: d.SampledController(None, 1e-3), "law"),
    "a controller without a period": (lambda: d.SampledController(LAW, None), "period"),
    "a period in words": (lambda: d.SampledController(LAW, "1 ms"), "period"),
    "an integrated controller without a law": (lambda: d.ContinuousController(None), "law"),
    "a source without a path": (lambda: d.PathSource(None), "path"),
    "an experiment of nothing": (lambda: d.make_experiment(None), "document"),
    "an experiment's number": (lambda: d.load_experiment(3), "experiment"),
    "a run of nothing": (lambda: d.simulate(None), "experiment"),
    "a run of no experiment": (lambda: d.simulate("slc_nephroid_know"), "experiment"),
    "limits of no joints": (lambda: d.JointLimits.unlimited(0), "size"),
    "limits of -1 joints": (lambda: d.JointLimits.unlimited(-1), "size"),
    "limits of some joints": (lambda: d.JointLimits.unlimited("a"), "size"),
    "a body without an arm": (lambda: d.IdealArm(None), "arm"),
    "an arm by number": (lambda: d.load_arm(3), "arm"),
    "a posture of three joints": (lambda: ARM.kinematics().J(np.zeros(3)), "position"),
    "a posture in words": (lambda: ARM.kinematics().J("home"), "position"),
    "no posture": (lambda: ARM.kinematics().p_WE(None), "position"),
    "figures of nothing": (lambda: d.write_figures(None, "out"), "result"),
    "a playback of nothing": (lambda: d.write_playback(None, "out.html"), "result"),
    "a sweep over nothing": (lambda: d.sweep("pinv_line", None), "over"),
    "a sweep over one number": (lambda: d.sweep("pinv_line", {"law.damping": 3}), "over.law"),
    "a campaign of a number": (lambda: d.run_campaign(3, "out"), "campaign"),
    "a campaign in half a process": (
        lambda: d.run_campaign("line_starts", "out", jobs=0.5),
        "jobs",
    ),
    "the reach of a name": (lambda: d.check_reach("pinv_line"), "experiment"),
    "a result in no folder": (lambda: d.Result.load(None), "folder"),
    "a self-motion of no arm": (lambda: d.SelfMotion(None, None), "arm"),
    "a loop without a builder": (lambda: d.AddLoop(None, None, None), "builder"),
    "a layout of a number": (lambda: d.Layout(v=3), "Layout"),
    "a home that is a number": (lambda: ARM.replace(home=3), "arm.home"),
}


@pytest.mark.parametrize(("call", "name"), CALLS.values(), ids=CALLS)
def test_it_is_refused_by_name(call, name):
    with pytest.raises(d.InvalidInputError) as caught:
        call()
    assert str(caught.value).startswith(name)
    assert "\n" not in str(caught.value)


def test_a_name_is_enough_to_run():
    document = d.load_experiment("pinv_line", {"duration": 0.05}).document
    assert d.simulate(document).time[-1] == 0.05

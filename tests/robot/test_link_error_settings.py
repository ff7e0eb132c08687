"""Arms whose links are not what their models say, as a document describes them."""

import numpy as np
import pytest

from drake_rnn import (
    InvalidInputError,
    load_arm,
    load_experiment,
    run_many,
    screws_of,
    simulate,
    with_link_errors,
)
from drake_rnn.experiment import Arms
from drake_rnn.robot.arm_description import LinkErrorSettings

ERRORS = {"seed": 5, "translation": 0.02, "rotation": 0.035}


@pytest.mark.parametrize("name", ["panda", "ur5", "iiwa14", "planar6"])
def test_drake_and_the_algebra_displace_the_same_joints_by_the_same(name):
    arm = load_arm(name)
    settings = LinkErrorSettings(**ERRORS)
    drake = screws_of(arm.with_link_errors(settings))
    algebra = with_link_errors(screws_of(arm), settings.draw(arm.n))
    q = arm.home + 0.3
    for part in ("p_WE", "R_WE", "J"):
        moved = getattr(drake.at(q), part)
        assert moved == pytest.approx(getattr(algebra.at(q), part), abs=1e-12)
    # Each joint is elsewhere by centimetres, and the arm's end by some more.
    off = np.linalg.norm(drake.at(q).p_WE - screws_of(arm).at(q).p_WE)
    assert 1e-3 < off < 0.5


def test_an_arm_without_them_is_the_model_again():
    arm = load_arm("panda")
    again = load_arm("panda", link_errors=ERRORS).with_link_errors(None)
    assert np.array_equal(again.kinematics().p_WE(arm.home), arm.kinematics().p_WE(arm.home))


def test_errors_of_the_first_joints_do_not_depend_on_how_many_there_are():
    few, many = (LinkErrorSettings(seed=3).draw(count) for count in (3, 7))
    assert np.array_equal(few.translation[:3], many.translation[:3])
    assert np.abs(many.rotation).max() <= np.deg2rad(2.0)
    assert not many.rotation[-1].any()


def test_a_document_says_the_same_alone_and_among_others():
    changes = {"arm": {"model": "panda", "link_errors": ERRORS}, "duration": 0.05, "window": None}
    alone = load_experiment("slc_nephroid_known", changes)
    shared = Arms()
    others = [load_experiment("slc_nephroid_known", changes, arms=shared) for _ in range(2)]
    result = simulate(alone, series="none")
    many = run_many([*others, load_experiment("slc_nephroid_known", {**changes, "arm": "panda"})])
    for row in range(2):
        assert many.position[row] == pytest.approx(result.series["position"][-1], abs=1e-12)
    assert np.abs(many.position[2] - many.position[0]).max() > 1e-4


@pytest.mark.parametrize(
    ("errors", "complaint"),
    [
        ({"translation": 1.0}, "arm.link_errors.translation: may be at most 0.2, not 1.0"),
        ({"rotation": 5.0}, "arm.link_errors.rotation: may be at most 0.5, not 5.0"),
        ({"seed": -1}, "arm.link_errors.seed: "),
        ({"seeds": 1}, "arm.link_errors.seeds: "),
    ],
)
def test_what_no_arm_has_is_refused_by_name(errors, complaint):
    changes = {"arm": {"model": "panda", "link_errors": errors}}
    with pytest.raises(InvalidInputError, match=f"^{complaint}"):
        load_experiment("slc_nephroid_known", changes)

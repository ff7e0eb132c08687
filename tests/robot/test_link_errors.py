"""Errors of links: an arm with them is the arm of a model that has them."""

import numpy as np
import pytest
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from drake_rnn import (
    InvalidInputError,
    LinkErrors,
    load_arm,
    random_link_errors,
    screws_of,
    with_link_errors,
)
from screw_helpers import ORIGINS, all_of, all_of_drake, askew, assert_close, assert_same, motions


@pytest.fixture
def sliding(tmp_path):
    return askew(tmp_path / "askew.urdf")


def displaced(translation, rotation):
    """The frames of the model, each displaced in its own axes."""
    frames = []
    for origin, shift, vector in zip(ORIGINS, translation, rotation, strict=True):
        X = RigidTransform(RollPitchYaw(origin[3:]), origin[:3])
        angle = np.linalg.norm(vector)
        X = X @ RigidTransform(RotationMatrix(AngleAxis(angle, vector / angle)), shift)
        frames.append((X.translation(), RollPitchYaw(X.rotation()).vector()))
    return frames


def test_it_is_the_arm_of_a_model_with_these_errors(tmp_path, sliding):
    """1e-12: some thousand roundings; the errors move E by centimetres."""
    errors = random_link_errors(screws_of(sliding), np.random.default_rng(3), 4)
    screws = with_link_errors(screws_of(sliding), errors)
    q, v = motions(sliding.n, (4,))
    found = all_of(screws, q, v)
    for i in range(4):
        frames = displaced(errors.translation[i], errors.rotation[i])
        arm, rows = askew(tmp_path / f"robot{i}.urdf", frames), slice(i, i + 1)
        of_drake = all_of_drake(arm, q[rows], v[rows])
        assert_close({name: value[rows] for name, value in found.items()}, of_drake, 1e-12)
    off = np.linalg.norm(found["p_WE"] - screws_of(sliding).at(q).p_WE, axis=-1)
    assert off.min() > 5e-3


def test_errors_add_up_in_the_frames_that_have_errors_already(tmp_path, sliding):
    errors = random_link_errors(screws_of(sliding), np.random.default_rng(4), 2)
    once, twice = (LinkErrors(errors.translation[i], errors.rotation[i]) for i in range(2))
    screws = with_link_errors(with_link_errors(screws_of(sliding), once), twice)
    frames = displaced(once.translation, once.rotation)
    both = screws_of(askew(tmp_path / "once.urdf", frames))
    q, v = motions(sliding.n)
    assert_close(all_of(screws, q, v), all_of(with_link_errors(both, twice), q, v), 1e-12)


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_no_errors_change_no_bit(name):
    screws = screws_of(load_arm(name))
    none = np.zeros((len(screws.slides) + 1, 3))
    q, v = motions(screws.n)
    assert_same(
        all_of(with_link_errors(screws, LinkErrors(none, none)), q, v), all_of(screws, q, v)
    )


def test_an_error_of_the_tool_alone_moves_e_alone(sliding):
    """In E's axes, by as much as is said, to some roundings."""
    screws, shift = screws_of(sliding), np.array([0.01, -0.02, 0.03])
    translation = np.zeros((6, 3))
    translation[-1] = shift
    q, _ = motions(sliding.n)
    moved = screws.at(q)
    off = with_link_errors(screws, LinkErrors(translation, np.zeros((6, 3)))).at(q)
    np.testing.assert_allclose(off.p_WE - moved.p_WE, moved.R_WE @ shift, atol=1e-15)
    np.testing.assert_array_equal(off.J_omega, moved.J_omega)


@pytest.mark.parametrize("robots", [1, 8, 37])
def test_a_robots_arm_and_its_bits_do_not_depend_on_the_others(robots):
    screws = screws_of(load_arm("panda"))
    q, v = motions(7, (100,))

    def own(count):
        errors = random_link_errors(screws, np.random.default_rng(5), count)
        return with_link_errors(screws, errors)

    every, few = own(100), own(robots)
    found = all_of(every, q, v)
    first = {name: value[:robots] for name, value in found.items()}
    assert_same(all_of(few, q[:robots], v[:robots]), first)
    last = {name: value[robots - 1] for name, value in found.items()}
    assert_same(all_of(every.of(robots - 1), q[robots - 1], v[robots - 1]), last)
    errors = random_link_errors(screws, np.random.default_rng(5), robots)
    alone = LinkErrors(errors.translation[-1], errors.rotation[-1])
    assert_same(all_of(with_link_errors(screws, alone), q[robots - 1], v[robots - 1]), last)


def test_random_errors_fill_their_ranges_and_no_more():
    """Of 4800 draws the largest is within 1 % of the range but once in 1e20 times."""
    screws = screws_of(load_arm("panda"))
    errors = random_link_errors(screws, np.random.default_rng(6), 200)
    for values, most in ((errors.translation, 0.02), (errors.rotation, np.deg2rad(2))):
        assert values.shape == (200, 8, 3)
        assert 0.99 * most < np.abs(values).max() <= most


def errors_of(screws, robots):
    return random_link_errors(screws, np.random.default_rng(0), robots)


def many(screws, robots):
    return with_link_errors(screws, errors_of(screws, robots))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: LinkErrors(np.zeros(3), np.zeros((8, 3))), "translation: must be finite, of"),
        (lambda s: LinkErrors(np.zeros((8, 3)), np.full((8, 3), np.nan)), "rotation: must be fin"),
        (lambda s: LinkErrors(None, np.zeros((8, 3))), "translation: must be of class ndarray"),
        (
            lambda s: with_link_errors(s, LinkErrors(np.zeros((7, 3)), np.zeros((7, 3)))),
            "errors: must have 8 rows, one for each joint",
        ),
        (lambda s: LinkErrors(np.zeros((8, 3)), np.zeros((7, 3))), "rotation: must have the shape"),
        (lambda s: with_link_errors(s, None), "errors: must be of class LinkErrors, not None"),
        (lambda s: with_link_errors(many(s, 3), errors_of(s, 2)), "errors: are for robots of sh"),
        (lambda s: random_link_errors(s, 0, 1), "rng: must be of class Generator, not 0"),
        (lambda s: random_link_errors(s, np.random.default_rng(0), 1.5), "robots: must be a whole"),
        (lambda s: random_link_errors(s, np.random.default_rng(0), -1), "robots: must be a whole"),
        (
            lambda s: random_link_errors(s, np.random.default_rng(0), 1, np.inf),
            "translation: must be",
        ),
    ],
)
def test_what_does_not_fit_is_refused_by_name(call, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        call(screws_of(load_arm("panda")))

"""The arm at both levels of detail: the same ports, and what each level refuses."""

import numpy as np
import pytest

from drake_rnn import (
    Contact,
    ContactModel,
    ElasticSurface,
    ForceProfile,
    IdealArm,
    InvalidInputError,
    ModelSurface,
    PlantArm,
    PlantSettings,
    Plate,
    Surface,
    load_arm,
)
from drake_rnn.models import MODELS
from drake_rnn.systems.body import Body

IIWA = load_arm("iiwa14", frame="tip")
HOMELESS = load_arm(str(MODELS / "iiwa14" / "iiwa14.urdf"), frame="iiwa_link_ee", tool={})
FORCE = ForceProfile(value=5.0)
SPRING, PLATE = Contact(ElasticSurface(stiffness=500.0), FORCE), Contact(Plate(), FORCE)
LEVELS = [IdealArm, PlantArm]


def ports(body):
    """Names and sizes of the inputs and of the outputs."""
    inputs = [body.get_input_port(index) for index in range(body.num_input_ports())]
    outputs = [body.get_output_port(index) for index in range(body.num_output_ports())]
    return [{port.get_name(): port.size() for port in some} for some in (inputs, outputs)]


@pytest.mark.parametrize("in_contact", [False, True])
def test_an_arm_has_the_same_ports_at_either_level(in_contact):
    ideal = ports(IdealArm(IIWA, contact=SPRING if in_contact else None))
    assert ideal == ports(PlantArm(IIWA, contact=PLATE if in_contact else None))
    forces = {"contact_force": 3, "tool_force": 3} if in_contact else {}
    assert ideal == [
        {"position_commanded": 7, "velocity_commanded": 7},
        {"position": 7, "velocity": 7, **forces},
    ]


@pytest.mark.parametrize("make", LEVELS)
def test_it_keeps_what_it_is_made_of(make):
    contact, q = (SPRING if make is IdealArm else PLATE), IIWA.home + 0.1
    body = make(IIWA, q, contact)
    assert isinstance(body, Body)
    assert body.arm is IIWA
    assert body.contact is contact
    np.testing.assert_array_equal(body.start, q)
    np.testing.assert_array_equal(body.kinematics.p_WE(q), IIWA.kinematics().p_WE(q))
    np.testing.assert_array_equal(make(IIWA).start, IIWA.home)


def test_levels_differ_in_what_moves_the_arm_and_what_a_law_sees_of_it():
    assert (IdealArm.level, PlantArm.level) == ("kinematic", "dynamic")
    assert (IdealArm.default_feedback, PlantArm.default_feedback) == ("commanded", "measured")
    assert (IdealArm.has_motors, PlantArm.has_motors) == (False, True)
    assert IdealArm(IIWA).tick is None
    assert PlantArm(IIWA, settings=PlantSettings(time_step=2e-3)).tick == 2e-3


@pytest.mark.parametrize("make", LEVELS)
@pytest.mark.parametrize(
    ("arm", "start", "message"),
    [
        ("iiwa14", None, "arm: must be of class Arm, not 'iiwa14'"),
        (HOMELESS, None, "start: must be given; iiwa14 has no home posture"),
        (IIWA, np.zeros(6), "start: has 6 entries for 7 joints"),
        (IIWA, np.zeros((1, 7)), r"start: must have the shape \(7,\), not \(1, 7\)"),
        (IIWA, 0.0, r"start: must have the shape \(7,\), not \(\)"),
        (IIWA, "home", "start: must be 7 numbers, not 'home'"),
        (IIWA, [3.0, *IIWA.home[1:]], "start: .*_1 is at 3 rad"),
    ],
)
def test_a_posture_that_is_none_of_the_arms_is_refused(make, arm, start, message):
    with pytest.raises(InvalidInputError, match=message):
        make(arm, start)


@pytest.mark.parametrize("make", LEVELS)
def test_a_start_outside_the_limits_is_accepted_as_far_as_is_said(make):
    start = [IIWA.limits.position_upper[0] + 0.05, *IIWA.home[1:]]
    assert make(IIWA, start, outside=0.1).start[0] == start[0]
    with pytest.raises(InvalidInputError, match="start: "):
        make(IIWA, start, outside=0.01)


@pytest.mark.parametrize("make", LEVELS)
@pytest.mark.parametrize("outside", [np.nan, -0.1])
def test_how_far_outside_it_may_be_is_an_angle(make, outside):
    """Not a number that no violation exceeds, which would switch the check off."""
    start = [3.0, *IIWA.home[1:]]
    with pytest.raises(InvalidInputError, match=f"outside: must be .*, not {outside}"):
        make(IIWA, start, outside=outside)


def test_a_law_sees_one_of_three_arms():
    for feedback in ("commanded", "measured", "unfiltered"):
        IdealArm.check_feedback(feedback)
    with pytest.raises(InvalidInputError, match="feedback: may be commanded, measured, unfilter"):
        IdealArm.check_feedback("guessed")


class OwnBodies(ContactModel):
    def add_to(self, plant, p_WS):
        pass


class OwnPlane(Surface):
    pass


class TestSurface:
    """What a tool can press against at a level: a spring, or bodies, the user's own among them."""

    @pytest.mark.parametrize(
        ("make", "kind"),
        [
            (IdealArm, ElasticSurface),
            (PlantArm, Plate),
            (PlantArm, ModelSurface),
            (PlantArm, OwnBodies),
        ],
    )
    def test_they_are_accepted(self, make, kind):
        make.check_surface(kind)

    @pytest.mark.parametrize(
        ("make", "kind", "message"),
        [
            (IdealArm, Plate, "elastic_surface at level: kinematic, not plate"),
            (IdealArm, OwnBodies, "elastic_surface at level: kinematic, not OwnBodies"),
            (PlantArm, ElasticSurface, "plate, model at level: dynamic, not elastic_surface"),
            (PlantArm, OwnPlane, "plate, model at level: dynamic, not OwnPlane"),
        ],
    )
    def test_others_are_refused(self, make, kind, message):
        with pytest.raises(InvalidInputError, match=f"environment.kind: may be {message}"):
            make.check_surface(kind)

    def test_a_body_asks_when_it_is_made(self):
        for make, contact in ((IdealArm, PLATE), (PlantArm, SPRING)):
            with pytest.raises(InvalidInputError, match=f"at level: {make.level}, not"):
                make(IIWA, contact=contact)
            with pytest.raises(InvalidInputError, match="contact: must be of class Contact or"):
                make(IIWA, contact=contact.surface)


def test_only_an_arm_with_motors_has_a_plant_to_set():
    """Settings that nothing would use are refused, and so is a plant slower than its controller."""
    assert IdealArm(IIWA).settings is None
    assert PlantArm(IIWA).settings.time_step == PlantSettings().time_step
    with pytest.raises(InvalidInputError, match="plant: only at level: dynamic"):
        IdealArm(IIWA, settings=PlantSettings())
    slow = PlantSettings(time_step=2e-3)
    PlantArm.check_plant(slow, 2e-3)
    with pytest.raises(InvalidInputError, match=r"plant\.time_step: may be at most"):
        PlantArm.check_plant(slow, 1e-3)

"""What the parts of a document that are about contact may be, and may be together."""

import numpy as np
import pytest

from drake_rnn import (
    InvalidInputError,
    check_experiment,
    check_reach,
    load_experiment,
    make_experiment,
    simulate,
)
from drake_rnn.experiment import read_document
from row_helpers import each

PLATE = {"kind": "plate"}


def load(name="contact_circle", **changes):
    return load_experiment(name, {k.replace("__", "."): v for k, v in changes.items()})


@each(
    ("name", "changes", "message"),
    [
        ("motion_force_tricuspid", {"environment": PLATE}, "may be elastic_surface at level: kin"),
        ("motion_force_tricuspid", {"environment": None}, "environment: must be given"),
        ("motion_force_tricuspid", {"plant": {}}, "plant: only at level: dynamic"),
        (
            "contact_circle",
            {"environment": {"kind": "elastic_surface", "stiffness": 1.0}},
            "environment.kind: may be plate, model at level: dynamic, not elastic_surface",
        ),
        ("contact_circle", {"force": None}, "force: must be given with an environment"),
        (
            "slc_nephroid_dynamic",
            {"force": {"value": 1}},
            "force: only with an environment",
        ),
        (
            "contact_circle",
            {"integrator": {"scheme": "runge_kutta3", "step": 1e-3}},
            "period: must be given at level: dynamic",
        ),
        (
            "motion_force_tricuspid",
            {"integrator": {"scheme": "runge_kutta3", "step": 1e-3}, "sensor": {"noise": 0.1}},
            "sensor: needs a sampled law; give a period instead of an integrator",
        ),
        (
            "contact_open_loop",
            {"sensor": {"noise": 0.1}},
            "sensor: must be left out; with these settings the law does not use the measured force",
        ),
        (
            "contact_circle",
            {"plant": {"time_step": 2e-3}},
            r"plant\.time_step: may be at most the controller's period, 0\.001 s, not 0\.002",
        ),
        (
            "contact_circle",
            {"law.contact_loss": {"floor": 5.0}},
            r"law\.contact_loss\.floor: must be below force\.value, 5 N, not 5",
        ),
        ("contact_circle", {"law.stiffness": None}, r"law\.stiffness: must be given"),
        ("contact_circle", {"task": "pose"}, "task: may be xyz for this law, not pose"),
        (
            "motion_force_tricuspid_learned",
            {"task": "pose"},
            "task: may be xyz for this law, not pose",
        ),
        ("motion_force_tricuspid", {"task": "xy"}, "task: may be xyz for this law, not xy"),
        ("contact_circle", {"path.plane": "xz"}, r"path: leaves the surface by 0\.06 m"),
        (
            "contact_inclined",
            {"path.rotation": None},
            r"path: leaves the surface by .* normal \[0\.5, 0\.0, 0\.866\]",
        ),
        (
            "motion_force_tricuspid_literal",
            {"law.stiffness": 8000},
            r"law\.form: literal with stiffness 8000 N/m: the network would need about .* "
            "substeps per period; it may take at most 1000",
        ),
        (
            "motion_force_tricuspid",
            {"law.time_constant": 1e-9},
            r"law\.time_constant: 1e-09 s: the network would need about",
        ),
    ],
)
def test_what_does_not_go_together_is_refused_by_name(name, changes, message):
    with pytest.raises(InvalidInputError, match=message):
        load_experiment(name, changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensor": {"delay": 1.5e-3}}, r"sensor\.delay: must be a multiple"),
        ({"arm": {"model": "iiwa14", "frame": "tip", "mass_scale": 2.0}}, r"arm\.mass_scale"),
        ({"environment.gap": 1.0}, "path: out of reach"),
        ({"force": {"value": 5, "rise_time": 1, "initial": 2000}}, "force.value: 2000 N asks"),
    ],
)
def test_what_cannot_be_run_is_refused_before_anything_runs(changes, message):
    with pytest.raises(InvalidInputError, match=message):
        check_experiment(load_experiment("contact_circle", changes))


def test_a_frame_without_a_tool_is_refused_when_it_is_read():
    with pytest.raises(InvalidInputError, match=r"arm\.frame: nothing that moves with"):
        load("contact_circle", arm={"model": "iiwa14", "frame": "iiwa_link_7"})


def test_a_path_over_the_edge_is_told_with_how_far():
    assert check_reach(load("contact_edge")) == [
        "path: extends 0.03 m beyond the edges of the surface"
    ]
    assert check_reach(load("contact_circle")) == []
    (told,) = check_reach(load("contact_circle", environment__offset=[1.0, 0.0, 0.0]))
    assert "beyond the edges of the surface" in told


def test_a_tool_that_starts_inside_the_plate_is_told():
    (told,) = check_reach(load("contact_circle", environment__gap=-2e-3))
    assert told.startswith("environment.gap: the tool starts 0.002 m inside the surface")


def test_with_full_dynamics_a_law_sees_where_the_arm_is_unless_it_is_told_otherwise():
    document = read_document("contact_circle")
    del document["feedback"]
    made = make_experiment(document)
    assert made.feedback == "measured"
    assert make_experiment(made.document.contents()).feedback == "measured"
    assert make_experiment({**document, "feedback": "commanded"}).feedback == "commanded"
    assert load("motion_force_tricuspid").feedback == "commanded"


def test_an_acceleration_is_that_of_the_plants_steps_not_of_the_laws():
    changes = {"period": 5e-3, "log_period": 1e-3, "duration": 0.3, "window": None}
    result = simulate(load(**changes, accept=None))
    over_steps = np.abs(np.diff(result.series["velocity"], axis=0)).max() / 1e-3
    assert result.metrics["joint_acceleration_max_rad_s2"] == pytest.approx(over_steps, rel=1e-9)

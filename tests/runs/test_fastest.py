"""The shortest admissible duration of a path: found, run again, or refused with figures."""

import pytest

from drake_rnn import InvalidInputError, fastest, load_experiment, make_experiment, simulate

QC = [0.4, 0.8, -0.3, -1.2, 0.5, 0.9, 0.2]
BOUNDS = {"velocity": 0.2, "acceleration": 0.1, "jerk": 0.1, "snap": 0.2, "crackle": 0.2}
POSITION = {"position_lower": -2.0, "position_upper": 2.0}


def circle(**changes):
    document = {
        "name": "circle",
        "arm": "iiwa14",
        "start": QC,
        "path": {"kind": "circle", "plane": "yz", "size": 0.15, "period": 30},
        "law": {"kind": "pseudoinverse"},
        "limits": {**POSITION, **BOUNDS},
        "period": 2e-3,
        "duration": 30,
    }
    return make_experiment({**document, **changes})


@pytest.fixture(scope="module")
def found():
    said = []
    return fastest(circle(), said.append), said


@pytest.mark.long
def test_the_largest_ratio_is_just_admissible(found):
    metrics = found[0].result.metrics
    ratios = [metrics[f"limit_ratio_{order}_max"] for order in range(1, 6)]
    assert 0.99 <= max(ratios) <= 1.0
    assert metrics["shortest_duration_s"] == pytest.approx(20.9, abs=0.2)
    assert found[0].binding == "crackle"


@pytest.mark.long
def test_the_end_effector_stays_on_its_path(found):
    """To a micrometre; half of it at 1 ms."""
    assert found[0].result.metrics["position_error_max_m"] < 1e-6


@pytest.mark.long
def test_derivatives_scale_with_powers_of_the_stretch(found):
    """For a law that stays on its path; two per cent for differences over 10 ms."""
    path = {**found[0].experiment.document.contents()["path"]}
    slow = simulate(circle(path={**path, "period": 24.0}, duration=24)).metrics
    slower = simulate(circle(path={**path, "period": 36.0}, duration=36)).metrics
    for order in range(1, 6):
        name = f"limit_ratio_{order}_max"
        assert slow[name] / slower[name] == pytest.approx(1.5**order, rel=0.02)


@pytest.mark.long
def test_running_it_again_gives_the_same(found):
    again = simulate(found[0].experiment)
    assert again.metrics["limit_ratio_5_max"] == found[0].result.metrics["limit_ratio_5_max"]


@pytest.mark.long
def test_it_says_what_was_tried(found):
    assert len(found[1]) >= 2
    assert "timing: ramps" in found[1][0]
    assert "30 s: largest ratio" in found[1][1]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"limits": "none"}, "limits: must bound at least one derivative"),
        pytest.param(
            {"limits": {**BOUNDS, "position_lower": [-2, -2, -2, -1.22, -2, -2, -2]}},
            "limits.position: iiwa_joint_4 reaches",
            marks=pytest.mark.long,
        ),
        (
            {"path": {"kind": "circle", "plane": "yz", "size": 0.15, "period": 2}, "duration": 2},
            "path.period: 2 s would have to be stretched",
        ),
    ],
)
def test_what_no_speed_cures_is_refused_with_figures(changes, message):
    with pytest.raises(InvalidInputError, match=message):
        fastest(circle(**changes))


def test_without_a_path_there_is_nothing_to_stretch():
    with pytest.raises(InvalidInputError, match="path: must be given, and of another kind"):
        fastest(load_experiment("null_space_adjustment"))


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("horizon_circle", {}, "law.kind: may be joint_drift_free, pseudoinverse, recursive for s"),
        ("chain_circle", {}, "filter: keeps the bounds at any speed"),
        (
            "stretched_circle",
            {"path.offset": [0.01, 0, 0]},
            "path: must begin where the arm starts, not 0.01 m away",
        ),
    ],
)
def test_what_keeps_its_bounds_by_leaving_the_path_is_refused(name, changes, message):
    """It would be certified at any speed."""
    with pytest.raises(InvalidInputError, match=message):
        fastest(load_experiment(name, changes))

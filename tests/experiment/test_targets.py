"""Recorded joint targets of a document: what they do to a run, and what is refused."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, check_experiment, load_experiment, simulate
from drake_rnn.batch import why_not
from shared_runs import shared_run

SHORT = {"accept": None, "duration": 0.4, "obstacles": None}


def load(**changes):
    return load_experiment("stream_guarded", {**SHORT, **changes})


def test_a_run_follows_what_was_recorded():
    experiment = load()
    result = simulate(experiment)
    time, error = result.time, result.series["joint_error"]
    goals = experiment.targets.goals(time, experiment.start)
    assert (result.series["position"] - goals == error).all()
    kinematics = experiment.arm.kinematics()
    desired = [kinematics.p_WE(goal) for goal in goals]
    assert result.series["p_WE_desired"] == pytest.approx(np.array(desired), abs=1e-15)
    largest = np.linalg.norm(error, axis=1).max()
    assert result.metrics["target_error_max_rad"] >= largest > 0.0
    # 100 samples, and 8 targets.
    assert result.series["missed"][-1, 0] == 92.0
    assert "joint_error_max_rad" in result.metrics
    assert "lap_drift_max_rad" not in result.metrics


@pytest.mark.long
def test_the_shipped_stream_comes_to_what_it_expects_and_collides_unguarded():
    result = shared_run("stream_guarded")
    for metric, accepted in result.experiment.document.accept.items():
        assert accepted.holds(result.metrics[metric]), metric
    assert not result.warnings
    blind = simulate(load(duration=10, log_period=4e-3))
    assert result.experiment.clearance.least_along(blind.series["position"]).min() < -0.05


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"targets": None}, "targets: must be given"),
        ({"targets": {"file": "none.csv"}}, "targets: file none.csv: cannot be read: No such"),
        ({"path": {"kind": "rest"}}, "path: this law follows joint targets; leave the path out"),
        ({"duration": 5e-3}, "targets: none that is followed comes within the duration, 0.005 s"),
        ({"arm": "ur5"}, "must have the columns t, q1, q2, q3"),
        ({"on_unreachable": "follow"}, "on_unreachable: follow is only for a path"),
        ({"period": None, "integrator": {"step": 1e-3}}, "integrator: joint targets come to"),
        ({"law": {"kind": "adaptive"}}, "targets: this law follows none; leave them out"),
        ({"task": "pose", "law.home": [0]}, "law.home: follows from start"),
        ({"second": {"base": {"translation": [1, 0, 0]}}, "obstacles": []}, "second: needs laws"),
    ],
)
def test_what_does_not_fit_joint_targets_is_refused(changes, said):
    with pytest.raises(InvalidInputError) as caught:
        load(**changes)
    assert said in str(caught.value)


def test_targets_without_a_number_are_refused_as_such(tmp_path):
    """Their times are within the run."""
    file = tmp_path / "targets.csv"
    file.write_text("".join(f"{0.1 * k},{','.join(['nan'] * 7)}\n" for k in range(3)))
    with pytest.raises(InvalidInputError, match="none can be followed: each of 3 has an entry"):
        load(**{"targets.file": str(file)})


def test_targets_beyond_the_limits_or_after_the_run_are_told_of(tmp_path):
    file = tmp_path / "targets.csv"
    home = load().start
    far = home + np.array([0, 0, 0, 3.0, 0, 0, 0])
    rows = [",".join(map(str, (t, *q))) for t, q in ((0.1, home), (0.2, far), (9, home))]
    file.write_text("\n".join(rows))
    warnings = check_experiment(load(**{"targets.file": str(file)}))
    assert "targets: end at 9 s, and the run at 0.4 s" in warnings
    assert any("1 of 3 are beyond the position limits, panda_joint4" in text for text in warnings)


def test_a_batch_says_why_it_cannot_run_it():
    assert "JointStream" in str(why_not(load()))


def test_a_document_reads_back_with_its_file():
    document = load().document
    assert load_experiment(document.contents()).document.to_yaml() == document.to_yaml()

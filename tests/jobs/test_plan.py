"""Documents of campaigns, and the rows that they make."""

import json
import os
import shlex
import subprocess
import sys
from itertools import islice

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm
from drake_rnn.experiment import (
    ExperimentDocument,
    parse_change,
)
from drake_rnn.experiment import (
    components as arms,
)
from drake_rnn.jobs import plan as planner
from drake_rnn.jobs import plan_campaign, read_campaign, shipped_campaigns
from drake_rnn.jobs.plan import row_values
from drake_rnn.jobs.requests import unique_requests
from drake_rnn.jobs.summary import repeat_command

UNIFORM = {"kind": "uniform", "low": 1e-6, "high": 1e-3}
BASE = {"name": "x", "experiment": "pinv_line", "changes": {"duration": 0.05}}


def document(vary, **more):
    return read_campaign({**BASE, "vary": vary, **more})


def values(*arguments, **more):
    return list(row_values(document(*arguments, **more)))


def test_lists_are_combined_the_last_one_fastest():
    found = values({"seed": [1, 2], "law.feedback": [5, 10]})
    assert [tuple(row.values()) for row in found] == [(1, 5), (1, 10), (2, 5), (2, 10)]


def test_keys_that_are_walked_together_are_not_combined():
    vary = {"seed": [1, 2], "path.period": [4, 5, 6], "law.feedback": [5, 6]}
    found = values(vary, together=[["law.feedback", "seed"]])
    assert [tuple(row.values()) for row in found] == [
        *((1, 4, 5), (1, 5, 5), (1, 6, 5)),
        *((2, 4, 6), (2, 5, 6), (2, 6, 6)),
    ]


def test_few_runs_in_a_batch_take_nearly_as_long_as_many():
    """A step of NumPy takes the same time for one run and for ten, and kinds of laws run apart."""
    vary = {"law.damping": UNIFORM}
    few, many = (plan_campaign(document(vary, samples=k, method="batch")).time for k in (2, 20))
    apart = plan_campaign(
        document({"arm": ["iiwa14", "panda", "ur5"], **vary}, samples=2, method="batch")
    )
    steps = 50
    assert steps * 5e-4 < few < steps * 1e-3 + 0.04
    assert many - few < 20 * 0.011
    assert apart.time > 2.5 * few


def test_every_combination_has_the_same_samples():
    """So that combinations can be compared draw by draw."""
    found = values({"law.damping": UNIFORM, "law.feedback": [5, 10]}, samples=3)
    drawn = [row["law.damping"] for row in found]
    assert drawn[:3] == drawn[3:]
    assert len(set(drawn)) == 3
    assert list(found[0]) == ["law.damping", "law.feedback"]


def test_a_sample_depends_on_seed_key_and_number_alone():
    """More samples, other keys and their order change none."""
    alone = values({"law.damping": UNIFORM}, samples=3)
    more = values({"law.feedback": UNIFORM, "seed": [1], "law.damping": UNIFORM}, samples=8)
    assert [row["law.damping"] for row in more[:3]] == [row["law.damping"] for row in alone]
    assert all(row["law.damping"] != row["law.feedback"] for row in more)
    other = values({"law.damping": UNIFORM}, samples=3, seed=1)
    assert {row["law.damping"] for row in other}.isdisjoint(row["law.damping"] for row in alone)


def test_draws_about_home_are_those_about_nothing_and_the_home_of_each_arm():
    near = {"kind": "uniform", "low": -0.1, "high": 0.1, "about": "home"}
    drawn = document({"arm": ["panda", "ur5"], "start": near}, samples=3)
    rows = [row.changes for row in plan_campaign(drawn).rows]
    plain = values({"start": {"kind": "uniform", "low": [-0.1] * 7, "high": [0.1] * 7}}, samples=3)
    for k, row in enumerate(rows):
        home = load_arm(row["arm"]).home
        moved = np.array(row["start"]) - home
        np.testing.assert_allclose(moved, plain[k % 3]["start"][: home.size], atol=1e-15)


def test_draws_about_home_are_refused_elsewhere_and_with_other_sizes():
    near = {"kind": "normal", "mean": 0.0, "deviation": [0.1, 0.1], "about": "home"}
    with pytest.raises(InvalidInputError, match="only draws of start may be about home"):
        document({"law.damping": near}, samples=2)
    with pytest.raises(InvalidInputError, match=r"deviation: must be a number or have 7 entries"):
        plan_campaign(document({"start": near}, samples=2))


@pytest.mark.long
def test_draws_are_the_same_in_another_process():
    contents = {**BASE, "samples": 4, "vary": {"law.damping": UNIFORM}}
    code = (
        "import json; from drake_rnn.jobs import read_campaign; "
        "from drake_rnn.jobs.plan import row_values; "
        f"print(json.dumps(list(row_values(read_campaign({contents!r})))))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONHASHSEED": "7"},
    )
    assert json.loads(run.stdout) == values({"law.damping": UNIFORM}, samples=4)


def test_the_same_run_has_the_same_key_and_any_other_another():
    drawn = document({"seed": {"kind": "integers", "low": 1, "high": 2}}, samples=6)
    one, same = (plan_campaign(drawn) for _ in range(2))
    assert [row.key for row in one.rows] == [row.key for row in same.rows]
    key_of = {row.changes["seed"]: row.key for row in one.rows}
    assert [key_of[row.changes["seed"]] for row in one.rows] == [row.key for row in one.rows]
    assert len(unique_requests(one.rows)) == len(set(key_of.values())) == 2
    keys = [key_of[1], key_of[2]]
    longer = plan_campaign(document({"seed": [1, 2]}, changes={"duration": 0.06}))
    assert {row.key for row in longer.rows}.isdisjoint(keys)
    renamed = plan_campaign(document({"seed": [1, 2]}, name="other", expect="nothing"))
    assert [row.key for row in renamed.rows] == keys[:2]


def test_rows_of_other_versions_have_other_keys(monkeypatch):
    before = plan_campaign(document({"seed": [1]})).rows[0]
    monkeypatch.setattr("drake_rnn.experiment.files.stamp", lambda: "drake 2.0")
    after = plan_campaign(document({"seed": [1]})).rows[0]
    assert before.key != after.key


def test_a_file_that_changes_changes_the_keys(tmp_path):
    """Of a path's points, whose name in the document stays the same."""
    points, key = tmp_path / "points.csv", []
    for x in (0.05, 0.06):
        points.write_text(f"0, 0, 0\n0.02, 0, {x}\n0.04, 0, 0\n")
        path = {"kind": "points", "file": str(points), "period": 4, "closed": False}
        plan = plan_campaign(document({"seed": [1]}, changes={"duration": 0.05, "path": path}))
        key.append(plan.rows[0].key)
    assert key[0] != key[1]


def test_the_command_of_a_row_sets_its_values_bit_for_bit():
    row = {"law.damping": 1 / 3, "start": [0.1, -1e-7], "filter": None, "task": "xyz", "x.y": True}
    words = repeat_command(row, "out/a campaign/experiment.yaml").split(" --set ")
    assert shlex.split(words[0])[-1] == "out/a campaign/experiment.yaml"
    found = dict(parse_change(shlex.split(word)[0]) for word in words[1:])
    assert found == row


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vary": {"law.dampign": [1]}}, "law.dampign: no such key; nearest: damping (row 0)"),
        ({"vary": {"law.damping": [1, -1]}}, "law.damping: must be greater than"),
        ({"vary": {"path.byy": [[0, 0, 1]]}}, "path.byy: no such key; nearest: by"),
        ({"vary": {"duration": [0.05, 1e9]}, "changes": {}}, "period: 0.001 s makes 1e+12 steps"),
        ({"vary": {"start": [[0, 0], [0, 1]]}}, "start: has 2 entries for 7 joints (row 0)"),
        ({"vary": {"limits.velocity": [1, [1, 2]]}}, "limits.velocity: must have 7 entries"),
        ({"vary": {"seed": [1]}, "samples": 3}, "samples: must be left out, as nothing is drawn"),
        ({"vary": {"law.damping": UNIFORM}}, "samples: must be given, as law.damping is drawn"),
        ({"vary": {}}, "vary: must name what varies"),
        (
            {"vary": {"duration": [1]}},
            "vary.duration: is also in changes; it cannot be both",
        ),
        ({"vary": {"seed": [1]}, "vayr": 3}, "vayr: no such key; nearest: vary"),
        ({"vary": {"seed": [1]}, "metrics": ["error"]}, "metrics: no metric 'error'"),
        ({"vary": {"seed": [1]}, "together": [["x"]]}, "together: 'x' must be a key of vary"),
        (
            {"vary": {"seed": [1], "law.damping": [1, 2]}, "together": [["seed", "law.damping"]]},
            "together: must have as many values as one another; seed has 1, law.damping has 2",
        ),
        (
            {"vary": {"seed": {"kind": "range", "low": 0, "high": 1, "count": 9**9}}},
            "vary: makes 387420489 rows",
        ),
        ({"vary": {"seed": [1]}, "name": "a/b"}, "name: must be a valid folder name"),
        (
            {"vary": {"seed": [1]}, "statistics": {"quantiles": [1.5]}},
            "statistics.quantiles.0: must be less than 1",
        ),
        ({"vary": {"seed": [1]}, "experiment": "pin_line"}, "experiment: no experiment 'pin_line'"),
    ],
)
def test_bad_campaigns_are_refused_by_name_before_anything_runs(changes, message):
    with pytest.raises(InvalidInputError) as caught:
        plan_campaign(read_campaign({**BASE, **changes}))
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "every"),
    [
        # Their thousands of rows take half a minute; every 53rd has all values of each key.
        *((name, 53 if name.startswith("networks") else 1) for name in shipped_campaigns()),
        pytest.param("networks_500_hz", 1, marks=pytest.mark.nightly),
    ],
)
def test_every_shipped_campaign_makes_valid_rows(monkeypatch, name, every):
    values = planner.row_values
    monkeypatch.setattr(
        planner, "row_values", lambda *given: islice(values(*given), 0, None, every)
    )
    given = {"samples": 3} if read_campaign(name).distributions else {}
    plan = plan_campaign(read_campaign(name, **given))
    assert plan.campaign.expect
    assert plan.rows
    for row in plan.rows:
        ExperimentDocument(**row.document)


def test_a_range_of_a_million_rows_is_counted_without_making_them():
    ends = {"kind": "range", "low": 0, "high": 999, "count": 1000}
    assert document({"seed": ends, "law.damping": list(range(1000))}).count == 10**6


def test_the_arm_is_loaded_once_for_all_rows_and_once_for_the_first(monkeypatch):
    """To load it takes half of what a short run does."""
    loaded, load = [], arms.load_arm
    monkeypatch.setattr(arms, "load_arm", lambda *given: loaded.append(given) or load(*given))
    plan = plan_campaign(document({"law.damping": UNIFORM}, samples=50))
    assert len(plan.rows) == 50
    assert len(loaded) == 2
    assert np.isfinite(plan.time)


def test_a_row_whose_level_does_not_fit_is_refused_when_the_campaign_is_planned():
    """Not only the first row: each row's level, feedback and plant are checked before any run."""
    vary = {"plant": [None, {"time_step": 1e-3}]}
    with pytest.raises(
        InvalidInputError, match=r"plant: only at level: dynamic or torque \(row 1\)"
    ):
        plan_campaign(document(vary))

"""Cells of the cross table, with shorter laps: mass changes little, and what is kept is kept."""

import re

import pytest
from doc_pages import ROOT

import cross
from cross import Cell, all_places, keep, kept_cells, misses, not_run, refusals, run
from cross_cells import (
    LEVELS,
    SYSTEM_ARM,
    SYSTEM_VARIANTS,
    SYSTEMS,
    document,
    law_of,
    system_document,
    system_levels,
)
from drake_rnn import make_experiment, simulate
from drake_rnn.laws import LAWS
from drake_rnn.measures import METRICS, violation_metric

#: One of each kind, and the arm that it runs on.
THINNED = {
    "slc, known J": "ur5",
    "slc, learned by warm-up": "planar6",
    "naljdf": "panda",
    "moaljdf": "planar6",
    "recursive, n = 1": "iiwa14",
    "pseudoinverse": "planar6",
    "pseudoinverse, filtered": "ur5",
    "receding horizon": "panda",
    "zeroing, prescribed": "iiwa14",
    "projection, lvi": "ur5",
    "null-space adjustment": "planar6",
    "modified state adjustment": "ur5",
    "motion-force, known J": "ur5",
    "motion-force, learned J": "iiwa14",
}


#: A law of velocities, and one of accelerations.
LONG = ("slc, known J", "naljdf")


@pytest.mark.long
@pytest.mark.parametrize(
    "variant",
    [pytest.param(name, marks=() if name in LONG else pytest.mark.nightly) for name in THINNED],
)
def test_mass_adds_little_to_the_error_of_any_law(variant):
    """0.3 mm, at up to 0.13 m/s; ideal arms keep what their laws say, but for injected noise."""
    cells = []
    for level in LEVELS:
        contents = document(variant, THINNED[variant], level, lap=4.0)
        experiment = make_experiment(contents)
        result = simulate(experiment)
        place = (variant, THINNED[variant], level)
        kept = experiment.guarantees.arm.limits
        cells.append(Cell(*place, kept, result.metrics, tuple(result.warnings)))
        assert not [said for said in result.warnings if said.startswith("plant: ")]
    kinematic, dynamic = cells
    assert dynamic.error < kinematic.error + 3e-4
    if "dither" not in contents:
        assert kinematic.limits in ("kept", "none")


def test_a_cell_without_a_run_has_its_reason():
    cell = run(("motion-force, known J", "planar6", "kinematic"))
    assert cell.reason == "task: may be xyz for this law, not xy"
    assert misses([cell]) == []


def test_a_cell_that_dynamics_spoil_is_a_miss():
    def cell(level, error):
        return Cell("pseudoinverse", "ur5", level, metrics={"position_error_max_m": error})

    assert misses([cell("kinematic", 1e-4), cell("dynamic", 3e-3)]) == [
        "pseudoinverse on ur5: 0.003 m"
    ]
    assert misses([cell("kinematic", 1e-4), cell("dynamic", 1e-3)]) == []
    # What is not good without dynamics need not be with them.
    assert misses([cell("kinematic", 5e-3), cell("dynamic", 6e-3)]) == []


def test_only_limits_that_a_law_keeps_are_counted():
    beyond = {violation_metric("velocity"): 0.25, violation_metric("jerk"): 7.0}

    def told(*keeps):
        return Cell("", "", "", keeps, beyond).limits

    assert told() == "none"
    assert told("position") == "kept"
    assert told("velocity", "acceleration") == "velocity by 0.25 rad/s"


def test_cells_that_are_kept_are_read_again_in_order_of_the_page(tmp_path):
    late = Cell("pseudoinverse", "ur5", "dynamic", (), {"position_error_max_m": 0.1}, ("told",))
    early = Cell("adaptive, known J", "ur5", "kinematic", ("velocity",), {}, reason="refused")
    cells = {(cell.variant, cell.arm, cell.level): cell for cell in (late, early)}
    keep(cells, tmp_path / "cells.json")
    found = kept_cells(tmp_path / "cells.json")
    assert found == cells
    assert list(found.values()) == [early, late]
    assert kept_cells(tmp_path / "none.json") == {}


def test_cells_of_systems_are_kept_beside_the_others(tmp_path):
    plain = Cell("zeroing", "panda", "dynamic", reason="refused")
    system = Cell("zeroing", "panda", "dynamic", reason="refused too", system="two tools")
    keep({cell.place: cell for cell in (system, plain)}, tmp_path / "cells.json")
    assert list(kept_cells(tmp_path / "cells.json").values()) == [plain, system]
    # Rows of the first table are as they were before there were systems.
    assert (tmp_path / "cells.json").read_text().count("system") == 1


def test_every_kind_of_law_is_given_every_system():
    assert {law_of(variant)["kind"] for variant in SYSTEM_VARIANTS} == set(LAWS)
    tried = {(place[3], place[0]) for place in all_places() if len(place) > 3}
    assert tried == {(system, variant) for system in SYSTEMS for variant in SYSTEM_VARIANTS}


def test_what_refuses_a_law_is_said_once_for_all_that_it_refuses():
    cells = [
        Cell(*place, reason=reason)
        for *place, reason in (
            ("zeroing", "panda", "kinematic", "camera: Zeroing sees no pixels"),
            ("zeroing", "panda", "dynamic", "camera: Zeroing sees no pixels"),
            ("pseudoinverse", "panda", "kinematic", "camera: Pseudoinverse sees no pixels"),
            ("adaptive, learned", "panda", "kinematic", ""),
            ("adaptive, learned", "panda", "dynamic", "level: must be kinematic"),
        )
    ]
    assert refusals(cells) == {
        "camera: this law sees no pixels": ["zeroing", "pseudoinverse"],
        "level: must be kinematic": ["adaptive, learned, dynamic"],
    }


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_law_of_a_system_is_taken_and_has_the_errors_that_are_shown(system):
    law = SYSTEMS[system].law
    level, *_ = system_levels(system, law, SYSTEM_ARM)
    make_experiment(system_document(system, law, SYSTEM_ARM, level))
    names = {metric.name for metric in METRICS}
    assert {SYSTEMS[system].path, *SYSTEMS[system].measures.values()} <= names


def test_pairs_that_were_not_run_are_counted():
    assert re.search(r"^ \d+ of (\d+) pairs .* \(fr3, .*ur5\)\.$", not_run({}))
    every = {place: None for place in cross.product(cross.VARIANTS, cross.shipped_arms(), LEVELS)}
    assert not_run(every) == ""


def test_the_page_is_made_of_the_cells_that_are_kept(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["cross.py", "--laws"])
    cross.main()
    made, page = capsys.readouterr().out, (ROOT / "docs/cross.md").read_text()
    # How old its tables are is said by hand.
    age = r"of \w+(?:; measured [\w ]+)? -->|Its tables were measured [^.]+\.\n\n"
    assert re.sub(age, "", made) == re.sub(age, "", page)

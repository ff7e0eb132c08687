"""What benchmarks print is kept by commit, and a ratio that has grown is told."""

import json
import sys

import numpy as np
import pytest

import avoidance_cost
import bench_history
import waiting_target
from drake_rnn import load_experiment

SCRIPT = '''
"""A benchmark that prints both kinds of tables."""
import sys
from rich.console import Console
from rich.table import Table

if __name__ == "__main__":
    table = Table(title="cost, in units of p_WE and J (us in brackets)")
    for column in ("experiment", "period", "whole", "targets"):
        table.add_column(column)
    table.add_row("one", "0.001 s", f"{sys.argv[1]} (64.2)", "law 4, 16")
    Console(width=160).print(table)
    print("| experiment | robots | NumPy: us | units | C: us | units |\\n|---|---|---|---|---|---|")
    print("| `two` | 1000 | 12.5 | 3.1 | 1e-1 | 0.02 |")
'''


@pytest.fixture
def history(tmp_path, monkeypatch):
    """A history in a folder of its own, and a function that adds a run of a commit."""
    script = tmp_path / "a_bench.py"
    script.write_text(SCRIPT)
    monkeypatch.setattr(bench_history, "HISTORY", tmp_path / "bench" / "history.jsonl")

    def add(commit, day, cost):
        at = {"commit": commit, "time": f"2026-11-{day:02}T00:00:00+00:00"}
        monkeypatch.setattr(bench_history, "commit", lambda: at)
        monkeypatch.setattr(sys, "argv", ["bench_history.py", "run", str(script), str(cost)])
        bench_history.main()

    return add


def lines():
    return [json.loads(line) for line in bench_history.HISTORY.read_text().splitlines()]


def test_each_figure_has_a_line_with_its_commit(history, capsys):
    history("aaa", 1, 15.7)
    assert "15.7 (64.2)" in capsys.readouterr().out
    found = [(line["row"], line["column"], line["value"], line["ratio"]) for line in lines()]
    assert [line["step"] for line in lines()] == pytest.approx([0.1, 0.1, 0.1, 0.1, 0.01])
    assert found == [
        ("one", "whole", 15.7, True),
        ("two, 1000", "NumPy: us", 12.5, False),
        ("two, 1000", "NumPy: us, units", 3.1, True),
        ("two, 1000", "C: us", 0.1, False),
        ("two, 1000", "C: us, units", 0.02, True),
    ]
    assert {line["commit"] for line in lines()} == {"aaa"}
    assert {line["benchmark"] for line in lines()} == {"a_bench 15.7"}


def test_cells_that_are_empty_stay_in_their_columns():
    text = "| steps | in C [us] | of all |\n|---|---|---|\n| fine | 17 | 3 |\n| ratio |  |  |\n"
    ((head, rows),) = bench_history.markdown_tables(text)
    assert head == ["steps", "in C [us]", "of all"]
    assert rows == [["fine", "17", "3"], ["ratio", "", ""]]


def test_a_ratio_that_has_grown_by_more_than_a_tenth_is_told(history):
    def growth():
        return bench_history.grown({**line, "benchmark": "a"} for line in lines())

    for day, cost in enumerate((16.0, 15.0, 30.0, 15.5), 1):
        history(f"c{day}", day, cost)
    # One commit before was measured on a busy machine: the median does not mind.
    assert growth() == []
    history("new", 9, 17.0)
    assert growth() == []
    history("new+", 10, 17.8)
    assert growth() == ["a: one: whole: 17.8, 1.11 times the 16 of before"]
    # What may be rounding is no growth: 0.02 may have been 0.0249.
    grown_a_little = [
        {"benchmark": "a", "row": "r", "column": "u", "ratio": True, "step": 0.01, "value": value}
        | {"commit": f"c{day}", "time": f"2026-11-{day:02}"}
        for day, value in enumerate((0.02, 0.03), 1)
    ]
    assert bench_history.grown(grown_a_little) == []
    # Of several runs of a commit the least disturbed counts.
    history("new+", 10, 16.2)
    assert growth() == []


def test_a_check_without_a_history_is_none(history, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["bench_history.py", "check"])
    bench_history.main()
    assert capsys.readouterr().out.startswith("0 ratios")


def test_the_ratios_are_drawn_over_the_commits(history, tmp_path):
    for day, cost in enumerate((16.0, 15.0), 1):
        history(f"c{day}", day, cost)
    file = tmp_path / "history.svg"
    bench_history.draw(({**line, "benchmark": "a"} for line in lines()), file)
    assert file.read_text().count("<svg") == 1


def test_benchmarks_give_laws_among_obstacles_all_that_they_see(monkeypatch):
    """They make signals by hand; of a law that sees more than these a step is refused."""
    experiment = load_experiment(avoidance_cost.NAME)
    monkeypatch.setattr(avoidance_cost, "UNTIL", 0.005)
    monkeypatch.setattr(avoidance_cost, "timed_in_c", lambda *given: np.ones(5))
    assert (avoidance_cost.timed(experiment, experiment) > 0.0).all()
    monkeypatch.setattr(waiting_target, "LAPS", 0.01)
    assert waiting_target.run(0, *waiting_target.ROWS["waits"])["time"] > 0.0

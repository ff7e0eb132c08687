"""One table in every format: the same numbers, rounded alike, with the same units."""

import csv
import re

import pytest

from drake_rnn.errors import InvalidInputError
from drake_rnn.tables import Cell, Column, Heading, Sheet, metric_heading, write_sheet

ERROR, VELOCITY = "position_error_max_m", "velocity_error_max_m_s"
VALUES = (3.14159e-5, 1.2345678e-4)


def by_rows():
    """A metric a row, as a comparison has them."""
    runs = (Column(Heading("one_law"), right=True), Column(Heading("other"), right=True))
    sheet = Sheet((Column(Heading("metric")), *runs))
    sheet.rows.append((metric_heading(ERROR), *(Cell((value,)) for value in VALUES)))
    high = Cell((1.25,), bound="<= 1", kept=False)
    sheet.rows.append((metric_heading("limit_ratio_1_max"), Cell((-2e-7,)), high))
    return sheet


def by_columns():
    """A metric a column, as a sweep has them."""
    columns = (Column(Heading("duration", unit="s")), Column(metric_heading(ERROR), right=True))
    return Sheet(columns, [(str(k), Cell((value,))) for k, value in enumerate(VALUES)])


def written(sheet, tmp_path, ending):
    write_sheet(sheet, tmp_path / "folder" / f"table{ending}")
    return (tmp_path / "folder" / f"table{ending}").read_text()


@pytest.mark.parametrize("made", [by_rows, by_columns])
def test_every_format_has_the_same_numbers_in_the_same_units(made, tmp_path):
    """The coarsest prefix that leaves .1 to the largest: .1234 mm."""
    for ending in (".md", ".tex", ".csv"):
        text = written(made(), tmp_path, ending)
        assert re.findall(r"0\.0314\d+|0\.1235", text) == ["0.03142", "0.1235"], text
        assert "position error max [mm]" in text.replace("{[}", "[").replace("{]}", "]")


def test_a_terminal_has_the_names_of_documents_and_a_unit_beside_each_number():
    """One unit for a row or a column, but for numbers that are far smaller than the largest."""
    name, *numbers = map(str, by_rows().for_terminal().rows[0])
    assert [name, *numbers] == [ERROR, "0.03142 mm", "0.1235 mm"]
    sheet = Sheet(
        (Column(metric_heading(ERROR)),), [(Cell((4e-8, 1e-9), "{} ± {}"),), (Cell((0.2,)),)]
    )
    shown = sheet.for_terminal()
    assert [str(row[0]) for row in shown.rows] == ["40.0 ± 1.0 nm", "0.2 m"]
    assert str(shown.columns[0].heading) == ERROR
    assert [str(row[0]) for row in sheet.for_page().rows] == ["4.00e-08 ± 1.0e-09", "0.2"]


def test_a_number_beyond_its_bound_is_marked_and_the_mark_is_explained(tmp_path):
    latex, page = written(by_rows(), tmp_path, ".tex"), written(by_rows(), tmp_path, ".md")
    assert r"1.25$^\dagger$ \\" in latex
    assert "1.25 †" in page
    for text in (latex, page):
        assert text.count("violates its acceptance bound") == 1
        assert "<=" not in text
    assert "outside" not in written(by_columns(), tmp_path, ".tex")
    with (tmp_path / "folder" / "table.csv").open("w+") as stream:
        stream.write(written(by_rows(), tmp_path, ".csv"))
        stream.seek(0)
        assert [row["other"] for row in csv.DictReader(stream)] == ["0.1235", "1.25"]


def test_latex_has_three_rules_and_as_many_cells_in_each_line(tmp_path):
    text = written(by_rows(), tmp_path, ".tex")
    for rule in (r"\toprule", r"\midrule", r"\bottomrule", r"\begin{tabular}{@{}lrr@{}}"):
        assert text.count(rule) == 1
    lines = [line for line in text.splitlines() if line.endswith(r"\\") and "multicol" not in line]
    assert [len(re.split(r"(?<!\\)&", line)) for line in lines] == [3, 3, 3]
    assert r"one\_law" in text
    assert r"$-2 \times 10^{-7}$" in text


def test_what_latex_takes_for_commands_is_set_as_it_is(tmp_path):
    texts = {
        "law.kappa_1 & 50 % of {x}": r"law.kappa\_1 \& 50 \% of \{x\}",
        "[0, -1.5]": "{[}0, $-1.5${]}",
        "<= 3 µm/s²": r"$\le$ 3 $\mu$m/s$^{2}$",
        "ε, Γ": r"$\epsilon$, $\Gamma$",
        "1e-05 to 2.5e+03": r"$1 \times 10^{-5}$ to $2.5 \times 10^{3}$",
        "slc-F2a, e.g. ur5": "slc-F2a, e.g. ur5",
        "a | b": "a $|$ b",
    }
    sheet = Sheet((Column(Heading("text")),), [(text,) for text in texts])
    lines = written(sheet, tmp_path, ".tex").splitlines()
    for expected in texts.values():
        assert rf"{expected} \\" in lines


def test_markdown_keeps_its_columns_whatever_is_in_a_cell(tmp_path):
    sheet = Sheet((Column(Heading("a|b")), Column(Heading("c"))), [("|x|\ny", "z")])
    assert r"| \|x\| y | z |" in written(sheet, tmp_path, ".md")


def test_a_long_table_may_be_broken_between_pages(tmp_path):
    sheet = Sheet((Column(Heading("text"), long=True),), [("word",)] * 41)
    text = written(sheet, tmp_path, ".tex")
    assert text.index(r"\begin{longtable}") < text.index(r"\endhead") < text.index("word")


def test_a_table_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match=r"table\.doc: must end in one of \.md, \.tex"):
        write_sheet(by_rows(), tmp_path / "table.doc")
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match=r"table: .*Not a directory"):
        write_sheet(by_rows(), tmp_path / "file" / "table.md")


def test_values_that_are_no_numbers_leave_the_unit_to_the_others(tmp_path):
    columns = (Column(metric_heading(VELOCITY)),)
    sheet = Sheet(columns, [(Cell((float("nan"),)),), (Cell((float("inf"),)),), (Cell((2e-4,)),)])
    assert written(sheet, tmp_path, ".csv").split("\n") == [
        "velocity error max [mm/s]", "nan", "inf", "0.2", "",
    ]  # fmt: skip
    assert "[m/s]" in written(Sheet(columns, sheet.rows[:2]), tmp_path, ".md")

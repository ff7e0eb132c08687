"""Recordings of joint targets that are none: refused with file, row and column."""

from refusing import refusal

from drake_rnn.paths import RecordedTargets
from row_helpers import each

GOOD = "t,q1,q2\n0,0,0\n0.1,0.1,nan\n0.2,,0.2\n"
JOINTS = ["shoulder", "elbow"]

#: What the file holds, and what is said of it.
FILES = {
    "nothing": ("", "is empty"),
    "a header alone": ("t,q1,q2\n", "has no targets"),
    "times alone": ("t\n0\n1\n", "row 1: must have the columns t, and one per joint"),
    "no times": (
        "q1,q2\n0,0\n",
        "row 1: has no column of times, such as t or timestamp, among ['q1', 'q2']; of rows at "
        "equal times give targets.period",
    ),
    "a column twice": ("t,q1,q1\n0,0,0\n", "row 1: column q1 is given twice"),
    "thousands of columns": ("0," * 5000 + "0\n", "row 1: has 5001 columns, and may have 1000"),
    "a time before the start": ("t,q1,q2\n-1,0,0\n", "row 2: t must be 0 or later, not -1"),
    "times that are not sorted": (
        GOOD + "0.15,0,0\n",
        "row 5: t must be greater than 0.2, that of the row before, not 0.15",
    ),
    "a time twice": (GOOD + "0.2,0,0\n", "row 5: t must be greater than 0.2"),
    "a time that is NaN": (GOOD + "nan,0,0\n", "row 5, column 1: 'nan' is not a finite number"),
    "infinity": (GOOD + "0.3,inf,0\n", "row 5, column 2: 'inf' is not a finite number, nor nan"),
    "a word": (GOOD + "0.3,0,far\n", "row 5, column 3: 'far' is not a finite number, nor nan"),
    "a row that is short": (GOOD + "0.3,0\n", "row 5: must have 3 entries, one per column, not 2"),
    "a row that is long": (GOOD + "0.3,0,0,0\n", "row 5: must have 3 entries"),
    "bytes of a program": (bytes(range(256)), "is not a text file"),
    "too many rows": ("t,q1,q2\n" + "1,0,0\n" * 250_000, "has 250000 rows, and may have 100000"),
    "a joint too many": ("t,q1,q2,q3\n0,0,0,0\n", "must have the columns t, q1, q2, or the names"),
    "a joint too few": ("0,0\n", "the 2 joints, shoulder, elbow, not ['t', 'q1']"),
    "joints of another arm": ("t,hip,knee\n0,0,0\n", "not ['t', 'hip', 'knee']"),
}


@each(("content", "said"), FILES.values(), ids=FILES)
def test_a_file_that_holds_no_targets_of_the_arm_is_refused(tmp_path, content, said):
    file = tmp_path / "targets.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert said in refusal(lambda: RecordedTargets(file=str(file)).of_arm(JOINTS))


def test_what_is_no_file_is_refused(tmp_path):
    said = refusal(lambda: RecordedTargets(file=str(tmp_path / "none.csv")))
    assert "none.csv: cannot be read: No such file" in said

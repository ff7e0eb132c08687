"""Lines about the progress of a campaign, where there is no terminal."""

import re

import pytest

from drake_rnn.cli import running as campaign_shown
from drake_rnn.jobs import RunRecord


@pytest.mark.parametrize("kept", [0, 400])
def test_the_time_left_is_by_what_rows_take_and_not_by_what_comes_before(kept, monkeypatch, capsys):
    now, rows, pace = 0.0, 1000, 2.0
    monkeypatch.setattr(campaign_shown, "perf_counter", lambda: now)
    lines = campaign_shown._Lines("starts")
    now += 500.0
    lines.tell(kept, rows, None)
    for ended in range(kept + 1, kept + 101):
        now += pace
        lines.tell(ended, rows, RunRecord("complete"))
    told = capsys.readouterr().err.splitlines()
    assert len(told) >= 5
    for line in told:
        ended, left = map(
            int, re.fullmatch(r"starts: (\d+) of 1000 .* about (\d+) s left", line).groups()
        )
        assert left == pytest.approx(pace * (rows - ended))


def test_rows_of_a_batch_that_end_at_once_are_counted_together(monkeypatch, capsys):
    now, batch = 0.0, 12
    monkeypatch.setattr(campaign_shown, "perf_counter", lambda: now)
    lines = campaign_shown._Lines("starts")
    lines.tell(0, 4 * batch, None)
    for ended in range(1, 4 * batch + 1):
        now += 40.0 if ended % batch == 1 else 1e-3
        lines.tell(ended, 4 * batch, RunRecord("complete"))
    told = capsys.readouterr().err.splitlines()
    assert told == [
        f"starts: {12 * k} of 48 runs finished; about {160 - 40 * k} s left" for k in (1, 2, 3)
    ]

"""What is told of work that takes its time, where there is no terminal."""

import time

from drake_rnn.inputs import progress


def test_long_work_tells_how_far_it_is_and_short_work_nothing(monkeypatch, capsys):
    with progress.telling("short work"):
        pass
    monkeypatch.setattr(progress, "_LONG", 0.0)
    monkeypatch.setattr(progress, "_BETWEEN", -1.0)
    with progress.telling("work") as tell:
        while "work ..." not in (told := capsys.readouterr().err):
            assert not told
            time.sleep(1e-3)
        tell("link2, 2 of 7")
    progressed, ended, *rest = capsys.readouterr().err.splitlines()
    assert progressed == "work: link2, 2 of 7"
    assert ended.startswith("work: ")
    assert ended.endswith(" s")
    assert not rest

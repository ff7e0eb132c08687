"""Nothing is left behind by what is done again and again, in a process that lives for long."""

import pytest

from memory import TASKS, growth


def left_little(name, calls, warm=10):
    """Check what calls leave behind: an allocator keeps some, objects are those of caches."""
    left = growth(TASKS[name](), calls, warm)
    assert left.objects <= calls // 2, left
    assert left.files == 0
    # A diagram has 0.4 to 2 MB; pages that are freed in part count as well.
    assert left.memory < 8.0, left


@pytest.mark.parametrize(
    ("name", "calls"), [("simulate", 60), ("law switch", 30), ("reset", 60), ("recording", 8)]
)
@pytest.mark.long
def test_little_is_left_behind(name, calls):
    left_little(name, calls)


# Figures take three seconds a call; each tuning is compiled, for half a minute.
@pytest.mark.nightly
@pytest.mark.parametrize("name", sorted(TASKS.keys() - {"tune by one step"}))
def test_nothing_is_left_behind_by_anything(name):
    left_little(name, 60, warm=20)

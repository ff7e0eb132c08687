"""The tables of mutants speak of modules, tests and lines that are there."""

import pytest

import tables


def test_every_module_in_the_rooms_has_its_tests():
    found = tables.tests_of()
    assert found.keys() == {*tables.modules()}
    for module, tests in found.items():
        assert tests, module
        for test in tests:
            file, _, name = test.partition("::")
            written = (tables.PACKAGE.parent / "tests" / file).read_text()
            assert f"def {name}" in written, (module, test)


def test_a_module_that_nobody_tests_is_named(monkeypatch):
    monkeypatch.setattr(tables, "ROOMS", (*tables.ROOMS, "runs/simulation.py"))
    with pytest.raises(ValueError, match=r"tests_of.yaml: .*runs/simulation.py"):
        tables.tests_of()


def test_what_is_explained_is_still_written_so():
    """Else the reason belongs to code that has gone."""
    for module, mutants in tables.explained().items():
        lines = [line.strip() for line in (tables.PACKAGE / module).read_text().splitlines()]
        for mutant in mutants:
            assert mutant.keys() == {"was", "now", "why"}
            assert mutant["was"] in lines, (module, mutant["was"])
            assert mutant["was"] != mutant["now"]

"""The rooms of the package and what may lead from one to another."""

import ast
import gc
import inspect
import re
from functools import cache, cached_property
from pathlib import Path

import grimp
import pytest
from importlinter.cli import lint_imports

import drake_rnn
from drake_rnn import LAWS

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "drake_rnn"


@cache
def trees():
    """Syntax trees by the name of their file, also through the links to diagrams/ and models/."""
    files = [*PACKAGE.glob("*.py")]
    for room in filter(Path.is_dir, PACKAGE.iterdir()):
        files += room.rglob("*.py")
    # Trees are no garbage, and looking for it takes longer than to make them.
    gc.disable()
    found = {str(file.relative_to(ROOT)): ast.parse(file.read_text()) for file in files}
    gc.freeze()
    gc.enable()
    return found


@cache
def nodes():
    return [(name, node) for name, tree in trees().items() for node in ast.walk(tree)]


def walk(kind):
    return [(name, node) for name, node in nodes() if isinstance(node, kind)]


def test_imports_point_downwards_and_close_no_circle(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert lint_imports(no_cache=True) == 0


def test_the_contracts_see_every_room_also_those_that_are_links():
    modules = grimp.build_graph("drake_rnn", cache_dir=None).modules
    rooms = {module.split(".")[1] for module in modules if "." in module}
    assert rooms == {
        file.stem for file in PACKAGE.iterdir() if file.is_dir() or file.suffix == ".py"
    } - {
        "__init__",
        "__pycache__",
    }
    assert {"drake_rnn.diagrams.loop", "drake_rnn.models"} <= modules


def test_no_import_hides_in_a_function_or_behind_type_checking():
    at_the_top = {id(node) for tree in trees().values() for node in tree.body}
    hidden = [
        f"{name}:{node.lineno}"
        for name, node in walk((ast.Import, ast.ImportFrom))
        if id(node) not in at_the_top
    ]
    assert not hidden


# What asks for attributes by name, and why.
DYNAMIC = {
    # Modules and exceptions of xacro.
    "drake_rnn/robot/model/xacro_process.py",
    # Copies and writes every field, whatever it is; looks into annotations, which need no classes.
    "drake_rnn/inputs/messages.py",
    "drake_rnn/inputs/packages.py",  # lends names that a stub lists, and late modules
    "drake_rnn/errors.py",  # an attribute under its old name
    "drake_rnn/inputs/fields.py",  # asks whether an object of any class has some methods
    "drake_rnn/paths/svg.py",  # makes each shape of the class of its name in svgelements
    "drake_rnn/runs/enclosure.py",  # writes what laws say of themselves, a list of names
    "drake_rnn/systems/block.py",  # what pydrake adds to its own objects, whatever these are
}


def test_attributes_are_asked_for_by_name_only_where_they_are_not_known():
    found = {
        name
        for name, call in walk(ast.Call)
        if isinstance(call.func, ast.Name) and call.func.id in {"getattr", "hasattr"}
    }
    assert found == DYNAMIC


def test_only_laws_and_claims_about_them_know_single_laws():
    classes, kinds = {law.__name__ for law in LAWS.values()}, set(LAWS)
    # A shield is made of two laws.
    public = {
        "drake_rnn/__init__.py",
        "drake_rnn/live/shielded.py",
        "drake_rnn/shield/shield.py",
        "drake_rnn/shield/tool_tracking.py",
        "drake_rnn/cli/shielding.py",
    }
    outside = {
        name: tree
        for name, tree in trees().items()
        if "/laws/" not in name and "/claims/" not in name and name not in public
    }
    named = [
        f"{name}:{node.lineno}"
        for name, tree in outside.items()
        for node in ast.walk(tree)
        if (isinstance(node, ast.Name) and node.id in classes)
        or (isinstance(node, ast.Attribute) and node.attr in classes)
        or (isinstance(node, ast.alias) and node.name in classes)
        or (isinstance(node, ast.Constant) and node.value in kinds)
    ]
    assert outside
    assert not named


#: A signature and its documentation are most of it.
ENTRY_POINTS = {"AddLoop"}


@pytest.mark.parametrize("most", [60])
def test_functions_fit_on_a_screen(most):
    long = {
        f"{name}: {function.name}"
        for name, function in walk(ast.FunctionDef)
        if function.end_lineno - function.lineno + 1 > most and function.name not in ENTRY_POINTS
    }
    assert not long


def test_all_that_is_public_is_there():
    assert sorted(set(drake_rnn.__all__)) == sorted(drake_rnn.__all__)
    assert all(hasattr(drake_rnn, name) for name in drake_rnn.__all__)


def test_docstrings_of_properties_have_no_type():
    """What stands before a colon is a type for the site, whose build ends where there is none."""
    typed = []
    for name in drake_rnn.__all__:
        public = getattr(drake_rnn, name)
        for member in filter(str.isidentifier, dir(public) if isinstance(public, type) else ()):
            found = inspect.getattr_static(public, member)
            first, *_ = (inspect.getdoc(found) or "").split("\n")
            if isinstance(found, (property, cached_property)) and not member.startswith("_"):
                typed += [f"{name}.{member}"] * (": " in re.sub("`[^`]*`", "", first))
    assert not typed


def test_the_folders_that_users_asked_for_are_rooms_of_the_package():
    for room in ("diagrams", "models"):
        link, folder = PACKAGE / room, ROOT / room
        if link.is_symlink():
            assert link.resolve() == folder
        else:
            # A source distribution holds no links, but the files twice.
            files = [file.relative_to(link) for file in link.rglob("*.yaml")]
            assert files
            assert all((link / each).read_bytes() == (folder / each).read_bytes() for each in files)


def test_files_of_tests_have_names_of_their_own():
    """Pytest, which imports them without packages, would refuse to collect two of one name."""
    names = [
        file.name for file in Path(__file__).parent.rglob("*.py") if file.name != "conftest.py"
    ]
    assert not {name for name in names if names.count(name) > 1}

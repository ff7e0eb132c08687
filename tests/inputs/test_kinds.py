"""Classes that a document names: registered, in a module, or of an installed package."""

import importlib
import subprocess
import sys

import pytest

from drake_rnn import (
    ENVIRONMENTS,
    LAWS,
    PATHS,
    ContactModel,
    InvalidInputError,
    JointLimits,
    Law,
    Layout,
    Path,
    Planar,
    Pseudoinverse,
    SampledLaw,
    load_experiment,
    make_experiment,
    validated,
)

DOCUMENT = {
    "arm": "panda",
    "path": {"kind": "circle", "size": 0.02, "period": 4},
    "law": {"kind": "pseudoinverse"},
    "period": 1e-3,
    "duration": 0.1,
}
LAW = """
from drake_rnn import JointLimits, Layout, Positive, SampledLaw, validated

@validated
class Still(SampledLaw):
    limits: JointLimits
    gain: Positive = 1.0

    @property
    def state(self):
        return Layout(v=(self.limits.size,))

    @property
    def inputs(self):
        return Layout(p_WE=(3,))

    def step(self, t, x, u, period):
        return 0.0 * x

class Group:
    Inner = Still
"""


class Bare(SampledLaw):
    state = Layout(v=(3,))
    inputs = Layout(position=(3,))

    def step(self, t, x, u, period):
        return x


@validated
class Mine(Bare):
    limits: JointLimits


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Write modules that can be imported, and forget them afterwards."""
    monkeypatch.syspath_prepend(tmp_path)
    names = []

    def write(name, text):
        file = tmp_path.joinpath(*name.split(".")).with_suffix(".py")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        names.append(name)
        importlib.invalidate_caches()

    yield write
    for name in names:
        for part in (name, name.split(".")[0]):
            sys.modules.pop(part, None)


@pytest.fixture
def package(tmp_path, module):
    """Install a package that offers a class under a name."""

    def install(package, group, name, value, text=LAW):
        module(value.split(":")[0], text)
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[drake_rnn.{group}]\n{name} = {value}\n")

    return install


def law_of(kind, **fields):
    return make_experiment({**DOCUMENT, "law": {"kind": kind, **fields}}).law


def refusal(**changes):
    with pytest.raises(InvalidInputError) as caught:
        make_experiment({**DOCUMENT, **changes})
    assert "\n" not in str(caught.value)
    return str(caught.value)


# Registered in Python.


@pytest.fixture
def forgotten():
    """What a test registers is forgotten again."""
    before = [(kinds, set(kinds)) for kinds in (LAWS, PATHS, ENVIRONMENTS)]
    yield
    for kinds, names in before:
        for added in set(kinds) - names:
            del kinds[added]


@pytest.mark.usefixtures("forgotten")
def test_a_class_may_be_registered_once_and_again_as_a_new_version_of_itself():
    LAWS["mine"] = Mine
    LAWS["mine"] = Mine
    # As when a cell of a notebook runs again.
    newer = validated(type("Mine", (Bare,), {"__module__": __name__, "__annotations__": {}}))
    LAWS["mine"] = newer
    assert LAWS["mine"] is newer
    assert "mine" in set(LAWS)
    del LAWS["mine"]
    assert "mine" not in LAWS


@pytest.mark.usefixtures("forgotten")
def test_a_name_that_is_taken_is_refused_and_stays_what_it_was():
    shipped = "drake_rnn.laws.pseudoinverse.Pseudoinverse"
    with pytest.raises(InvalidInputError) as caught:
        LAWS["pseudoinverse"] = Mine
    assert str(caught.value) == (
        f"law.kind: 'pseudoinverse' is {shipped} already; {__name__}.Mine needs another name"
    )
    LAWS["mine"] = Mine
    other = validated(type("Other", (Bare,), {"__annotations__": {}}))
    with pytest.raises(InvalidInputError, match=r"law\.kind: 'mine' is .*Mine already"):
        LAWS["mine"] = other
    assert LAWS["pseudoinverse"] is Pseudoinverse
    assert LAWS["mine"] is Mine


def test_shipped_classes_stay():
    for kinds, name in ((LAWS, "recursive"), (PATHS, "circle"), (ENVIRONMENTS, "plate")):
        with pytest.raises(InvalidInputError, match=f"'{name}' is shipped, and stays"):
            del kinds[name]


@pytest.mark.parametrize(
    ("kinds", "found", "message"),
    [
        (LAWS, Bare, "law.kind: x: Bare must be decorated with @validated from drake_rnn"),
        (LAWS, Mine(limits=JointLimits.unlimited(3)), "law.kind: x: must be a class that extends"),
        (LAWS, JointLimits, "Law, not the class drake_rnn.robot.limits.JointLimits"),
        (LAWS, None, "law.kind: x: must be a class that extends Law, not of class NoneType"),
        (LAWS, SampledLaw, "law.kind: x: SampledLaw must have inputs, state, step as well"),
        (LAWS, Law, "law.kind: x: Law must have inputs, state as well"),
        (PATHS, Mine, "path.kind: x: must be a class that extends Path, not the class"),
        (PATHS, Planar, "path.kind: x: Planar must have curve as well"),
        (ENVIRONMENTS, Mine, "environment.kind: x: must be a class that extends Surface, not"),
        (ENVIRONMENTS, ContactModel, "environment.kind: x: ContactModel must have add_to as well"),
    ],
)
def test_a_class_that_does_not_fit_is_refused_with_the_remedy(kinds, found, message):
    with pytest.raises(InvalidInputError) as caught:
        kinds["x"] = found
    assert message in str(caught.value)
    assert "x" not in kinds


@pytest.mark.parametrize("name", ["", " ", "a:b", 3, None])
def test_a_name_must_be_one(name):
    with pytest.raises(InvalidInputError, match=r"law\.kind: must be a text without a colon"):
        LAWS[name] = Mine


def test_a_subclass_whose_own_fields_are_not_checked_is_refused():
    """Pydantic would make an object of its base class."""

    class Larger(PATHS["circle"]):
        factor: float = 2.0

    with pytest.raises(InvalidInputError, match="Larger must be decorated with @validated"):
        PATHS["larger"] = Larger


# In a module.


def test_a_law_is_found_by_its_module(module):
    module("mod_law", LAW)
    law = law_of("mod_law:Still", gain=3)
    assert type(law).__name__ == "Still"
    assert law.gain == 3.0
    assert type(law_of("mod_law:Group.Inner")) is type(law)


def test_so_is_one_in_a_package_and_on_the_command_line(module):
    module("mod_package.law", LAW)
    changes = {"law": None, "law.kind": "mod_package.law:Still", "duration": 0.1}
    experiment = load_experiment("pinv_circle", {**changes, "accept": None, "window": None})
    assert type(experiment.law).__name__ == "Still"


def test_so_are_paths_and_environments(module):
    module(
        "mod_path",
        "from drake_rnn import Circle, Plate, validated\n"
        "@validated\nclass Round(Circle): pass\n"
        "@validated\nclass Table(Plate): pass\n",
    )
    path = {"kind": "mod_path:Round", "size": 0.02, "period": 4}
    assert type(make_experiment({**DOCUMENT, "path": path}).path).__name__ == "Round"
    experiment = load_experiment("contact_circle", {"environment.kind": "mod_path:Table"})
    assert type(experiment.contact.surface).__name__ == "Table"


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("mod_none:Law", "law.kind: there is no module 'mod_none' where Python looks for modules"),
        ("json.mod_none:Law", "law.kind: there is no module 'json.mod_none'"),
        ("mod_a.py:Law", "law.kind: there is no module 'mod_a.py'"),
        ("mod_a:Lw", "law.kind: the module 'mod_a' has no 'Lw'"),
        ("mod_a:Still.Lw", "law.kind: the module 'mod_a' has no 'Still.Lw'"),
        ("mod_a:", "law.kind: must be module:Class, e.g. my_package.my_law:MyLaw, not 'mod_a:'"),
        ("../mod_a:Law", "law.kind: must be module:Class"),
        ("mod_a:Still()", "law.kind: must be module:Class"),
        ("os:system", "law.kind: os:system: must be a class that extends Law, not of class builti"),
        ("mod_a:Layout", "law.kind: mod_a:Layout: must be a class that extends Law, not the class"),
        ("mod_a:SampledLaw", "law.kind: mod_a:SampledLaw: SampledLaw must have inputs, state, st"),
        ("mod_bad:Law", "law.kind: the module 'mod_bad' cannot be imported: ZeroDivisionError: d"),
        ("mod_exits:Law", "law.kind: the module 'mod_exits' cannot be imported: SystemExit: 3"),
        ("mod_needs:Law", "law.kind: the module 'mod_needs' cannot be imported: ModuleNotFoundErr"),
        ("mod_a.Still", "law.kind: no law 'mod_a.Still'; it may be"),
    ],
)
def test_a_name_that_leads_nowhere_is_refused_with_the_reason(module, kind, message):
    module("mod_a", LAW)
    module("mod_bad", "1 / 0")
    module("mod_exits", "import sys; sys.exit(3)")
    module("mod_needs", "import mod_none")
    assert refusal(law={"kind": kind}).startswith(message)


def test_a_class_that_fails_when_it_is_made_is_named(module):
    module(
        "mod_fails",
        LAW.replace("class Group:", "    def __post_init__(self): 1 / 0\n\nclass Group:"),
    )
    message = refusal(law={"kind": "mod_fails:Still"})
    assert message == "law: Still raised ZeroDivisionError: division by zero"


def test_a_law_that_nobody_knows_is_refused_with_how_to_name_one():
    """As a saved run whose law was registered in Python elsewhere."""
    message = refusal(law={"kind": "my_registered_law"})
    assert message.startswith("law.kind: no law 'my_registered_law'; ")
    assert message.endswith("; one of your own is named module:Class")


# Modules are imported only where that is allowed.


@pytest.mark.parametrize("modules", [False, (), ["mod_oth"], "mod_other"])
def test_a_module_is_not_imported_unless_that_is_allowed(module, modules):
    module("mod_secret", "raise AssertionError('imported')")
    with pytest.raises(InvalidInputError) as caught:
        make_experiment({**DOCUMENT, "law": {"kind": "mod_secret:Law"}}, modules=modules)
    assert str(caught.value) == (
        "law.kind: is in the module 'mod_secret', which is imported only when told to: give "
        "modules=['mod_secret'], or modules=True"
    )
    assert "mod_secret" not in sys.modules


@pytest.mark.parametrize("modules", [True, ["mod_package"], "mod_package", {"mod_package.law"}])
def test_a_module_may_be_allowed_by_its_name_or_its_packages(module, modules):
    module("mod_package.law", LAW)
    made = make_experiment({**DOCUMENT, "law": {"kind": "mod_package.law:Still"}}, modules=modules)
    assert type(made.law).__name__ == "Still"


def test_what_is_imported_already_may_be_used(module):
    module("mod_known", LAW)
    kind = {**DOCUMENT, "law": {"kind": "mod_known:Still"}}
    importlib.import_module("mod_known")
    assert type(make_experiment(kind, modules=False).law).__name__ == "Still"


# Of an installed package.


def test_an_installed_package_offers_a_law_which_is_loaded_when_asked_for(package):
    package("robots", "laws", "still", "mod_robots:Still")
    assert type(law_of("pseudoinverse")) is Pseudoinverse
    assert "mod_robots" not in sys.modules
    assert type(law_of("still")).__name__ == "Still"


def test_so_does_one_a_path(package):
    text = "from drake_rnn import Circle, validated\n@validated\nclass Round(Circle): pass\n"
    package("curves", "paths", "round", "mod_curves:Round", text)
    path = {"kind": "round", "size": 0.02, "period": 4}
    made = make_experiment({**DOCUMENT, "path": path}).path
    assert isinstance(made, Path)
    assert type(made).__name__ == "Round"
    assert "; nearest: round" in refusal(path={"kind": "rounds"})


def test_a_package_cannot_stand_in_for_a_shipped_law(package):
    package("robots", "laws", "pseudoinverse", "mod_robots:Still")
    assert refusal() == (
        "law.kind: 'pseudoinverse' is drake_rnn.laws.pseudoinverse.Pseudoinverse, but is also "
        "offered by the package robots as mod_robots:Still; that one needs another name"
    )
    assert "mod_robots" not in sys.modules


def test_two_packages_cannot_offer_the_same_name(package):
    package("robots", "laws", "still", "mod_robots:Still")
    package("others", "laws", "still", "mod_others:Still")
    message = refusal(law={"kind": "still"})
    assert "'still' is offered by the package" in message
    assert "robots as mod_robots:Still" in message
    assert "others as mod_others:Still" in message


def test_one_that_is_installed_later_is_found_then(package):
    package("robots", "laws", "still", "mod_robots:Still")
    assert "no law 'later'" in refusal(law={"kind": "later"})
    package("others", "laws", "later", "mod_others:Still")
    assert type(law_of("later")).__name__ == "Still"
    assert type(law_of("still")).__name__ == "Still"


@pytest.mark.usefixtures("forgotten")
def test_a_package_may_register_what_it_offers_but_nothing_else_of_that_name(package):
    package("robots", "laws", "still", "mod_robots:Still")
    LAWS["still"] = importlib.import_module("mod_robots").Still
    assert law_of("still").gain == 1.0
    del LAWS["still"]
    LAWS["still"] = Mine
    assert "Mine, but is also offered by the package robots" in refusal(law={"kind": "still"})


@pytest.mark.parametrize(
    ("value", "text", "message"),
    [
        ("mod_broken:Still", "1 / 0", "which cannot be loaded: ZeroDivisionError: division by"),
        ("mod_broken:Missing", LAW, "which cannot be loaded: AttributeError: "),
        ("mod_broken:Layout", LAW, "law.kind: mod_broken:Layout: must be a class that extends Law"),
    ],
)
def test_a_package_whose_offer_is_broken_is_named(package, value, text, message):
    package("broken", "laws", "broken_law", value, text)
    assert message in refusal(law={"kind": "broken_law"})


def test_reading_a_document_imports_nothing(tmp_path):
    """In a process of its own, in which nothing is imported yet."""
    (tmp_path / "mod_trap.py").write_text("print('imported')\n")
    (tmp_path / "trap.yaml").write_text("law: {kind: 'mod_trap:Law'}\narm: panda\nduration: 1\n")
    code = "from drake_rnn.experiment import read_document; read_document('trap.yaml')"
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert run.stdout == ""

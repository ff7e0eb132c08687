"""Which tests are to kill the mutants of a module, and which mutants no test can kill."""

from pathlib import Path

from ruamel.yaml import YAML

HERE = Path(__file__).parent
PACKAGE = HERE.parents[1] / "drake_rnn"

#: Modules of which mutants are made: what commands an arm, and what says how it went.
ROOMS = (
    "laws/**/*.py",
    "robot/limits*.py",
    "robot/jerk_*.py",
    "robot/velocity_envelope.py",
    "measures/**/*.py",
    "runs/evaluation.py",
    "runs/series.py",
    "signals.py",
)


def modules() -> list[str]:
    """Return the modules in the rooms, as paths in the package; files that only import are none."""
    files = {file for room in ROOMS for file in PACKAGE.glob(room) if file.stem != "__init__"}
    return sorted(str(file.relative_to(PACKAGE)) for file in files)


def tests_of() -> dict[str, list[str]]:
    """Return the test files of each module, as paths in the folder of tests.

    By default it is the file of the module's own name in the folder of its room.

    Raises:
        ValueError: If a module in the rooms has none, or one that is listed is not there.
    """
    table = YAML(typ="safe").load(HERE / "tests_of.yaml")
    for module in modules():
        room, name = module.split("/")[0], Path(module).stem
        own = f"{room}/test_{name}.py"
        if module not in table and (HERE.parent / own).exists():
            table[module] = [own]
    if differ := {*modules()} ^ {*table}:
        raise ValueError(
            f"tests_of.yaml: write a line for each module in the rooms without a test file of its "
            f"name, and for no other file: {', '.join(sorted(differ))}"
        )
    return table


def explained() -> dict[str, list[dict[str, str]]]:
    """Return the mutants that no test can kill: for each module, what was, what is, and why."""
    return YAML(typ="safe").load(HERE / "explained.yaml")

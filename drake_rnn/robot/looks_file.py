"""The model file whose links are drawn in place of an arm's own."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

from ..errors import InvalidInputError
from ..inputs.complaints import nearest
from ..inputs.extras import not_installed
from ..inputs.given_file import is_file

#: Name of the package of robot models, and the files in it of shipped arms, by the arm's model.
PACKAGE = "example-robot-data"
_FILES = {
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
}
# Where the package lies in a folder of installed packages.
_ROBOTS = Path("cmeel.prefix/share/example-robot-data/robots")
# What simplifies meshes.
_SIMPLIFIER = "fast_simplification"


def looks_file(looks: str | None, model: Path) -> tuple[Path | None, str]:
    """Return the model file that ``arm.looks`` names, and a warning if it cannot be used.

    Args:
        looks: Name of a model file or of the package; None for the arm's own looks.
        model: The arm's own model file.

    Returns:
        The file, or None for the arm's own looks; and the warning, empty if there is none.

    Raises:
        InvalidInputError: If there is no such file, or the package has no such arm.
    """
    if looks is None:
        return None, ""
    if looks != PACKAGE:
        if not is_file(looks):
            raise InvalidInputError(
                f"arm.looks: no file {looks!r}; it may be {PACKAGE}, or a URDF file of the arm"
            )
        found: Path | None = Path(looks)
    elif model.stem not in _FILES:
        hint = nearest(model.stem, sorted(_FILES))
        raise InvalidInputError(
            f"arm.looks: {PACKAGE} has no {model.stem}; {hint}, or give a URDF file of the arm"
        )
    else:
        places = (Path(folder) / _ROBOTS / _FILES[model.stem] for folder in sys.path)
        found = next((file for file in places if file.is_file()), None)
    missing = PACKAGE if found is None else _SIMPLIFIER if find_spec(_SIMPLIFIER) is None else ""
    if missing:
        return None, (
            not_installed("arm.looks", "looks", missing)
            + "; the arm is drawn as its own model says"
        )
    return found, ""

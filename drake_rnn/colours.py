"""The colours of playbacks, figures and pages: what means the same has one colour everywhere.

Blue and vermilion are of Okabe and Ito. What means something is told apart, and stands out from the
arm, a surface and paper, also for people who see no red or no green: `tests/test_colours.py`.
"""

from __future__ import annotations

#: The path that the end effector should follow.
DESIRED = "#0072B2"
#: The path that it followed.
TRACED = "#D55E00"
#: A posture that should be reached.
TARGET = "#6200CC"
#: A force on the tool.
FORCE = "#008060"
#: A limit that must not be exceeded; on a dark ground light, `BOUND_ON_DARK`.
BOUND, BOUND_ON_DARK = "#222222", "#E8E8E8"
#: The sign and the words of a bound that is broken, and of one that is kept; never without either.
BROKEN, BROKEN_ON_DARK = "#AD1F14", "#FF8A7A"
MET, MET_ON_DARK = "#12692F", "#6FD08C"
#: Errors, norms and other curves without a meaning of their own; the first of several.
CURVE, CURVE_ON_DARK = "#4A4A4A", "#C9D1DB"
#: Joints and other curves that are told apart by number, by people who see no red or no green as
#: well. None is close to the colour of a meaning.
SERIES = ("#663300", "#CC88EE", "#DDAA44", "#443388", "#00C4B4", "#889966", "#006677")
SERIES_ON_DARK = ("#E0915A", "#CC88EE", "#DDAA44", "#9C8CF0", "#00C4B4", "#A9BD80", "#4FB3C8")
#: Values along a path, from the least to the largest: lighter is more. None looks like `DESIRED`.
SCALE = ("#2B0B57", "#6F196E", "#B0315B", "#E55C30", "#FCA108", "#F1EF75")
#: The arm, muted so that none of its parts looks like a path, and what it presses on.
ARM, SURFACE = "#C9CDD2", "#EFE8D8"
#: A second arm, by which its pale parts are tinted.
SECOND = "#DAE6CC"
#: What the arm's distances are measured from.
CAPSULE = "#4F5A66"
#: Beside the arm's own: of its dark and of its white parts.
ARM_DARK, ARM_LIGHT = "#8E959D", "#E9EBED"


def components(colour: str) -> tuple[float, float, float]:
    """Return red, green and blue of a colour such as ``#0072B2``, each from 0 to 1."""
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue

"""What each command may be asked: its options, and its help; a file for each kind of command."""

from .looking_up import (
    List as List,
    Show as Show,
    Arms as Arms,
    Laws as Laws,
    Paths as Paths,
    Arm as Arm,
    New as New,
    PrintSchema as PrintSchema,
)
from .running import (
    Run as Run,
    Live as Live,
    Fastest as Fastest,
    Sweep as Sweep,
    Campaign as Campaign,
    Tune as Tune,
    Compare as Compare,
)
from .results import (
    Figure as Figure,
    Plot as Plot,
    Replay as Replay,
    Export as Export,
    Film as Film,
)
from .robots import Drive as Drive, ServeRobot as ServeRobot
from .claims import ShowClaims as ShowClaims, Report as Report

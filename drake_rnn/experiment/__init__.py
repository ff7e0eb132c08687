"""An experiment: the document that describes it, and the objects made from it."""

from .components import Arms as Arms
from .files import (
    parse_change as parse_change,
    require_apart as require_apart,
    require_distinct as require_distinct,
    require_none_lost as require_none_lost,
    set_key as set_key,
)
from .document import (
    Acceptance as Acceptance,
    ExperimentDocument as ExperimentDocument,
    IntegratorSettings as IntegratorSettings,
    document_class as document_class,
)
from .experiment import (
    COUNTED_LIMITS as COUNTED_LIMITS,
    EXCESS_RATIO as EXCESS_RATIO,
    CountedLimit as CountedLimit,
    expected_bounds as expected_bounds,
)
from .experiment import torque_share_bound as torque_share_bound
from .experiment import Experiment as Experiment, make_experiment as make_experiment
from ..features.feature import Guarantee as Guarantee, Guarantees as Guarantees
from .files import (
    ExperimentSource as ExperimentSource,
    load_experiment as load_experiment,
    read_document as read_document,
    shipped_experiments as shipped_experiments,
)
from .keys import (
    key_meanings as key_meanings,
    section_meanings as section_meanings,
    unit_of_key as unit_of_key,
)
from ..features.planning import (
    Goal as Goal,
    MotionPlan as MotionPlan,
    plan_motion as plan_motion,
    watch_planning as watch_planning,
)
from .experiment import (
    MISS as MISS,
    Forecast as Forecast,
    Reach as Reach,
    check_reach as check_reach,
    follow as follow,
    forecasts as forecasts,
)
from .sections import Sections as Sections, read_sections as read_sections

"""What a law declares and returns, checked, with errors that name the law and the part."""

from __future__ import annotations

from collections.abc import Mapping, Set
from math import isfinite
from numbers import Integral, Real
from types import MethodType

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import require_type, short
from ..inputs.fields import Array
from ..inputs.own_code import naming
from .law import Circumstances, ContinuousReading, JointPreview, Law, Reading, SampledReading
from .layout import Layout, Signals

#: Names of recorded series and of ports, which parts of a state and observables must not have.
RECORDED = frozenset(
    {
        *("time", "state", "commanded_velocity", "position", "velocity", "network_velocity"),
        *("acceleration", "acceleration_peak"),
        *("network_acceleration", "network_acceleration_peak"),
        *("p_WE", "v_WE", "p_WE_desired", "v_WE_desired", "J", "joint_error", "orientation_error"),
        *("position_measured", "velocity_measured"),
        *("p_WE_measured", "v_WE_measured", "R_WE_measured"),
        *("normal_force", "normal_force_desired", "normal_force_measured", "contact_force"),
        # Arguments of the function that saves the series.
        *("file", "allow_pickle"),
    }
)

_FLOAT = np.dtype(float)


def sampled_reading(law: Law, period: float) -> SampledReading:
    """Return the law's reading at a fixed period, with all that it declares checked.

    Args:
        law: The law.
        period: Sampling period [s].

    Raises:
        InvalidInputError: If the law cannot be sampled at this period, or declares what is wrong.
    """
    check_declared(law)
    with naming(f"{_class(law)}.sampled"):
        reading = law.sampled(period)
    require_type(f"{_class(law)}.sampled()", reading, SampledReading)
    check_layouts(reading)
    return reading


def continuous_reading(law: Law) -> ContinuousReading:
    """Return the reading of a law that Drake integrates, with all that it declares checked.

    Args:
        law: The law.

    Raises:
        InvalidInputError: If the law is not a differential equation, or declares what is wrong.
    """
    check_declared(law)
    with naming(f"{_class(law)}.continuous"):
        reading = law.continuous()
    require_type(f"{_class(law)}.continuous()", reading, ContinuousReading)
    check_layouts(reading)
    return reading


def check_declared(law: Law) -> None:
    """Raise an InvalidInputError if what a law declares is of another kind than it must be."""
    name = _class(law)
    check_layouts(law)
    with naming(f"{name}.loop_gains"):
        gains = law.loop_gains
    require_type(f"{name}.loop_gains", gains, Mapping)
    for key, gain in gains.items():
        if isinstance(gain, bool) or not (isinstance(gain, Real) and 0 <= gain < np.inf):
            raise InvalidInputError(
                f"{name}.loop_gains[{key!r}]: must be a number of at least 0, not {short(gain)}"
            )
    with naming(f"{name}.joint_preview"):
        preview = law.joint_preview
    if preview is not None:
        require_type(f"{name}.joint_preview", preview, JointPreview)
        _check_preview(f"{name}.joint_preview", preview)
    for part, value in (
        ("stays_on_path", law.stays_on_path),
        ("levels_are_derivatives", law.levels_are_derivatives),
    ):
        require_type(f"{name}.{part}", value, bool)
    with naming(f"{name}.limits_remedy"):
        require_type(f"{name}.limits_remedy", law.limits_remedy, str)


def _check_preview(place: str, preview: JointPreview) -> None:
    if not (isinstance(preview.interval, Real) and 0 < preview.interval < np.inf):
        raise InvalidInputError(
            f"{place}.interval: must be a positive time [s], not {short(preview.interval)}"
        )
    if not (isinstance(preview.count, Integral) and preview.count >= 1):
        raise InvalidInputError(
            f"{place}.count: must be a whole number of at least 1, not {short(preview.count)}"
        )


def check_layouts(reading: Reading) -> None:
    """Raise an InvalidInputError if the layouts of a law or reading cannot be run or recorded."""
    name = _class(reading)
    with naming(f"{name}.state"):
        state = reading.state
    with naming(f"{name}.inputs"):
        inputs = reading.inputs
    with naming(f"{name}.observables"):
        observables = reading.observables
    for part, layout in (("state", state), ("inputs", inputs), ("observables", observables)):
        if isinstance(layout, MethodType):
            raise InvalidInputError(f"{name}.{part}: is a method; decorate it with @property")
        require_type(f"{name}.{part}", layout, Layout)
    joints = _joints(f"{name}.state", state)
    _require_free(f"{name}.state", state, RECORDED)
    _require_free(f"{name}.observables", observables, RECORDED | state.parts.keys())
    for part in inputs.parts.keys() & {"J", "J_omega"}:
        (_, shape) = inputs.parts[part]
        if len(shape) != 2 or shape[1] != joints:
            raise InvalidInputError(
                f"{name}.inputs: {part} must have one column for each of {joints} joints, shape "
                f"(rows, {joints}), not {shape}"
            )
    with naming(f"{name}.integration_scheme"):
        require_type(f"{name}.integration_scheme", reading.integration_scheme, str)


def _joints(place: str, state: Layout) -> int:
    """Return the number of joints that a state commands."""
    if "v" not in state:
        parts = ", ".join(state.parts) or "no parts"
        raise InvalidInputError(
            f"{place}: must have the part v, the joint velocities that it commands; it has {parts}"
        )
    (_, shape) = state.parts["v"]
    if len(shape) != 1:
        raise InvalidInputError(f"{place}: its part v must have the shape (joints,), not {shape}")
    return shape[0]


def _require_free(place: str, layout: Layout, taken: Set[str]) -> None:
    for part in layout.parts:
        if part in taken:
            raise InvalidInputError(f"{place}: {part!r} is the name of another recorded signal")


def doubts_of(law: Law, circumstances: Circumstances) -> list[str]:
    """Return the law's warnings before a run.

    Args:
        law: The law.
        circumstances: Properties of the loop that the law is to run in.

    Raises:
        InvalidInputError: If the law cannot run in these circumstances, or returns something else.
    """
    with naming(f"{_class(law)}.doubts"):
        return _texts(f"{_class(law)}.doubts", law.doubts(circumstances))


def caveats_of(reading: Reading, metrics: Mapping[str, float]) -> list[str]:
    """Return the warnings of a law's reading after a run.

    Args:
        reading: The reading.
        metrics: Metrics of the run by name.

    Raises:
        InvalidInputError: If it returns something else.
    """
    with naming(f"{_class(reading)}.caveats"):
        return _texts(f"{_class(reading)}.caveats", reading.caveats(metrics))


def _texts(place: str, value: object) -> list[str]:
    if isinstance(value, list) and all(isinstance(text, str) for text in value):
        return value
    raise InvalidInputError(f"{place}: must return a list of texts, not {short(value)}")


def is_sound(value: Array, shape: tuple[int, ...]) -> bool:
    """Return whether a vector that a law has returned is an array of this shape, and finite.

    This is run at every sample and may, for a rare value, be wrong about what is sound: where it
    denies, `flaw` and `is_finite` decide.
    """
    return (
        type(value) is np.ndarray
        and value.dtype is _FLOAT
        and value.shape == shape
        # For a few entries faster than NumPy.
        and isfinite(sum(value.tolist()))
    )


def flaw(value: object, shape: tuple[int, ...]) -> str:
    """Return what a value must be, and what it is; an empty text if it is what it must be.

    Args:
        value: What the law has returned.
        shape: Shape that it must have.
    """
    wanted = f"a NumPy array of floats, shape {shape}"
    if not isinstance(value, np.ndarray):
        return f"{wanted}, not {'None' if value is None else 'a ' + type(value).__name__}"
    if value.shape != shape:
        return f"{wanted}, not {value.shape}"
    if value.dtype != _FLOAT:
        return f"{wanted}, not of {value.dtype}"
    return "" if type(value) is np.ndarray else f"{wanted}, not a {type(value).__name__}"


def is_finite(value: Array) -> bool:
    """Return whether all entries of an array are finite, however large their sum."""
    return bool(np.isfinite(value).all())


def observables_of(reading: Reading, t: float | Array, x: Array, u: Signals) -> Signals:
    """Return the law's observables by name, checked, of one instant or of many.

    Args:
        reading: Reading of the law.
        t: Time, a number or shape (k,) [s].
        x: State, shape (size,) or (k, size).
        u: Signals; of many instants with a leading dimension of k.

    Raises:
        InvalidInputError: If the law fails, or returns other names or shapes than it declares.
    """
    place, lead = f"{_class(reading)}.diagnostics", x.shape[:-1]
    many = f" for {lead[0]} instants at once" if lead else ""
    with naming(f"{place}{many}"):
        told = reading.diagnostics(t, x, u)
    if not isinstance(told, Mapping):
        raise InvalidInputError(f"{place}: must return a mapping of names to arrays{_not(told)}")
    declared = reading.observables.parts
    if told.keys() != declared.keys():
        raise InvalidInputError(
            f"{place}: must return its observables, {', '.join(declared) or 'none'}; it returns "
            f"{', '.join(map(str, told)) or 'none'}"
        )
    for name, (_, shape) in declared.items():
        value = told[name]
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
            raise InvalidInputError(f"{place}: {name} must be an array of numbers{_not(value)}")
        if value.shape != lead + shape:
            raise InvalidInputError(
                f"{place}: {name} must have the shape {lead + shape}{many}, not {value.shape}"
            )
    return told


def _not(value: object) -> str:
    return f", not {short(value)}"


def _class(law: object) -> str:
    return type(law).__name__

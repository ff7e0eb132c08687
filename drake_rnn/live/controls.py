"""What a page may set: controls by name, each of which checks what it is given."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import short
from ..inputs.fields import rows_of_numbers
from ..inputs.numbers import is_number


@dataclass(frozen=True)
class Control(ABC):
    """A control.

    Attributes:
        label: What the page calls it.
    """

    label: str

    #: What it is to the page.
    kind = ""

    @abstractmethod
    def read(self, value: Any) -> Any:
        """Return what a value from outside means.

        Raises:
            ValueError: If it is no value of this control; the message says what it must be.
        """

    def set(self, value: Any) -> Control:
        """Return the control with a value that `read` has returned."""
        return self

    def as_data(self) -> dict[str, Any]:
        """Return the control as the page reads it."""
        return {"kind": self.kind, "label": self.label}


@dataclass(frozen=True)
class Slider(Control):
    """A number between two ends, on a logarithmic scale.

    Attributes:
        low, high: The ends, greater than 0.
        value: What it is.
        unit: SI unit.
    """

    low: float
    high: float
    value: float
    unit: str = ""

    kind = "slider"

    def read(self, value: Any) -> float:
        """See `Control.read`; a number beyond an end is that end."""
        if not is_number(value):
            raise ValueError("must be a finite number")
        return float(min(max(float(value), self.low), self.high))

    def set(self, value: Any) -> Slider:
        """See `Control.set`."""
        return replace(self, value=value)

    def as_data(self) -> dict[str, Any]:
        """See `Control.as_data`."""
        numbers = {"low": self.low, "high": self.high, "value": self.value, "unit": self.unit}
        return super().as_data() | numbers


@dataclass(frozen=True)
class Switch(Control):
    """What is on or off.

    Attributes:
        value: Whether it is on.
    """

    value: bool

    kind = "switch"

    def read(self, value: Any) -> bool:
        """See `Control.read`."""
        if not isinstance(value, bool):
            raise ValueError("must be true or false")
        return value

    def set(self, value: Any) -> Switch:
        """See `Control.set`."""
        return replace(self, value=value)

    def as_data(self) -> dict[str, Any]:
        """See `Control.as_data`."""
        return super().as_data() | {"value": self.value}


@dataclass(frozen=True)
class Choice(Control):
    """One of several names.

    Attributes:
        options: The names.
        value: The one that is chosen.
    """

    options: tuple[str, ...]
    value: str

    kind = "choice"

    def read(self, value: Any) -> str:
        """See `Control.read`."""
        if not isinstance(value, str) or value not in self.options:
            raise ValueError(f"may be {', '.join(self.options)}")
        return value

    def set(self, value: Any) -> Choice:
        """See `Control.set`."""
        return replace(self, value=value)

    def as_data(self) -> dict[str, Any]:
        """See `Control.as_data`."""
        return super().as_data() | {"options": list(self.options), "value": self.value}


@dataclass(frozen=True)
class Button(Control):
    """What is pressed."""

    kind = "button"

    def read(self, value: Any) -> None:
        """See `Control.read`; it takes no value."""
        if value is not None:
            raise ValueError("takes no value; give null")


@dataclass(frozen=True)
class Handle(Control):
    """A point that is dragged.

    Attributes:
        center: Middle of the ball within which it may be dragged [m].
        radius: Radius of that ball [m].
        place: Scene path of what is dragged.
    """

    center: tuple[float, float, float]
    radius: float
    place: str

    kind = "handle"

    def read(self, value: Any) -> Any:
        """See `Control.read`; a point beyond the ball is the nearest one of it."""
        rows = rows_of_numbers([value], 3)
        if rows is None:
            raise ValueError("must be three finite numbers")
        middle = np.array(self.center)
        away = rows[0] - middle
        # A number may be so large that its square is none.
        size = float(np.abs(away).max()) or 1.0
        length = size * float(np.linalg.norm(away / size))
        return middle + away * min(1.0, self.radius / length) if length else middle

    def as_data(self) -> dict[str, Any]:
        """See `Control.as_data`."""
        return super().as_data() | {"place": self.place}


def read_message(controls: Mapping[str, Control], name: Any, value: Any) -> Any:
    """Return what a message from outside sets a control to.

    Raises:
        InvalidInputError: If there is no such control, or it does not take this value.
    """
    if not isinstance(name, str) or name not in controls:
        raise InvalidInputError(f"{short(name)}: there is no such control")
    try:
        return controls[name].read(value)
    except OverflowError:
        raise InvalidInputError(f"{name}: must be a finite number, not {short(value)}") from None
    except ValueError as error:
        raise InvalidInputError(f"{name}: {error}, not {short(value)}") from None

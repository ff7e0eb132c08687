r"""The design formula of zeroing networks: how an error E that should vanish changes.

.. math::
    \dot E = -\gamma \Phi(E) + \Delta, \qquad
    \text{noise-tolerant:} \quad
    \dot E = -\eta \Phi(E) - \gamma \Phi(E + \eta \Phi(z)) + \Delta, \quad \dot z = E,

with a noise Delta. If Phi is linear, the second is
:math:`\dot E = -(\eta + \gamma) E - \gamma \eta z + \Delta`, whose integral takes a constant noise
back; the first one leaves :math:`\Delta / \gamma`.

Sources:
    The first formula is that of all zeroing networks. The second was read in public code that
    names Jin, Zhang, Li, Zhang, "Modified ZNN for time-varying quadratic programming with inherent
    tolerance to noises and its application to kinematic redundancy resolution of robot
    manipulators", IEEE Transactions on Industrial Electronics 63 (2016).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ...arrays.algebra import functions_of
from ...arrays.substeps import Parts, repeated
from ...inputs.fields import Array
from .activations import Activation

# Rounds that find an error; each halves the bracket at least, and mostly a few are made.
_ROUNDS = 64
# How far an error may be off, as a share of what is known.
_NARROW = 1e-15


class Design(NamedTuple):
    """The design formula.

    Attributes:
        activation: The function Phi.
        integral: The gain eta of the noise-tolerant formula [1/s]; 0 for the plain one.
    """

    activation: Activation
    integral: Any

    def rate(self, E: Array, z: Array | None, gain: Any) -> Array:
        """Return the rate of the error without noise, shape (..., k).

        Args:
            E: The error, shape (..., k).
            z: Its integral, of the same shape; None without one.
            gain: The gain gamma [1/s].
        """
        phi = self.activation
        if z is None:
            return -gain * phi(E)
        eta = self.integral
        return -eta * phi(E) - gain * phi(E + eta * phi(z))

    def after(self, E: Array, z: Array | None, gain: Any, noise: Any, h: float) -> Array:
        """Return the error a time h later by Euler's implicit method, shape (..., k).

        It solves e = E + h (rate(e, z + h e) + noise), which increases with e and so has one
        solution, at any gain.

        Args:
            E: The error, shape (..., k).
            z: Its integral, of the same shape; None without one.
            gain: The gain gamma at the end of that time [1/s].
            noise: The noise Delta, shape (..., k), or a number.
            h: The time [s].
        """
        known, eta = E + h * noise, self.integral
        if not self.activation.is_linear:
            return self._found(known, z, gain, h)
        if z is None:
            return known / (1.0 + h * gain)
        return (known - h * gain * eta * z) / (1.0 + h * (eta + gain * (1.0 + h * eta)))

    def _found(self, known: Array, z: Array | None, gain: Any, h: float) -> Array:
        """Return where e - h rate(e, z + h e) is ``known``, by secants within a bracket."""
        xp = functions_of(known)

        def short(e: Array) -> Array:
            return e - h * self.rate(e, None if z is None else z + h * e, gain) - known

        at_zero = short(0.0 * known)
        # The slope is 1 or more, so the solution is between 0 and -at_zero.
        end = -at_zero
        size = xp.abs(known) + xp.abs(end)

        def advance(parts: Parts) -> Parts:
            *found, done = parts
            a, b, f_a, f_b = found
            spread = f_b - f_a
            secant = a - f_a * (b - a) / xp.where(spread == 0.0, 1.0, spread)
            inside = (xp.minimum(a, b) <= secant) & (secant <= xp.maximum(a, b))
            e = xp.where(inside, secant, 0.5 * (a + b))
            a, b, f_a, f_b = _narrowed(xp, (a, b, f_a, f_b), e, short(e))
            e = 0.5 * (a + b)
            after = _narrowed(xp, (a, b, f_a, f_b), e, short(e))
            # What is done stays as it is, whatever other entries need.
            kept = [xp.where(done, old, new) for old, new in zip(found, after, strict=True)]
            width = xp.abs(kept[1] - kept[0])
            least = xp.minimum(xp.abs(kept[2]), xp.abs(kept[3]))
            # The slope is 1 or more: an end is no farther from the solution than it is short.
            return *kept, done | (xp.minimum(width, least) <= _NARROW * size)

        start = (0.0 * known, end, at_zero, short(end), size == 0.0)
        a, b, f_a, f_b, _ = repeated(advance, start, _ROUNDS)
        return xp.where(xp.abs(f_b) <= xp.abs(f_a), b, a)


def _narrowed(xp: Any, bracket: Parts, e: Array, f: Array) -> Parts:
    """Return a bracket (a, b, f_a, f_b) whose end of the sign of f is moved to e."""
    a, b, f_a, f_b = bracket
    on_a = (f > 0.0) == (f_a > 0.0)
    return (
        xp.where(on_a, e, a),
        xp.where(on_a, b, e),
        xp.where(on_a, f, f_a),
        xp.where(on_a, f_b, f),
    )

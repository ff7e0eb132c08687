"""Print the tables of simultaneous learning and control as Markdown; `make tables` runs this.

The paper is Liu, Fan, Zheng, Li, Jin, "A simultaneous learning and control scheme for redundant
manipulators with physical constraints on decision variable and its derivative", IEEE Transactions
on Industrial Electronics 69 (2022).
"""

from functools import cache

import numpy as np

from drake_rnn import Result, load_experiment, simulate
from markdown_table import broken_limits, head, row

RINGS = (
    "slc_four_ring",
    "slc_four_ring_fast",
    "slc_four_ring_noise_dynamic",
    "slc_four_ring_dynamic",
    "slc_four_ring_fast_dynamic",
)
#: Time constants of the learning; the paper's is 1e-6.
RHOS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
#: Standard deviations of the noise that moves an arm with motors [rad/s].
SIGMAS = (1e-3, 3e-3, 5e-3, 1e-2, 3e-2)
SHORT = {"duration": 3, "window": (1, 3), "accept": None}
# Driven signal of our schemes, an experiment of each, and one with full dynamics.
SCHEMES = {
    "RNN (16)": ("velocity", "slc_nephroid_unbounded", None),
    "RNN (19)": ("velocity", "slc_nephroid_known", "slc_nephroid_dynamic"),
    "RNN (20), virtual noise": ("velocity", "slc_nephroid_virtual", None),
    "RNN (20), actuated noise": ("velocity", "slc_nephroid", "slc_four_ring_noise_dynamic"),
    "RNN (20), warm-up": ("velocity", "slc_nephroid_warm_up", "slc_four_ring_dynamic"),
    "joint-drift-free, NALJDF": ("acceleration", "naljdf_clover", "naljdf_clover_dynamic"),
    "motion-force, RNN (22)": ("velocity", "motion_force_tricuspid_learned", None),
}
# What the paper's text says of cited schemes; the cells of its table are lost.
QUOTED = {
    "RNN (20), in the paper": ("velocity", "yes", "yes", "on a Panda: 1e-3"),
    "its [13], [31]": ("velocity", "yes", "no", "no"),
    "its [11], [12]": ("acceleration", "", "no", ""),
    "its [15], [32]": ("", "no", "yes", ""),
}
_STRUCTURE = {"J", "J_omega", "Jdot_v", "M", "bias", "gravity"}


@cache
def run(name: str, *changes: tuple[str, object]) -> Result:
    """Return the result of an experiment with some keys changed; each run is simulated once."""
    return simulate(load_experiment(name, {"accept": None, **dict(changes)}))


def rings_table() -> None:
    """Print the metrics of the four-rings."""
    columns = {
        "error max [m]": "position_error_max_m",
        "rms [m]": "position_error_rms_m",
        "acceleration of the arm [rad/s^2]": "joint_acceleration_max_rad_s2",
        "of the network": "network_acceleration_max_rad_s2",
        "drift [rad]": "joint_drift_max_rad",
        "back at its start to [m]": "end_effector_drift_end_m",
        "J_hat: error": "jacobian_error_median",
        "along the motion": "jacobian_error_excited_median",
    }
    head("`drake-rnn run ...`", *columns, "network at its bound [share of samples]")
    for name in RINGS:
        result = run(name)
        arm = result.metrics["joint_acceleration_max_rad_s2"]
        figures = (result.metrics.get(metric, arm) for metric in columns.values())
        row(f"`{name}`", *(f"{figure:.3g}" for figure in figures), f"{share_at_bound(result):.2g}")


def share_at_bound(result: Result) -> float:
    """Return the share of stored samples in which the network's acceleration is at its bound."""
    largest = np.abs(result.series["network_acceleration"]).max(axis=1)
    return float(np.mean(largest > 0.999 * result.experiment.limits.acceleration.min()))


def noise_table() -> None:
    """Print what noise does to an arm with motors."""
    head("sigma [rad/s]", "error max [m]", "acceleration of the arm [rad/s^2]", "J_hat: error")
    names = ("position_error_max_m", "joint_acceleration_max_rad_s2", "jacobian_error_median")
    for sigma in SIGMAS:
        metrics = run("slc_four_ring_noise_dynamic", ("dither.sigma", sigma)).metrics
        row(f"{sigma:g}", *(f"{metrics[name]:.2g}" for name in names))


def rho_table() -> None:
    """Print the error of J_hat at several time constants of the learning."""
    head("rho [rad^2/s]", "J_hat: error", "along the motion")
    names = ("jacobian_error_median", "jacobian_error_excited_median")
    for rho in RHOS:
        metrics = run("slc_nephroid_virtual", *SHORT.items(), ("law.rho", rho)).metrics
        row(f"{rho:g}", *(f"{metrics[name]:.2g}" for name in names))


def traits_table() -> None:
    """Print Table I for the schemes here, then what the text says of the paper's and cited ones."""
    head(
        "scheme",
        "driven signal",
        "limits kept by construction",
        "broken in a run by",
        "derivative bounded",
        "unknown parameters",
        "with full dynamics: error [m]",
    )
    for scheme, (driven, name, dynamic) in SCHEMES.items():
        row(scheme, driven, *traits(name, driven), errors(dynamic))
    for scheme, (driven, bounded, unknown, verified) in QUOTED.items():
        row(scheme, driven, "", "", bounded, unknown, verified)


def traits(name: str, driven: str) -> tuple[str, str, str, str]:
    """Return what a short run, and the inputs and limits of a law, say of it."""
    result = run(name, *SHORT.items())
    law = result.experiment.law
    # Rounding errors do not count as violations.
    metrics = {key: value for key, value in result.metrics.items() if abs(value) > 1e-9}
    broken = broken_limits(metrics)
    limit = {"velocity": "acceleration", "acceleration": "jerk"}[driven]
    bounded = "yes" if limit in law.keeps and limit not in broken else "no"
    seen = ", ".join(sorted(_STRUCTURE & set(law.inputs.parts)))
    return ", ".join(law.keeps) or "none", broken, bounded, f"no: sees {seen}" if seen else "yes"


def errors(dynamic: str | None) -> str:
    """Return the largest error of a run with full dynamics, as text."""
    if dynamic is None:
        return "not run"
    return f"{run(dynamic).metrics['position_error_max_m']:.2g} (`{dynamic}`)"


if __name__ == "__main__":
    rings_table()
    noise_table()
    rho_table()
    traits_table()

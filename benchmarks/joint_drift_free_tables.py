"""Print the tables of joint-drift-free motion as Markdown; `make tables` runs this.

The paper is Jin, Xie, Liu, Ke, Li, Yang, "Novel joint-drift-free scheme at acceleration level for
robotic redundancy resolution with tracking error theoretically eliminated", IEEE/ASME
Transactions on Mechatronics (2020). Its MPE and MVE are the largest position and velocity errors,
computed here per component; its JD is the mean of |q(T) - q(0)|. All other errors are norms.
"""

from functools import cache

import numpy as np

from drake_rnn import Result, load_experiment, shipped_experiments, simulate
from markdown_table import head, row

LAMBDAS = [0.1, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 50.0, 100.0]
# MPE [m], MVE [m/s] and JD [rad] of the paper's Table I, lambda by lambda.
PAPER = {
    "galjdf": [
        (5.14e-5, 1.68e-4, 5.37e-2),
        (2.77e-4, 2.45e-4, 9.10e-3),
        (5.59e-4, 4.54e-4, 2.80e-3),
        (1.10e-3, 9.44e-4, 1.60e-3),
        (1.70e-3, 1.30e-3, 6.84e-4),
        (2.80e-3, 2.20e-3, 3.74e-4),
        (5.50e-3, 4.40e-3, 6.37e-4),
        (2.46e-2, 1.91e-2, 2.80e-3),
        (4.42e-2, 3.27e-2, 5.20e-3),
    ],
    "naljdf": [
        (4.06e-5, 1.06e-4, 5.37e-2),
        (4.46e-5, 1.70e-4, 9.10e-3),
        (4.43e-5, 1.09e-4, 2.90e-3),
        (4.41e-5, 1.62e-4, 1.62e-3),
        (4.41e-5, 1.01e-4, 7.26e-4),
        (4.41e-5, 1.05e-4, 1.38e-4),
        (4.42e-5, 1.10e-4, 1.03e-4),
        (4.41e-5, 1.31e-4, 2.57e-4),
        (4.42e-5, 1.27e-4, 2.75e-4),
    ],
}
# Schemes, and an experiment for each.
SCHEMES = {
    "MAN": "man_clover",
    "GALJDF": "galjdf_clover",
    "NALJDF": "naljdf_clover",
    "MOALJDF, printed": "moaljdf_parallelogram_printed",
    "MOALJDF, corrected": "moaljdf_parallelogram",
}
# The paper's Table II, with the columns of `traits_table`.
QUOTED = {
    "GALJDF, in the paper": ("acceleration", "yes", "yes", "yes", "non-zero", "no", "non-zero"),
    "NALJDF, in the paper": ("acceleration", "yes", "yes", "yes", "zero", "yes", "zero"),
    "its [12] to [15]": ("acceleration", "yes", "no", "yes", "non-zero", "no", "non-zero"),
    "its [25]": ("velocity", "yes", "no", "yes", "non-zero", "no", "non-zero"),
    "its [26], [27]": ("velocity", "yes", "no", "no", "non-zero", "no", "non-zero"),
    "its [28]": ("velocity", "yes", "yes", "yes", "non-zero", "no", "non-zero"),
}
# The motion is repetitive if the joint drift is below this share of that at lambda = 0.
RETURNS = 0.1
# An error is compensated if less than this share of it is left at the end of the run.
COMPENSATED = 0.5
# Errors are decoupled if lambda = 100 multiplies those at lambda = 1 by less than this.
DECOUPLED = 2.0
# Acceleration bound as a share of the largest acceleration without it, to make it active.
TIGHT = 0.8


@cache
def run(name: str, *changes: tuple[str, float]) -> Result:
    """Return the result of an experiment with some keys changed; each run is simulated once."""
    return simulate(load_experiment(name, {"accept": None, **dict(changes)}))


def lambda_table(suffix: str) -> None:
    """Print the paper's Table I beside ``galjdf_<suffix>`` and ``naljdf_<suffix>``."""
    columns = {
        "MPE [m]": "position_error_component_max_m",
        "MVE [m/s]": "velocity_error_component_max_m_s",
        "JD [rad]": "joint_drift_mean_rad",
    }
    heads = [f"{column}{where}" for column in columns for where in (", paper", ", here")]
    head(f"`*_{suffix}`", "lambda", *heads)
    for scheme, printed in PAPER.items():
        for weight, figures in zip(LAMBDAS, printed, strict=True):
            found = run(f"{scheme}_{suffix}", ("law.return_weight", weight)).metrics
            cells = []
            for metric, figure in zip(columns.values(), figures, strict=True):
                cells += [f"{figure:.2e}", f"{found[metric]:.2e}"]
            row(scheme.upper(), f"{weight:g}", *cells)


def experiments_table(names: list[str]) -> None:
    """Print the metrics of the experiments side by side."""
    columns = {
        "position error [m]": ("position_error_max_m", "{:.2g}"),
        "velocity error [m/s]": ("velocity_error_max_m_s", "{:.2g}"),
        "drift, mean [rad]": ("joint_drift_mean_rad", "{:.2g}"),
        "drift, largest [rad]": ("joint_drift_max_rad", "{:.2g}"),
        "largest acceleration [rad/s^2]": ("joint_acceleration_max_rad_s2", "{:.3g}"),
        "cut to its bound [share of steps]": ("saturated_fraction", "{:.2g}"),
        "smallest singular value": ("singular_value_min", "{:.3g}"),
    }
    head("`drake-rnn run ...`", *columns)
    for name in names:
        found = run(name).metrics
        row(f"`{name}`", *(form.format(found[metric]) for metric, form in columns.values()))


def traits_table() -> None:
    """Print Table II for the schemes here, then the paper's rows for its own and cited schemes."""
    head(
        "scheme",
        "level",
        "repetitive motion",
        "error compensation",
        "acceleration limit",
        "joint drift",
        "error decoupling",
        "tracking error",
    )
    for scheme, name in SCHEMES.items():
        row(scheme, *traits(name))
    for method, cells in QUOTED.items():
        row(method, *cells)


def traits(name: str) -> list[str]:
    """Return a row of Table II, from runs of an experiment as it is and with changed keys."""
    plain = run(name)
    found = plain.metrics
    drift = found["joint_drift_mean_rad"]
    without = run(name, ("law.return_weight", 0.0)).metrics["joint_drift_mean_rad"]
    # Start 1 mm off the path; subtract the plain run's own error from what is left.
    off = position_error(run(name, ("path.offset", (0.0, 1e-3, 0.0)))) - position_error(plain)
    kept = np.linalg.norm(off[-1]) / np.linalg.norm(off[0])
    bound = TIGHT * found["joint_acceleration_max_rad_s2"]
    bounded = run(name, ("limits.acceleration", bound))
    violated = bounded.metrics["acceleration_violation_max_rad_s2"]
    decoupled = "nothing to decouple"
    if name != SCHEMES["MAN"]:
        light, heavy = (
            run(name, ("law.return_weight", weight)).metrics["position_error_max_m"]
            for weight in (1.0, 100.0)
        )
        decoupled = f"{answer(heavy < DECOUPLED * light)}: x {heavy / light:.3g} with lambda x 100"
    return [
        "acceleration",
        f"{answer(drift < RETURNS * without)}: {drift / without:.2g} of the drift at lambda 0",
        f"{answer(kept < COMPENSATED)}: {100 * kept:.2g} % of 1 mm left",
        # Rounding errors do not count as violations.
        f"{answer(violated < 1e-9)}: {violated:.0e} beyond",
        f"{drift:.1e} rad",
        decoupled,
        f"{found['position_error_max_m']:.1e} m",
    ]


def position_error(result: Result) -> np.ndarray:
    return result.series["p_WE"] - result.series["p_WE_desired"]


def answer(holds: bool) -> str:
    return "yes" if holds else "no"


if __name__ == "__main__":
    shipped = shipped_experiments()
    lambda_table("clover")
    lambda_table("table1")
    laws = [name for name in shipped if "aljdf_" in name or name.startswith("man_")]
    experiments_table(laws)
    traits_table()

"""Print the tables of motion-force control as Markdown; `make tables` runs this.

The paper is "Data-driven motion-force control scheme for redundant manipulators: a kinematic
perspective".
"""

import numpy as np

from drake_rnn import Result, SimulationError, load_experiment, simulate
from markdown_table import broken_limits, head, row

KINEMATIC = (
    "motion_force_tricuspid",
    "motion_force_tricuspid_literal",
    "motion_force_tricuspid_w",
    "motion_force_tricuspid_learned",
    "motion_force_tricuspid_printed",
    "motion_force_tricuspid_wholly_printed",
    "motion_force_cat",
    "motion_force_cat_return",
)
CONTACT = (
    "contact_circle",
    "contact_circle_1N",
    "contact_circle_20N",
    "contact_deltoid",
    "contact_deltoid_fast",
    "contact_inclined",
    "contact_panda_light",
    "contact_soft_pad",
    "contact_cat",
    "contact_cat_learned",
    "contact_cat_learned_pen",
    "contact_noisy",
    "contact_wrong_normal",
    "contact_open_loop",
)
# Runs of a whole lap, to see how the joints return.
LAPS = (
    "motion_force_tricuspid",
    "motion_force_tricuspid_w",
    "motion_force_tricuspid_learned",
    "motion_force_tricuspid_printed",
    "motion_force_cat",
    "motion_force_cat_return",
    "contact_cat",
    "contact_cat_learned",
    "contact_cat_learned_pen",
)
# The paper's physical experiment: what is compared, the metric, and the paper's figure.
PHYSICAL = (
    ("aside, largest [m]", "lateral_error_max_m", "2e-3"),
    ("force error, largest [N]", "force_error_max_N", "1e-2"),
    ("force error, rms [N]", "force_error_rms_N", ""),
    ("force, largest at the start [N]", "normal_force_peak_N", ""),
    ("95 % of the force after [s]", "force_rise_time_s", ""),
    ("turned, largest [rad]", "orientation_error_max_rad", "unchanged"),
    ("joints off their start after the lap [rad]", "lap_drift_max_rad", ""),
    ("J_hat: error, median", "jacobian_error_median", ""),
    ("joint acceleration, largest [rad/s^2]", "joint_acceleration_max_rad_s2", "smooth"),
    ("joint jerk over 10 ms, rms [rad/s^3]", "joint_jerk_rms_rad_s3", "smooth"),
)
ELSEWHERE = ("slc_nephroid", "null_space_adjustment", "naljdf_clover")
FORCES, GAPS = (1.0, 5.0, 20.0), (0.0, 5e-3)
# Stiffness in the law, and how the desired force rises.
STARTS = {
    "learned, prior 10 kN/m at 5 N": {},
    "the same, prior 10 times too stiff": {"law.stiffness.initial": 1e5},
    "the same, prior 3 times too soft": {"law.stiffness.initial": 3e3},
    "the same, prior 10 times too soft": {"law.stiffness.initial": 1e3},
    "the same, force risen in 1 s": {"law.stiffness.initial": 1e3, "force.rise_time": 1.0},
    "learned as a spring (exponent 1)": {"law.stiffness.exponent": 1},
    "8 kN/m": {"law.stiffness": 8000},
}
ERRORS = ("mean", "rms", "max")


def figure(result: Result, name: str) -> str:
    """Return a metric with two digits, or an empty text if it does not apply."""
    return f"{result.metrics[name]:.2g}" if name in result.metrics else ""


def runs_table(names: tuple[str, ...]) -> None:
    """Print the errors of each experiment in its window."""
    jacobian = "J_hat: error, largest"
    columns = ("mean [N]", "rms [N]", "largest [N]", "aside [m]", "turned [rad]", jacobian)
    columns = (*columns, "joint velocity, largest [rad/s]", "bounds broken by")
    head("`drake-rnn run ...`", *columns, "sensor off by, largest [N]")
    for name in names:
        result = simulate(load_experiment(name))
        metrics = (
            *(f"force_error_{error}_N" for error in ERRORS),
            "lateral_error_max_m",
            "orientation_error_max_rad",
            "jacobian_error_max",
            "joint_velocity_max_rad_s",
        )
        figures = (figure(result, metric) for metric in metrics)
        row(f"`{name}`", *figures, broken_limits(result.metrics), sensor_error(result))


def sensor_error(result: Result) -> str:
    """Return the largest difference of measured and true force in the window [N], as text."""
    begin, end = result.experiment.document.window
    inside = (result.time > begin) & (result.time <= end)
    told, true = (result.series[f"normal_force{name}"][inside] for name in ("_measured", ""))
    return f"{np.abs(told - true).max():.1g}"


def start_up_table() -> None:
    """Print the largest force during the start-up, divided by the desired force."""
    places = [(force, gap) for gap in GAPS for force in FORCES]
    head("stiffness", *(f"{force:g} N, from {gap * 1e3:g} mm" for force, gap in places))
    for label, changes in STARTS.items():
        cells = []
        for force, gap in places:
            document = {**changes, "force.value": force, "environment.gap": gap}
            document |= {"duration": 4, "window": [3, 4], "accept": None}
            cells.append(start_up(document, force))
        row(label, *cells)


def start_up(changes: dict[str, object], force: float) -> str:
    """Return peak force divided by desired force, and the time after which it stays above 95 %."""
    try:
        result = simulate(load_experiment("contact_approach", changes))
    except SimulationError as error:
        return f"stops at {error.time:.2g} s"
    low = np.flatnonzero(result.series["normal_force"] < 0.95 * force)
    settled = result.time[low[-1]] if low.size else 0.0
    reached = f"{settled:.1f} s" if settled < 3.9 else "later than 4 s"
    return f"{result.metrics['normal_force_peak_N'] / force:.2f} ({reached})"


def learning_rates_table(experiment: str) -> None:
    """Print the numbers of the paper's Fig. 2."""
    head("rho", "J_hat: error, largest", "median", "along the motion", "force, largest [N]")
    for rho in load_experiment(experiment).document.over["law.rho"]:
        result = simulate(load_experiment(experiment, {"law.rho": rho}))
        names = ("jacobian_error_max", "jacobian_error_median", "jacobian_error_excited_median")
        row(f"{rho:g}", *(figure(result, name) for name in (*names, "force_error_max_N")))


def physical_table() -> None:
    """Print the figures of the paper's physical experiment beside those of two runs."""
    names = ("contact_cat_learned", "contact_cat_learned_pen")
    results = [simulate(load_experiment(name)) for name in names]
    head("", "paper", *(f"`{name}`" for name in names))
    for label, metric, said in PHYSICAL:
        row(label, said, *(figure(result, metric) for result in results))


def laps_table() -> None:
    """Print how far the joints are from their start after a lap."""
    head("`drake-rnn run ...`", "joints off their start [rad]")
    for name in LAPS:
        row(f"`{name}`", figure(simulate(load_experiment(name)), "lap_drift_max_rad"))


def features_table() -> None:
    """Print Table I: inputs and properties of the laws here, then the paper's rows for others.

    The available text of the paper lacks the table: the last rows follow the section about it.
    """
    columns = ("force", "knows J", "learns J", "holds the orientation", "joint limits", "level")
    head("controller", *columns)
    for name in ("motion_force_tricuspid", "motion_force_tricuspid_learned", "contact_soft_pad"):
        result = simulate(load_experiment(name, {"duration": 2, "window": None, "accept": None}))
        law = result.experiment.law
        turned = result.metrics["orientation_error_max_rad"]
        row(
            f"`{name}`",
            "measured" if "normal_force" in law.inputs else "assumed",
            "yes" if "J" in law.inputs else "no (position), yes (rotation)",
            "yes" if "J_hat" in law.state else "no",
            f"to {turned:.1g} rad",
            "kept" if broken_limits(result.metrics) == "none" else "broken",
            result.experiment.document.level,
        )
    row("[9], [18], [19] in the paper", "yes", "yes", "no", "", "", "")
    row("[8] in the paper", "yes", "", "yes", "", "", "dynamic")
    row("[4], [17] in the paper", "no", "", "", "", "", "")
    row("[10] in the paper", "no", "no", "yes", "", "", "")


def elsewhere_table() -> None:
    """Print the errors of laws made for the kinematic level on an arm with full dynamics."""
    head("law", "arm", "error, kinematic [m]", "error, dynamic [m]", "speed, largest [rad/s]")
    for name in ELSEWHERE:
        dynamic = simulate(load_experiment(f"{name}_dynamic"))
        kinematic = simulate(load_experiment("slc_nephroid_known" if "slc" in name else name))
        errors = (figure(run, "position_error_max_m") for run in (kinematic, dynamic))
        arm = dynamic.experiment.arm.name
        row(f"`{name}_dynamic`", arm, *errors, figure(dynamic, "joint_velocity_max_rad_s"))


if __name__ == "__main__":
    runs_table(KINEMATIC)
    learning_rates_table("motion_force_learning_rates")
    learning_rates_table("motion_force_learning_rates_paper")
    runs_table(CONTACT)
    physical_table()
    laps_table()
    start_up_table()
    elsewhere_table()
    features_table()

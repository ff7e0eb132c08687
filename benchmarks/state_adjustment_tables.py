"""Print the tables of state adjustment as Markdown; `make tables` runs this.

The paper is Jin, He, Huang, Wang, "Recurrent neural network for state adjustment of redundant
manipulators", IEEE Access 8 (2020); Table 3 is empty in the available text.
"""

from drake_rnn import Result, load_experiment, simulate
from markdown_table import broken_limits, head, row

CASES = {
    "1 (r 4, T 3)": "modified_state_adjustment",
    "2 (r 8, T 3)": "modified_state_adjustment_case2",
    "3 (r 4, T 5)": "modified_state_adjustment_case3",
}
# |q(T) - q_d| [rad] of joints 1 to 7.
PAPER = {
    "1 (r 4, T 3)": [
        *(1.289461e-5, 1.177066e-5, 4.891301e-6, 1.499467e-5),
        *(4.350270e-5, 3.934844e-5, 4.115238e-5),
    ],
    "2 (r 8, T 3)": [
        *(5.007557e-8, 9.679112e-8, 3.814844e-8, 2.349258e-7),
        *(9.339705e-9, 1.783016e-7, 1.185032e-8),
    ],
}
EXPERIMENTS = [
    "state_adjustment",
    *CASES.values(),
    "ramped_adjustment",
    "null_space_adjustment",
]
ARMS = {
    "iiwa14": "modified_state_adjustment",
    "panda": "modified_state_adjustment_panda",
    "ur5": "modified_state_adjustment_ur5",
    "planar6": "modified_state_adjustment_planar6",
}
# Changes to an experiment of MSA that give each law.
LAWS = {
    "SA": {"law.rise_time": None},
    "MSA": {},
    "ramped": {"law.rise_time": None, "law.ramp_time": 0.75},
    "null space": {
        "law.kind": "null_space_adjustment",
        "law.rise_time": None,
        "law.ramp_time": 0.75,
        "period": 1e-3,
    },
}


def joint_tables(results: dict[str, Result]) -> None:
    """Print the paper's Tables 1 to 3."""
    head("case", "", *(f"joint {k}" for k in range(1, 8)))
    for case, name in CASES.items():
        if case in PAPER:
            row(case, "paper", *(f"{error:.3e}" for error in PAPER[case]))
        errors = abs(results[name].series["joint_error"][-1])
        row(case, "here", *(f"{error:.3e}" for error in errors))


def experiments_table(results: dict[str, Result]) -> None:
    """Print the metrics of the experiments side by side."""
    columns = {
        "error [rad]": ("joint_error_max_rad", "{:.2g}"),
        "within 0.01 rad [s]": ("joint_settling_time_s", "{:.2f}"),
        "drift, largest [m]": ("end_effector_drift_max_m", "{:.2g}"),
        "drift, end [m]": ("end_effector_drift_end_m", "{:.1g}"),
        "first step: speed [rad/s]": ("joint_velocity_initial_rad_s", "{:.2g}"),
        "acceleration [rad/s^2]": ("joint_acceleration_initial_rad_s2", "{:.2g}"),
        "largest speed [rad/s]": ("joint_velocity_max_rad_s", "{:.2f}"),
        "largest acceleration [rad/s^2]": ("joint_acceleration_max_rad_s2", "{:.3g}"),
    }
    head("`drake-rnn run ...`", *columns)
    for name, result in results.items():
        found = result.metrics
        row(f"`{name}`", *(form.format(found[metric]) for metric, form in columns.values()))


def arms_table() -> None:
    """Print the metrics of every law on every arm."""
    head(
        "arm",
        "law",
        "error [rad]",
        "drift, largest [m]",
        "drift, end [m]",
        "bounds broken by",
    )
    for arm, name in ARMS.items():
        for law, changes in LAWS.items():
            found = simulate(load_experiment(name, {"accept": None, **changes})).metrics
            row(
                arm,
                law,
                f"{found['joint_error_max_rad']:.2g}",
                f"{found['end_effector_drift_max_m']:.2g}",
                f"{found['end_effector_drift_end_m']:.1g}",
                broken_limits(found),
            )


if __name__ == "__main__":
    results = {name: simulate(load_experiment(name)) for name in EXPERIMENTS}
    joint_tables(results)
    experiments_table(results)
    arms_table()

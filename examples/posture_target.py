"""Move to another posture while the end effector stays: find a target, then run."""

from drake_rnn import SelfMotion, load_arm, make_experiment, simulate

arm = load_arm("panda")
motion = SelfMotion(arm, arm.home)
print("free dimensions:", motion.free_dimensions)

wanted = arm.home + 0.3
print(f"wanted: moves the end effector by {motion.distance(wanted):.3f} m")
target = motion.towards(wanted)
print(f"next to it: by {motion.distance(target):.1e} m, {abs(target - wanted).max():.3f} rad off")

result = simulate(
    make_experiment(
        {
            "arm": "panda",
            "law": {"kind": "null_space_adjustment", "target": target.tolist()},
            "period": 1e-3,
            "duration": 3,
        }
    )
)
print("joints off by", result.metrics["joint_error_max_rad"], "rad at the end")
print("the end effector moved by at most", result.metrics["end_effector_drift_max_m"], "m")

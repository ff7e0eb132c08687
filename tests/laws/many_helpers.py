"""Laws, and states and signals of many robots at random, for tests of leading axes."""

from contextlib import suppress

import numpy as np
from law_defaults import numbers_of, with_defaults

from drake_rnn import LAWS as SHIPPED
from drake_rnn import (
    Adaptive,
    ContactLoss,
    InvalidInputError,
    JointDriftFree,
    JointLimits,
    JointStream,
    JointTorque,
    MotionForce,
    NullSpaceAdjustment,
    Objective,
    OnlineStiffness,
    Projection,
    Pseudoinverse,
    Recursive,
    SimultaneousLearning,
    StateAdjustment,
    WarmUp,
    Zeroing,
    validated,
)

N = 7
LIMITS = JointLimits(
    position_lower=np.array([-2.9, -1.8, -2.9, -3.1, -2.9, 0.0, -np.inf]),
    position_upper=np.array([2.9, 1.8, 2.9, -0.1, 2.9, 3.8, np.inf]),
    velocity=np.array([2.2, 2.2, 2.2, 2.2, 2.6, 2.6, 2.6]),
    acceleration=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    jerk=np.full(N, 5000.0),
    snap=np.full(N, 1e6),
    crackle=np.full(N, 1e8),
)
HOME = np.array([0.0, 0.3, 0.1, -1.8, 0.2, 2.0, 0.5])
PERIOD = 1e-3


def slc(**options):
    return SimultaneousLearning(limits=LIMITS, home=HOME, **options)


def drift_free(scheme, **options):
    return JointDriftFree(scheme=scheme, limits=LIMITS, home=HOME, **options)


def pressing(**options):
    return MotionForce(limits=LIMITS, **{"stiffness": 8000.0, **options})


def zeroing(**options):
    return Zeroing(limits=LIMITS, home=HOME, **options)


def projection(**options):
    return Projection(limits=LIMITS, home=HOME, **options)


def torques(**options):
    return JointTorque(limits=LIMITS, home=HOME, torque_limits=np.full(N, 80.0), **options)


def adaptive(**options):
    """The law `adaptive`; without a bound on the jerk or an envelope, unless it is given."""
    limits = LIMITS.replace(jerk=options.pop("jerk", None), **options.pop("envelope", {}))
    return Adaptive(limits=limits, home=HOME, **options)


def stream(**options):
    """The law `joint_stream`, likewise."""
    limits = LIMITS.replace(jerk=options.pop("jerk", None), **options.pop("envelope", {}))
    return JointStream(limits=limits, home=HOME, **options)


ALL_TERMS = {
    "posture": 0.7,
    "target": HOME + 0.1,
    "limits": 2.0,
    "limits_zone": 0.5,
    "manipulability": 0.5,
    "low_acceleration": 0.1,
}


@validated
class Centred(Objective):
    """An objective of a user's own, of many robots: a pull to where all joints are 0."""

    weight: float = 0.5
    takes_many = True

    def velocity(self, moment):
        return -self.weight * moment.q - 0.1 * moment.u["velocity"]

    @property
    def inputs(self):
        return {"velocity": (N,)}


RETREAT = ContactLoss(reaction="retreat", patience=0.01)
ENVELOPE = {"envelope_offset": 0.3, "envelope_deceleration": 4.0}
FIVE = [100.0, 1e2, 2e2, 2e2, 2e2]
FILTERS = {"reading": "filters", "time_constants": [1e-2, 0.9, 0.8, 0.7, 0.7]}

LAWS = {
    "adaptive": adaptive(kappa=80.0),
    "adaptive_learned": adaptive(
        jacobian="learned", kappa=80.0, wander=0.5, variance=2e-5, softness=2e-6
    ),
    "adaptive_pose": adaptive(task_size=6, secondary=ALL_TERMS),
    "adaptive_pose_learned": adaptive(task_size=6, jacobian="learned"),
    "adaptive_jerk": adaptive(jerk=500.0, kappa=80.0),
    "adaptive_jerk_learned": adaptive(jerk=500.0, jacobian="learned"),
    "adaptive_envelope": adaptive(jerk=500.0, envelope=ENVELOPE),
    "adaptive_terms": adaptive(secondary=ALL_TERMS),
    "adaptive_objective": adaptive(secondary={"objectives": [Centred(), Centred(weight=0.2)]}),
    # A softness of which a thousandth, along the normal, lets rounding errors be.
    "adaptive_force": adaptive(
        task_size=6,
        softness=1e-3,
        force_control={
            "stiffness": OnlineStiffness(),
            "approach_speed": 0.05,
            "contact_loss": RETREAT,
        },
    ),
    "adaptive_force_xyz": adaptive(softness=1e-3, force_control={"stiffness": 8000.0}),
    "adaptive_late": adaptive(
        jacobian="learned", measurement={"error": 1e-6, "delay": 2e-3, "secant_samples": 3}
    ),
    "adaptive_pose_late": adaptive(task_size=6, measurement={"delay": 2e-3}),
    "adaptive_pixels": adaptive(
        jacobian="learned", points=2, task_size=4, measurement={"error": 1e-4}
    ),
    "slc_known": slc(jacobian="known"),
    "slc_learned": slc(),
    "slc_warm_up": slc(warm_up=WarmUp()),
    "slc_known_warm_up": slc(jacobian="known", warm_up=WarmUp()),
    "slc_slow_feedback": slc(jacobian="known", feedback_limit=0.05),
    "slc_per_joint": slc(jacobian="known", acceleration_bound="per_joint", limit_stiffness=9.0),
    "slc_unbounded": slc(jacobian="known", acceleration_bound="none"),
    "slc_printed": slc(multiplier_limit="none", position_bound="printed", substeps=2),
    "man": drift_free("man"),
    "galjdf": drift_free("galjdf", composite_gain=2.0),
    "naljdf": drift_free("naljdf"),
    "naljdf_all": drift_free("naljdf", bounds="all"),
    "naljdf_measured": drift_free("naljdf", velocity="measured"),
    "moaljdf": drift_free("moaljdf", alpha=0.99),
    "moaljdf_printed": drift_free("moaljdf_printed"),
    "joint_torque": torques(gain=1e4),
    "joint_torque_bounds": torques(network="lvi", torque_weight=0.3, bounds="joints", gain=1e4),
    "joint_torque_none": torques(network="none", torque_weight=0.0, excitation=0.1),
    "joint_torque_learned": torques(mass="learned", gain=1e4),
    "pseudoinverse": Pseudoinverse(limits=LIMITS),
    "pseudoinverse_plain": Pseudoinverse(limits=LIMITS, feed_forward=False),
    "pseudoinverse_pose": Pseudoinverse(limits=LIMITS, task_size=6),
    "rnn": Recursive(limits=LIMITS, gains=[30.0]),
    "recursive": Recursive(limits=LIMITS, gains=FIVE),
    "recursive_filters": Recursive(limits=LIMITS, gains=FIVE, **FILTERS),
    "joint_stream": stream(),
    "joint_stream_interval": stream(interval=0.05),
    "joint_stream_jerk": stream(jerk=500.0, interval=0.05, timeout=0.3),
    "joint_stream_envelope": stream(jerk=500.0, envelope=ENVELOPE),
    "motion_force": pressing(),
    "motion_force_return": pressing(jacobian="learned", return_gain=0.5, home=HOME),
    "motion_force_printed": pressing(jacobian="printed", orientation="printed"),
    "motion_force_literal": pressing(stiffness=5.0, form="literal", force_feedback="assumed"),
    "motion_force_contact": pressing(
        stiffness=OnlineStiffness(), approach_speed=0.05, contact_loss=RETREAT
    ),
    "motion_force_hold": pressing(contact_loss=ContactLoss(), multiplier_limit="none"),
    "sa": StateAdjustment(target=HOME, limits=LIMITS),
    "msa": StateAdjustment(target=HOME, limits=LIMITS, rise_time=1.0),
    "sa_ramped": StateAdjustment(target=HOME, limits=LIMITS, ramp_time=1.0, task_size=6),
    "nsa": NullSpaceAdjustment(target=HOME, limits=LIMITS),
    "nsa_pose": NullSpaceAdjustment(target=HOME, limits=LIMITS, task_size=6, feedback=2.0),
    "projection": projection(gain=1e4),
    "projection_dual": projection(network="dual", bounds="velocity", gain=1e4),
    "projection_simplified": projection(
        network="simplified_lvi", task_size=6, bounds="velocity", gain=1e4
    ),
    "projection_simplified_dual": projection(
        network="simplified_dual", bounds="velocity", gain=1e4
    ),
    "projection_euler": projection(network="dual", discretization="euler", gain=50.0),
    "projection_iterated": projection(discretization="iterated", bounds="velocity"),
    "projection_learned": projection(jacobian="learned", gain=1e4, wander=0.5, variance=2e-5),
    "zeroing": zeroing(),
    "zeroing_bounds": zeroing(
        bounds="velocity",
        activation="power_sigmoid",
        integral_gain=50.0,
        noise={"kind": "random"},
    ),
    "zeroing_learned": zeroing(jacobian="learned"),
    "zeroing_largest": zeroing(cost="largest_velocity", bounds="velocity"),
    "zeroing_energy": zeroing(cost="kinetic_energy"),
    "zeroing_manipulability": zeroing(manipulability=0.5, task_size=6),
    "zeroing_prescribed": zeroing(prescribed={"start": 20.0, "end": 5.0}),
    "zeroing_explicit": zeroing(
        task_size=6,
        discretization="four_step",
        growth="exponential",
        activation="sign_bi_power",
        noise={"kind": "sine"},
    ),
}
# A law that no case above shows: with its defaults.
LAWS |= with_defaults(LIMITS, HOME, {type(law) for law in LAWS.values()}, many=True)
#: Gains that may differ from robot to robot, by law.
GAINS = {
    "adaptive": ("kappa", "braking", "feedback_limit", "home", "limits.acceleration"),
    "adaptive_learned": ("kappa", "wander", "variance", "softness", "limits.velocity"),
    "adaptive_pose": ("lever", "turn_braking", "turn_limit", "secondary.limits_zone"),
    "adaptive_jerk": ("kappa", "limits.jerk", "limits.acceleration", "limits.position_upper"),
    "adaptive_envelope": ("limits.envelope_offset", "limits.envelope_deceleration"),
    "adaptive_terms": (
        "secondary.posture",
        "secondary.target",
        "secondary.limits",
        "secondary.manipulability",
        "secondary.low_acceleration",
    ),
    "adaptive_objective": ("secondary.objectives.0.weight", "secondary.limits"),
    "adaptive_force": (
        "force_control.approach_speed",
        "force_control.stiffness.initial",
        "braking",
    ),
    "adaptive_force_xyz": ("force_control.gain", "force_control.stiffness", "softness"),
    "slc_known": ("kappa", "rate", "return_gain", "home", "limits.velocity"),
    "slc_learned": ("kappa", "rho", "limit_stiffness", "limits.acceleration"),
    "slc_warm_up": ("kappa", "warm_up.acceleration", "warm_up.rho"),
    "slc_known_warm_up": ("warm_up.pulse",),
    "slc_slow_feedback": ("feedback_limit", "multiplier_limit", "limits.position_upper"),
    "slc_unbounded": ("kappa", "limits.position_lower"),
    "galjdf": ("composite_gain", "return_weight", "task_beta", "home"),
    "naljdf": ("return_gamma", "velocity_gain", "rate", "damping", "limits.acceleration"),
    "naljdf_all": ("position_gain", "limits.velocity"),
    "moaljdf": ("alpha", "return_beta"),
    "pseudoinverse_pose": ("feedback", "damping"),
    "rnn": ("gains", "limit_stiffness"),
    "recursive": ("gains", "limits.velocity", "limits.snap"),
    "recursive_filters": ("gains", "time_constants"),
    "sa": ("rate", "time_constant", "target"),
    "msa": ("rise_time", "limits.velocity"),
    "sa_ramped": ("ramp_time",),
    "nsa": ("feedback", "rate", "target"),
    "projection": ("gain", "return_gain", "feedback", "home", "damping"),
    "projection_dual": ("gain", "limit_stiffness", "limits.velocity"),
    "projection_simplified": ("gain", "feedback"),
    "projection_simplified_dual": ("gain", "damping", "limits.velocity"),
    "projection_iterated": ("damping", "feedback"),
    "projection_learned": ("gain", "wander", "variance"),
    "zeroing": ("gain", "return_gain", "feedback", "home"),
    "zeroing_bounds": ("gain", "integral_gain", "limit_stiffness", "limits.velocity", "noise.size"),
    "zeroing_learned": ("gain", "return_gain", "feedback"),
    "zeroing_largest": ("gain", "return_gain", "blend"),
    "zeroing_energy": ("gain", "return_gain"),
    "zeroing_manipulability": ("gain", "return_gain", "manipulability"),
    "zeroing_prescribed": ("gain", "return_gain", "prescribed.end", "limits.velocity"),
    "zeroing_explicit": ("gain", "growth_rate", "feedback"),
    "nsa_pose": ("ramp_time", "damping", "limits.position_upper"),
    "joint_stream": ("timeout", "limits.velocity"),
    "joint_stream_interval": ("interval", "timeout", "limits.acceleration"),
    "joint_stream_jerk": ("interval", "limits.jerk", "limits.position_upper"),
    "motion_force": ("gain", "stiffness", "orientation_gain", "time_constant", "multiplier_limit"),
    "motion_force_return": ("return_gain", "rho", "home"),
    "motion_force_literal": ("stiffness", "limit_stiffness"),
    "motion_force_contact": (
        "approach_speed",
        "stiffness.initial",
        "stiffness.forgetting",
        "contact_loss.floor",
        "contact_loss.retreat_speed",
    ),
}
# Of a law that no case above shows, all.
GAINS |= {kind: numbers_of(LAWS[kind]) for kind in SHIPPED.keys() & LAWS.keys() - GAINS.keys()}


def readings(law):
    """Return the name of the method that steps each reading of a law, and the reading."""
    found = {"step": law.sampled(PERIOD)}
    with suppress(InvalidInputError):
        found["derivatives"] = law.continuous()
    return found


def moment(method):
    """Return the arguments of a method after time, state and signals."""
    return (PERIOD,) if method == "step" else ()


def orientations(rng, count):
    """Return random rotation matrices, shape (count, 3, 3)."""
    Q, R = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    Q = Q * np.sign(np.einsum("kii->ki", R))[:, np.newaxis, :]
    return Q * np.sign(np.linalg.det(Q))[:, np.newaxis, np.newaxis]


_SIZES = {"J": 0.5, "J_omega": 0.7, "p_WE": 0.3, "position": 1.0, "Jdot_v": 0.1}


def signals(layout, rng, count):
    """Return random signals of the size of an arm's, each of shape (count, ...)."""
    u = {}
    for name, (_, shape) in layout.parts.items():
        if name.startswith("R_"):
            u[name] = orientations(rng, count)
        else:
            u[name] = _SIZES.get(name, 0.3) * rng.normal(size=(count, *shape))
    if "position" in u:
        # Some joints are close to a limit, or beyond.
        u["position"] += HOME
    if "M" in u:
        u["M"] = np.einsum("...ij,...kj->...ik", u["M"], u["M"]) + 0.5 * np.eye(N)
    if "J" not in u:
        _rest_targets(u)
    if "normal_force_desired" in u:
        u["normal_force_desired"] = 0.5 + np.abs(u["normal_force_desired"])
    if "normal_WE" in u:
        u["normal_WE"] /= np.linalg.norm(u["normal_WE"], axis=-1, keepdims=True)
    return u


def _rest_targets(u):
    """Let the targets of some robots rest, on which progress depends while J is learned."""
    for name in u.keys() & {"p_preview", "R_preview"}:
        u[name][::4] = u[name.replace("preview", "WE_desired")][::4]


def states(reading, rng, count):
    """Return random states, shape (count, state.size); some robots of a `TwoStep` just begin."""
    x = rng.normal(size=(count, reading.state.size))
    for name, size in (("multipliers", 8.0), ("slope", 5.0)):
        if name in reading.state:
            x[:, reading.state.parts[name][0]] *= size
    if "commanded" in reading.state:
        x = _moving(reading.state, x, rng)
    if "since" in reading.state:
        x[:, reading.state.parts["since"][0]] = np.where(rng.random((count, 1)) < 0.3, -1.0, 0.299)
    if "contact" in reading.state:
        phases = rng.integers(0, 3, size=count)
        x[:, reading.state.parts["contact"][0]] = np.stack(
            (phases, 0.02 * rng.random(count), 0.04 * rng.random(count)), axis=-1
        )
    if "stiffness" in reading.state:
        last = np.where(rng.random(count) < 0.3, -1.0, 1.0 + rng.random(count))
        x[:, reading.state.parts["stiffness"][0]] = np.stack(
            (1e3 * (1.0 + rng.random(count)), rng.random(count), last, 1e-5 * rng.random(count)),
            axis=-1,
        )
    return x


def _moving(layout, x, rng):
    """States of `adaptive`: joints within their limits, fast and slow, and what it has learned."""
    v, a = 0.5 * LIMITS.velocity, 0.5 * LIMITS.acceleration
    lead = x.shape[:1]
    q = HOME + 0.3 * rng.normal(size=(*lead, N))
    values = {"commanded": q, "v": v * rng.uniform(-1, 1, (*lead, N))}
    A = rng.normal(size=(*lead, N, N))
    values |= {
        "a": a * rng.uniform(-1, 1, (*lead, N)),
        "covariance": 0.1 * A @ A.swapaxes(-1, -2),
        "R_before": orientations(rng, lead[0])[:, np.newaxis],
        "q_late": q[:, np.newaxis],
        "q_before": q[:, np.newaxis],
    }
    if "progress" in layout:
        values["progress"] = abs(layout.part(x, "progress")) % 1.0
    known = {name: value for name, value in values.items() if name in layout}
    shapes = {name: (*lead, *layout.parts[name][1]) for name in known}
    return layout.with_parts(x, **{n: np.broadcast_to(v, shapes[n]) for n, v in known.items()})


def row(values, k):
    """Return what belongs to one robot."""
    return {name: value[k] for name, value in values.items()}

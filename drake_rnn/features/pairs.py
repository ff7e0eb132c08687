"""Which features, laws and hosts cannot be combined, and why: one table.

`PAIRS` is asked first, before anything of an experiment is made, and by `drake_rnn.AddLoop`; hosts
other than a diagram (a batch, a compiled law, a live page, a driven robot) ask it for themselves.
The page docs/compatibility.md is made from it. A row that is missing here is refused nowhere.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from ..errors import InvalidInputError
from ..inputs.keys import LISTED as LISTED
from ..laws import LAWS, Law, PostureLaw
from ..systems import BODIES, Body
from ..systems.body import NO_FORCE
from .base import SEEN
from .camera import ToolCamera
from .feature import Feature
from .joint_noise import JointNoise
from .sensing import SensingSettings

#: Where an experiment may run besides a diagram that is simulated.
Host = Literal[
    "diagram", "simulate", "compiled law", "law in C", "fastest", "batch", "compiled run",
    "compiled step", "live", "switch", "drive", "paced drive",
]  # fmt: skip


def _following() -> str:
    """Return the kinds of laws that follow joint targets."""
    return ", ".join(name for name, law in LAWS.items() if law.follows_joint_targets)


def _objective_kinds() -> str:
    """Return the kinds of laws that follow objectives."""
    return ", ".join(name for name, law in LAWS.items() if law.follows_objectives)


@dataclass(frozen=True)
class Combination:
    """What is combined: sections of a document or arguments of a loop, with law and host.

    Attributes:
        host: Where it is to run.
        documented: Whether it comes from a document, not from a call of `drake_rnn.AddLoop`.
        level: Class of the body.
        drive: Drive of the mobile base that carries the arm; empty without a base.
        plant: Whether settings of the plant are given.
        task: Task of the end effector; `LISTED` for a list of objectives.
        ranges, weights: Whether objectives have ranges, and weights other than 1.
        frames: Whether objectives are about other frames of two tools.
        pair: Whether the arm has two tools.
        feedback: Arm that the law sees.
        period: Sampling period [s]; None for a law that Drake integrates.
        kind: Class of the law; None as long as it is not known.
        law: The law; None as long as it is not known.
        law_keys: Section of the law in a document.
        robot: Name of the robot that is driven.
        camera, faults, dither, disturbance, sensing: Sections or arguments of these names; None
            for what is left out.
        filter, precompensate, delay_desired: Whether there is a filter, and what it does besides.
        environment, force, sensor: Whether there is a surface, a desired force, a force sensor.
        admittance, moving_surface: Whether the path gives way to the force, and whether the surface
            moves.
        obstacles, moving: Whether there is a list of obstacles, and whether one of them may move.
        detour: Whether an arm that is stuck before them goes round.
        safety, collisions: Whether there is a safety filter, and whether it avoids collisions.
        second, follows: Whether there is a second arm, and whether its path goes along with the
            first one's tool.
        path, targets, goal: Whether a path, joint targets, or a goal are given.
        one_goal, goals: Whether it is the key of one goal that is given, or that of several.
        handling: Whether something is attached or released at goals.
        on_unreachable: What to do about a path or posture out of reach.
        further: Features without a field here; each is a trait of its key's name.
    """

    host: Host = "diagram"
    documented: bool = True
    level: type[Body] = BODIES["kinematic"]
    drive: str = ""
    plant: bool = False
    task: str = "xyz"
    ranges: bool = False
    weights: bool = False
    frames: bool = False
    pair: bool = False
    feedback: str = "commanded"
    period: float | None = None
    kind: type[Law] | None = None
    law: Law | None = None
    law_keys: Mapping[str, Any] | None = None
    robot: str = ""
    camera: ToolCamera | None = None
    faults: object = None
    dither: JointNoise | None = None
    disturbance: JointNoise | None = None
    sensing: SensingSettings | None = None
    filter: bool = False
    precompensate: bool = False
    delay_desired: bool = False
    environment: bool = False
    force: bool = False
    sensor: bool = False
    admittance: bool = False
    moving_surface: bool = False
    obstacles: bool = False
    moving: bool = False
    detour: bool = False
    safety: bool = False
    collisions: bool = False
    second: bool = False
    follows: bool = False
    path: bool = False
    targets: bool = False
    goal: bool = False
    one_goal: bool = False
    goals: bool = False
    handling: bool = False
    on_unreachable: str = "refuse"
    further: tuple[Feature, ...] = ()

    @property
    def avoids(self) -> bool:
        """Whether the arm is kept clear of obstacles, by its law or by its safety filter."""
        return self.collisions or (self.law is not None and self.law.keeps_distance is not None)

    @property
    def words(self) -> dict[str, str]:
        """What the sentences of the table name of a combination."""
        law = self.kind if self.law is None else type(self.law)
        noise = self.dither
        return {
            "law": "this law" if law is None else law.__name__,
            "level": self.level.level,
            "task": self.task,
            "feedback": self.feedback,
            "model": "" if noise is None else noise.model,
            "on_unreachable": self.on_unreachable,
            "robot": self.robot,
            "kinds": _following(),
            "objective_kinds": _objective_kinds(),
        }


#: What the sentences name where they are about any combination.
ANY = {
    "law": "this law",
    "level": "dynamic",
    "task": "pose",
    "feedback": "commanded",
    "model": "virtual",
    "on_unreachable": "follow",
    "robot": "fr3",
    "kinds": _following(),
    "objective_kinds": _objective_kinds(),
}
#: The same of a combination that lacks what a row needs.
_OTHERS = {"level": "kinematic", "task": "xyz", "feedback": "commanded"}


@dataclass(frozen=True)
class Trait:
    """Something that a combination may have.

    Attributes:
        name: Its name in the page.
        of: The feature that it belongs to, by its section of a document; ``law`` or ``host``.
        has: Whether a combination has it.
    """

    name: str
    of: str
    has: Callable[[Combination], bool]


def _law(has: Callable[[Law], bool]) -> Callable[[Combination], bool]:
    return lambda c: c.law is not None and has(c.law)


def _kind(has: Callable[[type[Law]], bool]) -> Callable[[Combination], bool]:
    return lambda c: c.kind is not None and has(c.kind)


def _host(*hosts: Host) -> Callable[[Combination], bool]:
    return lambda c: c.host in hosts


def _moves(noise: JointNoise | None) -> bool:
    return noise is not None and noise.moves_arm


_TRAITS = (
    Trait("camera", "camera", lambda c: c.camera is not None),
    Trait("joint locks", "faults", lambda c: bool(c.faults)),
    Trait("dither", "dither", lambda c: c.dither is not None),
    Trait("actuated dither", "dither", lambda c: _moves(c.dither)),
    Trait("virtual dither", "dither", lambda c: c.dither is not None and not _moves(c.dither)),
    Trait("disturbance", "disturbance", lambda c: c.disturbance is not None),
    Trait("filter", "filter", lambda c: c.filter),
    Trait("filter in the loop", "filter", lambda c: c.filter and c.feedback != "unfiltered"),
    Trait("filter in contact", "filter", lambda c: c.filter and c.environment),
    Trait("filter.precompensate", "filter", lambda c: c.filter and c.precompensate),
    Trait("filter.delay_desired", "filter", lambda c: c.filter and c.delay_desired),
    Trait("sensing", "sensing", lambda c: c.sensing is not None),
    Trait(
        "sensing.p_WE_noise",
        "sensing",
        lambda c: c.sensing is not None and c.sensing.p_WE_noise is not None,
    ),
    Trait(
        "sensing.R_WE_noise",
        "sensing",
        lambda c: c.sensing is not None and c.sensing.R_WE_noise is not None,
    ),
    Trait(
        "sensing of more than p_WE, or with a filter",
        "sensing",
        lambda c: c.sensing is not None and (not c.sensing.of_position_alone or c.filter),
    ),
    Trait(
        "poses measured without secant_samples",
        "sensing",
        lambda c: (
            c.sensing is not None and c.sensing.from_outside and not c.sensing.secant_samples
        ),
    ),
    Trait("contact", "environment", lambda c: c.environment),
    # Of a law that presses, it is told first that it needs a surface.
    Trait("desired force", "environment", lambda c: c.force and c.law is not None),
    Trait("force sensor", "environment", lambda c: c.sensor and c.law is not None),
    Trait("admittance", "environment", lambda c: c.admittance),
    Trait("moving surface", "environment", lambda c: c.moving_surface),
    Trait("list of obstacles", "obstacles", lambda c: c.obstacles),
    Trait("avoided obstacles", "obstacles", lambda c: c.avoids),
    Trait("moving obstacles", "obstacles", lambda c: c.moving),
    Trait("detour", "detour", lambda c: c.detour),
    Trait("safety", "safety", lambda c: c.safety),
    Trait("second arm", "second", lambda c: c.second),
    Trait("second arm that follows", "second", lambda c: c.second and c.follows),
    Trait("path", "path", lambda c: c.path),
    Trait("recorded targets", "targets", lambda c: c.targets),
    Trait("joint targets", "targets", lambda c: c.targets or c.goal),
    Trait("goal", "goal", lambda c: c.goal),
    Trait("single goal", "goal", lambda c: c.one_goal),
    Trait("several goals", "goals", lambda c: c.goals),
    Trait("goals that attach, release or grip", "goals", lambda c: c.handling),
    Trait("on_unreachable: follow", "path", lambda c: c.on_unreachable == "follow"),
    Trait("on_unreachable: project", "path", lambda c: c.on_unreachable == "project"),
    Trait(
        "on_unreachable: follow or project", "path", lambda c: c.on_unreachable != "refuse"
    ),
    Trait("integrator", "integrator", lambda c: c.period is None),
    Trait("task: other than xyz", "task", lambda c: c.task != "xyz"),
    Trait("objectives", "task", lambda c: c.task == LISTED),
    Trait("objectives with ranges", "task", lambda c: c.ranges),
    Trait("objectives with weights", "task", lambda c: c.weights),
    Trait("objectives of tools", "task", lambda c: c.frames),
    Trait("two tools", "arm", lambda c: c.pair),
    Trait(
        "pose measured from outside",
        "sensing",
        lambda c: c.sensing is not None and c.sensing.from_outside,
    ),
    Trait(
        "law that follows no objectives", "law", _kind(lambda kind: not kind.follows_objectives)
    ),
    Trait(
        "network with manipulability",
        "law",
        lambda c: c.law_keys is not None and bool(c.law_keys.get("manipulability")),
    ),
    Trait(
        "law with mutual avoidance",
        "law",
        lambda c: c.law_keys is not None and c.law_keys.get("mutual_avoidance") is not None,
    ),
    Trait("law of equations", "law", _kind(lambda kind: not kind.keeps_ranges)),
    Trait("feedback: unfiltered", "feedback", lambda c: c.feedback == "unfiltered"),
    Trait("feedback: measured", "feedback", lambda c: c.feedback == "measured"),
    Trait(
        "level: dynamic or torque", "level", lambda c: c.level.has_motors and c.level.is_simulated
    ),
    Trait("level: torque", "level", lambda c: not c.level.follows_command),
    Trait("level: robot", "level", lambda c: not c.level.is_simulated),
    Trait("level: other than kinematic", "level", lambda c: c.level.has_motors),
    Trait(
        "level: other than kinematic, or sensing",
        "level",
        lambda c: c.level.has_motors or c.sensing is not None,
    ),
    Trait("plant", "plant", lambda c: c.plant),
    Trait("mobile base", "arm", lambda c: bool(c.drive)),
    Trait("differential drive", "arm", lambda c: c.drive == "differential"),
    Trait(
        "law that sees more than J, poses and joint positions",
        "law",
        _law(lambda law: not set(law.inputs) <= SEEN),
    ),
    Trait("law of torques", "law", _kind(lambda kind: kind.commands_torque)),
    Trait("law of velocities", "law", _kind(lambda kind: not kind.commands_torque)),
    Trait("law that presses", "law", _law(lambda law: law.presses)),
    Trait(
        "law without measured force",
        "law",
        lambda c: c.law is not None and not (c.law.measures_force or c.admittance),
    ),
    Trait(
        "law that follows no position", "law", _law(lambda law: not law.follows_position)
    ),
    Trait("law that sees no pixels", "law", _kind(lambda kind: not kind.can_see_pixels())),
    Trait(
        "law that sees no pixels as it is set", "law", _law(lambda law: not law.sees_pixels)
    ),
    Trait(
        "known Jacobian",
        "law",
        lambda c: c.law_keys is not None and c.law_keys.get("jacobian") != "learned",
    ),
    Trait(
        "law without learning",
        "law",
        _law(lambda law: not law.learns_jacobian and not law.sees_velocity),
    ),
    Trait(
        "law that learns from positions",
        "law",
        _law(lambda law: law.learns_jacobian and not law.sees_velocity),
    ),
    Trait("law that sees v_WE", "law", _law(lambda law: law.sees_tool_velocity)),
    Trait(
        "law without desired position and velocity",
        "law",
        _law(lambda law: not law.sees_desired_motion),
    ),
    Trait("law without detours", "law", _kind(lambda kind: not kind.makes_detours)),
    Trait("law without avoidance", "law", _law(lambda law: law.keeps_distance is None)),
    Trait("law that plans ahead", "law", _law(lambda law: law.joint_preview is not None)),
    Trait("law of a target posture", "law", _kind(lambda kind: issubclass(kind, PostureLaw))),
    Trait(
        "law of a path", "law", _kind(lambda kind: not issubclass(kind, PostureLaw))
    ),
    Trait("law of joint targets", "law", _kind(lambda kind: kind.follows_joint_targets)),
    Trait(
        "law without joint targets", "law", _kind(lambda kind: not kind.follows_joint_targets)
    ),
    Trait("run in Drake", "host", _host("simulate", "compiled law")),
    Trait("compiled law", "host", _host("compiled law", "law in C")),
    Trait("law in C", "host", _host("law in C")),
    Trait("fastest", "host", _host("fastest")),
    Trait("batch", "host", _host("batch")),
    Trait("compiled run", "host", _host("compiled run", "compiled step")),
    Trait("compiled step", "host", _host("compiled step")),
    Trait("live page", "host", _host("live", "switch")),
    Trait("switch of a live page", "host", _host("switch")),
    Trait("driven robot", "host", _host("drive", "paced drive")),
    Trait("driven FR3", "host", _host("paced drive")),
)  # fmt: skip
#: What a combination may have, by name.
TRAITS = {trait.name: trait for trait in _TRAITS}


@dataclass(frozen=True)
class Pair:
    """A row of the table: two traits that cannot be combined, or one that needs the other.

    Attributes:
        one: Name of the first trait.
        other: Name of the second one.
        key: Key of a document that the refusal begins with.
        text: The refusal after this key: what is asked, and why.
        needs: Whether the first one needs the second one, instead of excluding it.
        documents_only: Whether a loop of one's own may have it all the same.
    """

    one: str
    other: str
    key: str
    text: str
    needs: bool = False
    documents_only: bool = False

    def applies(self, combination: Combination) -> bool:
        """Return whether this row refuses a combination."""
        if self.documents_only and not combination.documented:
            return False
        one, other = _has(self.one, combination), _has(self.other, combination)
        return one and other is not self.needs

    def sentence(self, words: Mapping[str, str] | None = None) -> str:
        """Return the refusal, for a combination with these words; by default an example of one."""
        return f"{self.key}: {self.text.format_map(self._example() if words is None else words)}"

    def _example(self) -> dict[str, str]:
        """Return the words of a combination that this row refuses."""
        lacks = self.other.partition(":")[0] if self.needs else ""
        return ANY | {key: word for key, word in _OTHERS.items() if key == lacks}


def _has(trait: str, combination: Combination) -> bool:
    """Return whether a combination has a trait of this name, or a further feature of this key."""
    if trait in TRAITS:
        return TRAITS[trait].has(combination)
    return any(feature.key == trait for feature in combination.further)


_NEEDS_PERIOD = "needs a sampled law; give a period instead of an integrator"
_STOPS = (
    "what is certified to stay clear of them is a stop of all joints at once, and a brake stops "
    "one of them alone"
)
_UNKNOWN_MOTION = "nothing is known of the motion that it adds to the command"
_NO_WAIT = (
    "must be left out for the {robot}, which does not wait: what comes behind the law does not "
    "know when a cycle was answered without it"
)
_NO_ARCS = "must be holonomic; the reading that leads a drive along arcs is of simulations alone"
_NO_SEARCH = (
    "must be left out; while a way is sought time has to stand still, as it does in simulate, "
    "drake-rnn run and run_many"
)
_ONE_LAW = (
    "must attach, release and grip nothing here, where the same pairs are kept apart all along; "
    "simulate and drake-rnn run, without compiled steps, have such goals"
)
_STILL = "must be left out; surfaces stand still here, and move in simulate and drake-rnn run"
_BESIDE_THE_LAW = (
    "must be law here, not admittance, which is a system of its own between path and law; simulate "
    "and drake-rnn run have it"
)
_OF_ONE_LAW = ("compiled law", "fastest", "batch", "compiled run", "live page", "driven robot")
#: What is said of two arms whose laws do not count with each other.
SIDE_BY_SIDE = (
    "second: needs laws that keep clear of what is beside their arms: adaptive, with a period and "
    "without avoidance: none"
)

_LEVELS = (
    Pair(
        "plant", "level: dynamic or torque", "plant", "only at level: dynamic or torque", needs=True
    ),
    Pair(
        "integrator",
        "level: other than kinematic",
        "period",
        "must be given at level: {level}, instead of an integrator",
    ),
    Pair(
        "feedback: measured",
        "level: other than kinematic, or sensing",
        "feedback",
        "measured needs level: dynamic; at level: kinematic the arm is exactly where it is "
        "commanded to be, unless sensing is given",
        needs=True,
    ),
)

_TORQUES = (
    Pair(
        "law of torques",
        "level: torque",
        "level",
        "must be torque, not {level}, with this law: {law} commands torques",
        needs=True,
    ),
    Pair(
        "level: torque",
        "law of velocities",
        "law",
        "must command torques at level: torque, as joint_torque does; {law} commands velocities, "
        "which level: dynamic takes",
    ),
    Pair(
        "level: torque",
        "feedback: measured",
        "feedback",
        "must be measured at level: torque, not {feedback}; the arm goes where torques lead it",
        needs=True,
    ),
    *(
        Pair("level: torque", other, key, f"must be left out at level: torque; {why}")
        for other, key, why in (
            ("filter", "filter", "it is a mean of velocities"),
            ("dither", "dither", "it is a noise of velocities; law.excitation is one of torques"),
            ("disturbance", "disturbance", "it is a noise of velocities"),
            ("joint locks", "faults", "a lock stops a velocity, not a torque"),
            ("safety", "safety", "it keeps bounds of velocities; law.bounds counts with them"),
            ("contact", "environment", "no law of torques presses"),
            ("camera", "camera", "no law of torques sees pixels"),
            ("second arm", "second", "no law of torques counts with another arm"),
            ("mobile base", "arm.base", "its drive has no torques"),
            ("two tools", "arm.pair", "no law of torques was tried with it"),
        )
    ),
)

_FEATURES = (
    Pair(
        "disturbance",
        "dither",
        "disturbance",
        "cannot be combined with dither; give one of them: both are added to the same command",
    ),
    # Mobile bases.
    Pair(
        "second arm",
        "mobile base",
        "second",
        "must be left out with a mobile base; two arms count on bases that stand still",
    ),
    *(
        Pair("differential drive", other, key, f"must be {words} with a differential drive; {why}")
        for other, key, words, why in (
            ("joint locks", "faults", "left out", "a wheel that locks is no joint that locks"),
            ("avoided obstacles", "obstacles", "avoided by none",
             "its stop is an arc, and what is certified are stops whose joints move by themselves"),
            ("safety", "safety", "left out", "what it keeps are bounds of joints"),
            ("filter", "filter", "left out", "a mean of velocities of several headings slips"),
            ("dither", "dither", "left out", "noise of x and y would slip"),
            ("disturbance", "disturbance", "left out", "noise of x and y would slip"),
            ("sensing", "sensing", "left out", "the law must know the heading"),
            ("contact", "environment", "left out", "the law sees the pressed surface in the world"),
            ("camera", "camera", "left out", "no law of pixels was tried with it"),
            ("joint targets", "targets", "left out", "joint targets of x and y would slip"),
            ("level: other than kinematic", "level", "kinematic", "its wheels are not modelled"),
        )
    ),
    Pair(
        "differential drive",
        "integrator",
        "integrator",
        "must be left out with a differential drive, which is led along arcs; give a period",
    ),
    # Joints that lock.
    Pair(
        "joint locks",
        "integrator",
        "faults",
        "need a sampled law; give a period, not an integrator",
    ),
    Pair(
        "joint locks",
        "feedback: unfiltered",
        "feedback",
        "must not be unfiltered with faults; the virtual arm that the law would see does not lock",
    ),
    Pair(
        "joint locks",
        "virtual dither",
        "dither.model",
        "must be actuated with faults, not {model}; a locked joint shows no noise",
    ),
    Pair(
        "joint locks",
        "second arm",
        "second",
        "must be left out with faults; both arms count on a stop of all joints at once, and a "
        "brake stops one of them alone",
    ),
    Pair(
        "joint locks",
        "avoided obstacles",
        "obstacles",
        f"must not be avoided with faults; {_STOPS}",
    ),
    # The camera.
    Pair("camera", "integrator", "camera", _NEEDS_PERIOD),
    Pair(
        "camera",
        "second arm",
        "second",
        "must be left out with a camera, which sees points of one arm alone",
    ),
    Pair(
        "camera",
        "filter",
        "filter",
        "must be left out with a camera, which sees the arm itself and not a mean of its motion",
    ),
    Pair(
        "camera",
        "feedback: unfiltered",
        "feedback",
        "must not be unfiltered with a camera, which sees the arm itself",
    ),
    Pair(
        "camera",
        "contact",
        "environment",
        "must be left out with a camera; no law presses on what it sees by pixels",
    ),
    Pair(
        "camera",
        "sensing.p_WE_noise",
        "sensing.p_WE_noise",
        "must be left out with a camera, whose errors are camera.noise",
    ),
    Pair(
        "camera",
        "sensing.R_WE_noise",
        "sensing.R_WE_noise",
        "must be left out with a camera, whose errors are camera.noise",
    ),
    Pair(
        "camera",
        "task: other than xyz",
        "task",
        "must be xyz, or be left out, with a camera, not {task}; the task is the pixels of "
        "camera.points",
        documents_only=True,
    ),
    # Two tools.
    Pair(
        "objectives of tools",
        "two tools",
        "task",
        "of: is of an arm with two tools; give arm.pair, or leave it out",
        needs=True,
    ),
    Pair(
        "law with mutual avoidance",
        "two tools",
        "law.mutual_avoidance",
        "is of two arms that one law moves; give arm.pair, or leave it out",
        needs=True,
    ),
    Pair(
        "law with mutual avoidance",
        "list of obstacles",
        "obstacles",
        "must be given with law.mutual_avoidance, for the capsules of both arms; the list may be "
        "empty",
        needs=True,
    ),
    Pair(
        "law with mutual avoidance",
        "integrator",
        "integrator",
        "must be left out with law.mutual_avoidance, which remembers how fast links came near, "
        "from sample to sample; give a period",
    ),
    Pair(
        "two tools",
        "camera",
        "camera",
        "must be left out with arm.pair; it sees points of one tool",
    ),
    Pair(
        "two tools",
        "contact",
        "environment",
        "must be left out with arm.pair; which of two tools presses cannot be said",
    ),
    Pair(
        "two tools",
        "second arm",
        "second",
        "must be left out with arm.pair, whose second arm the same law moves",
    ),
    *(
        Pair(
            "two tools",
            feature,
            feature,
            "must be left out with arm.pair; a way is planned for one tool",
        )
        for feature in ("detour", "goal")
    ),
    # The second arm.
    Pair(
        "second arm",
        "contact",
        "environment",
        "must be left out with second; which of two arms presses cannot be said",
    ),
    Pair(
        "second arm",
        "list of obstacles",
        "obstacles",
        "must be given with second; the list may be empty",
        needs=True,
    ),
    Pair(
        "second arm",
        "safety",
        "safety",
        "must be left out with second; the laws of two arms keep bounds and distances themselves",
    ),
    Pair("second arm", "integrator", "second", SIDE_BY_SIDE.partition(": ")[2]),
    # The contact.
    Pair("force sensor", "integrator", "sensor", _NEEDS_PERIOD),
    *(
        Pair(
            "moving surface",
            other,
            "environment.moves",
            f"must be left out with {words}; the surface is one of them, where it begins",
        )
        for other, words in (
            ("list of obstacles", "obstacles"),
            ("avoided obstacles", "distances that are kept"),
        )
    ),
    Pair("admittance", "integrator", "force.kind", f"admittance {_NEEDS_PERIOD}"),
    Pair(
        "admittance",
        "filter",
        "filter",
        "must be left out with an admittance, whose path is to be followed at once",
    ),
    Pair(
        "admittance",
        "detour",
        "detour",
        "must be left out with an admittance; on the way the tool would leave its surface",
    ),
    # The filter.
    Pair("feedback: unfiltered", "filter", "feedback", "unfiltered needs a filter", needs=True),
    Pair("filter", "integrator", "filter", _NEEDS_PERIOD, documents_only=True),
    Pair(
        "filter in the loop",
        "actuated dither",
        "dither.model",
        "actuated would move the arm behind the filter, beyond its bounds; it may be virtual",
    ),
    Pair(
        "filter in the loop",
        "disturbance",
        "disturbance",
        "would move the arm behind the filter, beyond its bounds; with feedback: unfiltered it "
        "acts before the filter",
    ),
    Pair(
        "filter.precompensate",
        "filter in the loop",
        "filter.precompensate",
        "only with feedback: unfiltered",
        documents_only=True,
    ),
    Pair(
        "filter.delay_desired",
        "feedback: unfiltered",
        "filter.delay_desired",
        "only with feedback: commanded",
        documents_only=True,
    ),
    Pair(
        "feedback: measured",
        "virtual dither",
        "dither.model",
        "must be actuated with feedback: measured, not {model}",
    ),
    # Sensors, distances, the safety filter.
    Pair("sensing", "level: robot", "sensing", "must be left out at level: robot, which measures "
         "with its own sensors"),
    Pair("sensing", "feedback: measured", "sensing", "only with feedback: measured, not {feedback}",
         needs=True),
    Pair("sensing", "integrator", "sensing", _NEEDS_PERIOD),
    Pair("contact", "level: robot", "environment", NO_FORCE.partition(": ")[2]),
    Pair(
        "filter",
        "avoided obstacles",
        "filter",
        "must be left out with obstacles that are avoided; a mean of postures may collide where "
        "none of them does",
    ),
    Pair(
        "disturbance",
        "avoided obstacles",
        "disturbance",
        f"must be left out with obstacles that are avoided; {_UNKNOWN_MOTION}",
    ),
    Pair(
        "actuated dither",
        "avoided obstacles",
        "dither.model",
        f"must not be actuated with obstacles that are avoided; {_UNKNOWN_MOTION}",
    ),
    # Detours.
    Pair(
        "detour",
        "moving obstacles",
        "detour",
        "is planned among obstacles that stand still; leave their speed out",
    ),
    Pair(
        "detour",
        "camera",
        "detour",
        "leads to a point of the path, of which a camera knows the pixels alone; leave it out",
    ),
    Pair(
        "detour",
        "objectives",
        "detour",
        "is planned to a position or a pose of the path; leave it out with a list of objectives",
    ),
    Pair(
        "detour",
        "safety",
        "safety",
        "must be left out with a detour, which leads a law that keeps bounds and distances itself",
    ),
    Pair(
        "detour",
        "second arm that follows",
        "second.follows",
        "must be left out with a detour, which is planned to where a path is known to be",
    ),
    Pair(
        "safety",
        "integrator",
        "safety",
        "needs a sampled law; give a period, not an integrator",
    ),
)  # fmt: skip

_LAWS = (
    Pair(
        "objectives",
        "law that follows no objectives",
        "task",
        "must not be a list of objectives: {law} is about a position or a pose; {objective_kinds} "
        "take one",
    ),
    Pair(
        "objectives with ranges",
        "law of equations",
        "task",
        "must have no at_least, at_most or within: {law} solves equations, and a range is none; "
        "adaptive keeps ranges",
    ),
    Pair(
        "objectives with weights",
        "law of equations",
        "task",
        "must have no weight: {law} solves all equations alike, and prices none; adaptive has "
        "prices",
    ),
    Pair(
        "objectives",
        "network with manipulability",
        "law.manipulability",
        "must be left out with objectives; its gradient is that of a position or a pose",
    ),
    Pair(
        "objectives",
        "pose measured from outside",
        "sensing",
        "must not measure the pose from outside with objectives; what is measured is a position, "
        "and not their coordinates",
    ),
    Pair(
        "objectives",
        "contact",
        "environment",
        "must be left out with objectives; no law presses with a part of a pose",
    ),
    Pair(
        "objectives",
        "second arm that follows",
        "second.follows",
        "must be left out with objectives, whose coordinates are those of one arm",
    ),
    Pair(
        "differential drive",
        "law that sees more than J, poses and joint positions",
        "arm.base.drive",
        "must be holonomic, not differential, with this law: {law} sees or bounds velocities of x "
        "and y; adaptive chooses those of the drive",
    ),
    Pair(
        "goal",
        "law without joint targets",
        "goal",
        "this law follows no plan; leave it out, or give law.kind: {kinds}",
    ),
    Pair("several goals", "single goal", "goal", "cannot be combined with goals; give one of them"),
    Pair(
        "goals that attach, release or grip",
        "level: other than kinematic",
        "goals",
        "must attach, release and grip nothing at level: {level}, where masses are those of the "
        "whole run; leave action and opening out, or give level: kinematic",
    ),
    Pair(
        "goals that attach, release or grip",
        "safety",
        "safety",
        "must be left out where goals attach, release or grip; the law of joint targets keeps "
        "bounds and distances itself",
    ),
    Pair(
        "goals that attach, release or grip",
        "list of obstacles",
        "obstacles",
        "must be given where goals attach, release or grip; the list may be empty",
        needs=True,
    ),
    Pair(
        "goals that attach, release or grip",
        "contact",
        "environment",
        "must be left out where goals attach, release or grip; a payload makes no contact",
    ),
    Pair("goal", "recorded targets", "goal", "cannot be combined with targets; give one of them"),
    Pair(
        "goal",
        "moving obstacles",
        "goal",
        "is planned for among obstacles that stand still; leave their speed out",
    ),
    Pair(
        "goal", "second arm", "goal", "is planned for with one arm alone; leave the second one out"
    ),
    Pair(
        "recorded targets",
        "law without joint targets",
        "targets",
        "this law follows none; leave them out, or give law.kind: {kinds}",
    ),
    Pair(
        "law of joint targets",
        "path",
        "path",
        "this law follows joint targets; leave the path out",
    ),
    Pair(
        "law of joint targets",
        "joint targets",
        "targets",
        "must be given, the joint targets that this law follows, or a goal",
        needs=True,
        documents_only=True,
    ),
    Pair(
        "law of joint targets",
        "on_unreachable: follow or project",
        "on_unreachable",
        "{on_unreachable} is only for a path or a target posture; joint targets are followed as "
        "far as limits and obstacles let the arm",
    ),
    Pair(
        "law of joint targets",
        "integrator",
        "integrator",
        "joint targets come to a sampled law; give a period",
    ),
    Pair(
        "law of a target posture",
        "path",
        "path",
        "this law holds the end effector where it is; leave the path out",
    ),
    Pair(
        "law of a target posture",
        "on_unreachable: follow",
        "on_unreachable",
        "follow is only for a path; the target posture of this law may be refused or projected",
    ),
    Pair(
        "law of a path",
        "on_unreachable: project",
        "on_unreachable",
        "project is only for a law that seeks a target posture; a path may be refused or followed",
    ),
    Pair(
        "camera",
        "law that sees no pixels",
        "camera",
        "{law} sees no pixels; leave the camera out, or give a law that does: adaptive, with "
        "jacobian: learned",
    ),
    Pair(
        "camera",
        "known Jacobian",
        "law.jacobian",
        "must be learned with a camera, whose image Jacobian nothing knows",
    ),
    Pair(
        "camera",
        "law that sees no pixels as it is set",
        "camera",
        "{law} sees no pixels; leave the camera out, or give a law that does: adaptive, with "
        "jacobian: learned",
    ),
    Pair(
        "dither",
        "law without learning",
        "dither",
        "must be left out; this law does not learn, so there is nothing to excite",
        documents_only=True,
    ),
    Pair(
        "dither",
        "law that learns from positions",
        "dither",
        "must be left out; this law learns from positions, and does not use the velocity that "
        "dither excites",
        documents_only=True,
    ),
    Pair(
        "poses measured without secant_samples",
        "law that sees v_WE",
        "sensing.secant_samples",
        "must be at least 1 with p_WE_noise or R_WE_noise, because {law} sees v_WE, which is a "
        "difference of measured positions then",
    ),
    Pair(
        "filter.delay_desired",
        "law without desired position and velocity",
        "filter.delay_desired",
        "only for a law that sees p_WE_desired and v_WE_desired",
        documents_only=True,
    ),
    Pair(
        "law that presses",
        "contact",
        "environment",
        "must be given; this law presses against a surface",
        needs=True,
        documents_only=True,
    ),
    Pair("desired force", "contact", "force", "only with an environment", needs=True),
    Pair("force sensor", "contact", "sensor", "only with an environment", needs=True),
    Pair(
        "force sensor",
        "law without measured force",
        "sensor",
        "must be left out; with these settings the law does not use the measured force",
        documents_only=True,
    ),
    Pair(
        "admittance",
        "law that presses",
        "force.kind",
        "admittance is for laws that follow a path and do not press; leave law.force_control out, "
        "or give kind: law",
    ),
    Pair(
        "admittance",
        "law that follows no position",
        "force.kind",
        "must be law, not admittance: {law} follows no position that could give way",
    ),
    Pair(
        "admittance",
        "law that plans ahead",
        "force.kind",
        "must be law, not admittance: {law} plans ahead along a path that is known",
    ),
    Pair("second arm", "law without avoidance", "second", SIDE_BY_SIDE.partition(": ")[2]),
    Pair(
        "detour",
        "law without detours",
        "detour",
        "this law cannot be led round what it is stuck before; leave it out, or give law.kind: "
        "adaptive, or a goal to a law that follows joint targets",
    ),
    Pair(
        "detour",
        "law without avoidance",
        "detour",
        "needs obstacles that the law avoids: a list of obstacles, which may be empty",
    ),
    Pair(
        "detour",
        "law that presses",
        "detour",
        "must be left out of a law that presses; on the way the tool would leave its surface",
    ),
)

_HOSTS = (
    Pair(
        "run in Drake",
        "level: robot",
        "level",
        "robot is for `drake-rnn drive`, which moves a robot; a run without one is at level: "
        "kinematic or dynamic",
    ),
    Pair(
        "fastest",
        "filter",
        "filter",
        "keeps the bounds at any speed, by leaving the path; leave it out",
    ),
    *(
        Pair(host, "differential drive", "arm.base.drive", _NO_ARCS)
        for host in ("compiled law", "fastest", "batch", "compiled run", "live page")
    ),
    Pair(
        "driven robot",
        "mobile base",
        "arm.base",
        "must be left out; a driven robot stands",
    ),
    # A law whose steps are compiled, in a run or as files.
    Pair(
        "compiled law",
        "integrator",
        "integrator",
        "is Drake's; a compiled law is sampled: give a period instead",
    ),
    Pair(
        "compiled law",
        "joint locks",
        "faults",
        "must be left out of a compiled law; what sees locked joints is written for NumPy alone",
    ),
    Pair(
        "compiled law",
        "law that plans ahead",
        "law",
        "{law} plans ahead, which is written for NumPy alone; it is not compiled",
    ),
    Pair(
        "law in C",
        "law of torques",
        "law",
        "{law} commands torques; a law in C hands on velocities",
    ),
    Pair("law in C", "second arm", "second", "must be left out; a law in C moves one arm"),
    *(Pair(host, "detour", "detour", _NO_SEARCH) for host in ("law in C", "fastest")),
    *(Pair(host, "detour", "detour", _NO_SEARCH) for host in ("compiled run", "live page")),
    Pair("driven robot", "detour", "detour", _NO_SEARCH),
    *(
        Pair(host, "admittance", "force.kind", _BESIDE_THE_LAW)
        for host in ("law in C", "fastest", "batch", "compiled run", "live page")
    ),
    *(
        Pair(host, "moving surface", "environment.moves", _STILL)
        for host in ("batch", "compiled run", "live page")
    ),
    *(Pair(host, "goals that attach, release or grip", "goals", _ONE_LAW) for host in _OF_ONE_LAW),
    # A batch.
    Pair(
        "batch",
        "level: other than kinematic",
        "level",
        "{level} needs Drake's plant; a batch has kinematics alone",
    ),
    Pair(
        "batch",
        "integrator",
        "integrator",
        "is Drake's; a batch needs a sampled law, with a period",
    ),
    Pair("batch", "force sensor", "sensor", "a batch has none; simulate has"),
    Pair("batch", "joint locks", "faults", "a batch has none; simulate has"),
    Pair("batch", "camera", "camera", "a batch has none; simulate has"),
    Pair(
        "batch",
        "second arm that follows",
        "second.follows",
        "a batch knows all paths beforehand; simulate has such arms",
    ),
    Pair(
        "batch",
        "sensing of more than p_WE, or with a filter",
        "sensing",
        "a batch has p_WE_noise alone, without a filter; simulate has the rest",
    ),
    Pair("batch", "filter in contact", "filter", "a batch has none in contact; simulate has"),
    Pair(
        "batch",
        "law that plans ahead",
        "law",
        "{law} plans ahead; a batch knows no future joint positions",
    ),
    Pair(
        "compiled run",
        "law of torques",
        "law",
        "{law} commands torques, which need Drake's plant; a compiled run has kinematics alone",
    ),
    Pair("compiled run", "filter", "filter", "a compiled run has none; run_many has"),
    Pair("compiled run", "second arm", "second", "a compiled run has none; run_many has"),
    Pair(
        "compiled step",
        "moving obstacles",
        "obstacles",
        "none may move; a compiled step is not told where they are",
    ),
    Pair("compiled step", "contact", "environment", "a compiled step sees no contact"),
    Pair(
        "compiled step",
        "sensing",
        "sensing",
        "is for simulations; a compiled step sees the positions that it is given",
    ),
    Pair(
        "compiled step",
        "virtual dither",
        "dither.model",
        "{model} is for simulations; a compiled step sees the velocities that it is given",
    ),
    # A live page.
    Pair(
        "live page",
        "level: torque",
        "level",
        "{level} has no position that a hand's could replace; simulate and drake-rnn run have it",
    ),
    Pair(
        "live page",
        "integrator",
        "integrator",
        "a law that is played with is sampled; give a period instead",
    ),
    Pair("live page", "second arm", "second", "a single arm can be played with; leave it out"),
    Pair("live page", "joint locks", "faults", "no joint locks while one plays; leave them out"),
    Pair("live page", "camera", "camera", "what is played with has none; leave it out"),
    Pair(
        "live page",
        "law that plans ahead",
        "law",
        "this one follows joint positions that are known ahead, and a hand's are not",
    ),
    Pair(
        "switch of a live page",
        "filter",
        "filter",
        "its means cannot be handed on to another law or arm",
    ),
    Pair("live page", "two tools", "arm.pair", "a single tool can be dragged; leave it out"),
    # A robot that is driven.
    Pair(
        "driven robot",
        "law of torques",
        "law",
        "{law} commands torques; a driven robot takes positions",
    ),
    *(
        Pair("driven FR3", feature, feature, _NO_WAIT)
        for feature in ("filter", "dither", "disturbance")
    ),
    Pair(
        "driven robot",
        "second arm",
        "second",
        "must be left out; one robot is driven at a time",
    ),
    Pair(
        "driven robot",
        "two tools",
        "arm.pair",
        "must be left out; one robot is driven at a time",
    ),
    Pair(
        "driven robot",
        "camera",
        "camera",
        "must be left out; a driven robot is seen by none",
    ),
    Pair(
        "driven robot",
        "joint locks",
        "faults",
        "must be left out; the joints of a robot are not locked",
    ),
    Pair(
        "driven robot",
        "moving obstacles",
        "obstacles",
        "none may move; a drive is not told where they are",
    ),
)

#: The table: of rows that apply, the first one is said.
PAIRS = (*_LEVELS, *_TORQUES, *_FEATURES, *_LAWS, *_HOSTS)


def refusal(combination: Combination) -> str | None:
    """Return why something cannot be combined, in one sentence; None if it can.

    Args:
        combination: What is combined.
    """
    further = (pair for feature in combination.further for pair in feature.pairs)
    pairs = (pair for pair in (*PAIRS, *further) if pair.applies(combination))
    if (pair := next(pairs, None)) is not None:
        return pair.sentence(combination.words)
    for feature in combination.further:
        if combination.host not in feature.hosts:
            return f"{feature.key}: must be left out; only a simulation in Drake has it"
    return None


def refuse(combination: Combination) -> None:
    """Raise an InvalidInputError for what cannot be combined.

    Args:
        combination: What is combined.

    Raises:
        InvalidInputError: With the sentence of the first row of the table that applies.
    """
    if (sentence := refusal(combination)) is not None:
        raise InvalidInputError(sentence)

"""A law with the kinematics of its arm as files in C: what `drake-rnn compile` writes.

- The step and its header, in which inputs, outputs and obstacles are documented.
- A test vector, taken from the experiment's diagram, and a program that replays it.
"""

from __future__ import annotations

import subprocess
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from .arrays.algebra import AnyArray
from .batch.signals import Sight
from .compiled.c_text import LIBRARY, USUAL, Body
from .compiled.library import compiler, run_compiler
from .compiled.step import NUMBERS, Sample, leaf_texts
from .errors import DrakeRnnError, InvalidInputError
from .experiment import Experiment, ExperimentSource, load_experiment
from .features.pairs import refuse
from .inputs.fields import Array, checked, instance, whole
from .inputs.packages import versions
from .laws import SampledReading
from .laws.checks import Numbers
from .laws.parts.obstacle_tracks import ANYWHERE
from .robot.clearance.capsules import Solids
from .robot.limits import LIMIT_UNITS
from .robot.load_arm import screws_of
from .runs.folder import require_output, written_whole
from .runs.simulation import build_loops, simulator_config, start_laws
from .signals import SIGNALS, input_description, names_of, state_description
from .systems import SampledController
from .systems.block import release_at_end

#: Files that are written.
FILES = ("law.c", "law.h", "vector.h", "main.c", "CMakeLists.txt", "README.md")

#: Options with which the files are built, here and by their test.
OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror")

_SAMPLES = 1000
# Arrays on the stack up to this size are not told of [bytes].
_LITTLE_STACK = 8192

# Numbers of obstacles by their field of `Solids`: the name in C, and what they are.
_OF_OBSTACLES = {
    "ends": (
        "round_ends",
        "both ends of the axis of {round}, of a ball its centre twice, in W [m]",
    ),
    "radii": ("round_radii", "radii of the same [m]"),
    "centers": ("box_centers", "centres of {boxes}, in W [m]"),
    "R_WO": ("box_R_WO", "orientations of the same, rotation matrices"),
    "half": ("box_halves", "half of the edges of the same [m]"),
    "normals": ("wall_normals", "unit normals of {walls}, pointing out, in W"),
    "levels": ("wall_levels", "heights of the planes of the same along their normals [m]"),
    "cylinders.centers": ("cylinder_centers", "centres of {cylinders}, in W [m]"),
    "cylinders.axes": ("cylinder_axes", "unit vectors along the axes of the same, in W"),
    "cylinders.half": ("cylinder_halves", "half of the lengths of the same [m]"),
    "cylinders.radii": ("cylinder_radii", "radii of the same [m]"),
    "speeds": ("speeds", "largest speeds of {all} [m/s]; 0 of one at rest"),
    "errors": ("errors", "largest errors of the measured positions of the same [m]"),
}
# Parts of a state with lower bounds of the distances of pairs.
_GAPS = ("gaps", "safe_gaps")
# The number of a law besides that goes with a scene, see `Numbers`.
_HOME = "home"


@dataclass(frozen=True)
class Field:
    """An array of a struct in C.

    Attributes:
        name: Its name.
        shape: Its shape; the array is flat, row by row.
        comment: What it is, with unit and frame.
    """

    name: str
    shape: tuple[int, ...]
    comment: str

    @property
    def size(self) -> int:
        """Number of its entries."""
        return prod(self.shape)


@dataclass(frozen=True)
class Vector:
    """Samples of an experiment, made by NumPy with Drake's kinematics.

    Attributes:
        start: State at the start, shape (state.size,).
        inputs: What is given at each sample, shape (samples, inputs).
        after: State after each, shape (samples, state.size).
        velocity: Mean velocity until the next sample, shape (samples, n) [rad/s].
    """

    start: Array
    inputs: Array
    after: Array
    velocity: Array


@checked(folder=instance(str, Path), samples=whole(1, 100_000))
def write_law(
    experiment: ExperimentSource, folder: str | Path, samples: int = _SAMPLES
) -> list[str]:
    """Write the law of an experiment, with the kinematics of its arm, as files in C.

    Args:
        experiment: A sampled experiment, or what `load_experiment` takes.
        folder: Folder to write to, which is made if it is missing. Files of these names in it are
            replaced.
        samples: Number of samples of the test vector, at most those of the experiment.

    Returns:
        What the test vector has shown, a line each; none without a C compiler.

    Raises:
        InvalidInputError: If the law cannot be compiled; the message says which line cannot. If a
            file of these names is no regular file, or belongs to a result.
        DrakeRnnError: If the C compiler refuses the files, or their steps are not those of the
            test vector; the files are kept.
    """
    for name in FILES:
        require_output(Path(folder) / name, "--to")
    subject = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    refuse(replace(subject.combination, host="law in C"))
    law = _Law(subject)
    texts = law.files(samples)
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            _write(folder / name, text)
        report = _replay(folder)
        _write(folder / "README.md", law.readme(report))
    except OSError as error:
        raise InvalidInputError(f"{folder}: {error.strerror}") from error
    return report


def _write(file: Path, text: str) -> None:
    with written_whole(file) as stream:
        stream.write(text)


class _Law:
    """The files of an experiment's law.

    Args:
        experiment: The experiment, with a period.
    """

    def __init__(self, experiment: Experiment) -> None:
        self._experiment = experiment
        diagram, (loop, *_) = build_loops(experiment)
        self._diagram, self._loop = diagram, loop
        assert isinstance(loop.controller, SampledController)
        self._controller = loop.controller
        self._reading: SampledReading = loop.controller.reading
        inputs = {name: shape for name, (_, shape) in self._reading.inputs.parts.items()}
        self._kinematic_names = (frozenset(inputs) & frozenset(names_of("kinematics"))) - {
            *loop.measured
        }
        causes = {cause for name in self._kinematic_names for cause in SIGNALS[name].causes}
        n = experiment.arm.n
        input_shapes = {
            name: shape for name, shape in inputs.items() if name not in self._kinematic_names
        }
        for cause, name in (("q", "position"), ("v", "velocity")):
            if cause in causes:
                input_shapes.setdefault(name, (n,))
        self._input_shapes = input_shapes
        screws, task = screws_of(experiment.arm), experiment.law_task
        kinematic_names = self._kinematic_names

        def signals_of(
            t: AnyArray, x: AnyArray, u: Mapping[str, AnyArray]
        ) -> Mapping[str, AnyArray]:
            if not kinematic_names:
                return u
            q, v = u["position"], u.get("velocity")
            many = q.ndim > 1
            rows: list[Any] = [each if many or each is None else each[None] for each in (q, v)]
            sight = Sight(task, screws.at(rows[0]), rows[0])
            values = sight.of_arms(kinematic_names, rows[1], rows[1])
            values = values if many else {name: value[0] for name, value in values.items()}
            return {name: u[name] if name in u else values[name] for name in inputs}

        self._numbers = Numbers.of([self._reading])
        given = {NUMBERS: (self._numbers.size,)} if self._numbers.size else {}
        period = self._controller.period
        self._sample = Sample(
            self._reading, period, input_shapes | given, signals_of, self._numbers
        )
        solids = None if experiment.clearance is None else experiment.clearance.solids
        self._places = _fields_of_scene(self._numbers, solids)
        self._body = self._print_step()

    def _print_step(self) -> Body:
        texts = {"time": "signals->time[0]"}
        after, first = [], 0
        for name, (_, shape) in self._reading.state.parts.items():
            size = prod(shape)
            places = [f"->{name}[{k}]" for k in range(size)]
            texts |= {f"state_{first + k}": f"state{place}" for k, place in enumerate(places)}
            after += [f"out->state.{name}[{k}]" for k in range(size)]
            first += size
        for name, shape in self._input_shapes.items():
            texts |= leaf_texts(name, shape or (1,), f"signals->{name}")
            if shape == ():
                texts[name] = f"signals->{name}[0]"
        for place, part in self._numbers.places.items():
            name = self._places[place].name
            texts |= {
                f"{NUMBERS}_{k}": f"scene->{name}[{k - part.start}]"
                for k in range(part.start, part.stop)
            }
        velocity = [f"out->velocity[{k}]" for k in range(self._experiment.arm.n)]
        return self._sample.body(texts, after, velocity)

    @cached_property
    def _needs_time(self) -> bool:
        """Whether the step depends on the time."""
        return any("signals->time" in line for line in self._body.lines)

    @cached_property
    def _signals(self) -> list[Field]:
        time_fields = [Field("time", (1,), "time since the start [s]")] if self._needs_time else []
        fields = [
            Field(name, shape or (1,), self._description(name))
            for name, shape in self._input_shapes.items()
        ]
        return time_fields + fields

    def _description(self, name: str) -> str:
        """Return what an input is; of obstacles that may move, which ones."""
        text, clearance = input_description(name), self._experiment.clearance
        if name != "p_WO" or clearance is None:
            return text
        return f"{text}: {', '.join(clearance.solids.moving_names)}"

    @cached_property
    def _names(self) -> dict[str, tuple[str, ...]]:
        """Names of the entries of arrays, by the array of their names in C."""
        clearance = self._experiment.clearance
        moving = clearance.solids.moving_names if clearance and "p_WO" in self._input_shapes else ()
        names = {"law_joints": tuple(self._experiment.arm.joints)}
        return names | ({"law_obstacles": moving} if moving else {})

    @cached_property
    def _scene(self) -> list[Field]:
        """What the step is given of obstacles, of that what it depends on."""
        text = "\n".join(self._body.lines)
        fields = dict.fromkeys(self._places.values())
        used = [field for field in fields if f"scene->{field.name}[" in text]
        return sorted(used, key=lambda field: field.name.startswith(_HOME))

    def _scene_row(self) -> Array:
        """Return the numbers of the experiment's obstacles, in the order of the fields."""
        numbers = self._numbers.of_reading(self._reading)
        places = {field: self._numbers.places[place] for place, field in self._places.items()}
        return np.concatenate([np.zeros(0), *(numbers[places[field]] for field in self._scene)])

    @cached_property
    def _state(self) -> list[Field]:
        parts = self._reading.state.parts.items()
        return [Field(name, shape or (1,), state_description(name)) for name, (_, shape) in parts]

    def files(self, samples: int) -> dict[str, str]:
        """Return the texts of all files but the README, by name."""
        with release_at_end(self._diagram):
            vector = self._vector(samples)
        return {
            "law.h": self._header(),
            "law.c": self._source(vector.start),
            "vector.h": self._vector_text(vector),
            "main.c": _MAIN,
            "CMakeLists.txt": _CMAKE,
        }

    @property
    def _title(self) -> str:
        name = self._experiment.name or "an experiment of one's own"
        made_by = ", ".join(f"{package} {number}" for package, number in versions().items())
        law, arm = type(self._experiment.law).__name__, self._experiment.arm.name
        period = f"{self._controller.period:g} s"
        return f"The law {law} of {name} for the arm {arm}, every {period}; made by {made_by}."

    def _header(self) -> str:
        n = self._experiment.arm.n
        velocity = Field(
            "velocity",
            (n,),
            "joint velocities to command until the next sample, their mean [rad/s]",
        )
        needs = sorted({*map(_function, self._body.operations)} - USUAL - {""})
        further = f" Of math.h it needs sin, cos, sqrt, fabs, floor and ceil{_join_names(needs)}."
        about = (
            f"{self._title} Call law_step once per period. It allocates nothing, keeps nothing and "
            f"may be called by several threads.{further}{self._stack} Angles are in rad, lengths "
            "in m; W is the world, E the end effector. Matrices are flat, row by row. Compile "
            "without -ffast-math and with -ffp-contract=off, which keeps the bits."
        )
        return _HEADER.format(
            about=_block_comment(about),
            joints=_within_comment(", ".join(self._experiment.arm.joints)),
            obstacles=self._count_of_obstacles(),
            state=_struct(self._state),
            signals=_struct(self._signals),
            velocity=_struct([velocity]),
            n=n,
            period=repr(self._controller.period),
            **self._scene_texts(),
        )

    def _count_of_obstacles(self) -> str:
        """Return the part of the header that names the rows of p_WO; empty without any."""
        if "law_obstacles" not in (names := self._names):
            return ""
        moving = names["law_obstacles"]
        order = _within_comment(", ".join(moving))
        return _OBSTACLE_NAMES.format(order=order, count=len(moving))

    def _scene_texts(self) -> dict[str, str]:
        """Return the parts of the header that are about obstacles; empty without any."""
        if not (fields := self._scene):
            return {"scene": "", "step_in": ""}
        return {"scene": _SCENE.format(fields=_struct(fields)), "step_in": _STEP_IN}

    @property
    def _stack(self) -> str:
        """How much stack a step takes, if that is much, as a sentence."""
        size = self._body.memory
        if size < _LITTLE_STACK:
            return ""
        return f" Its arrays take {round(size / 1024)} KiB of the stack of the thread that calls."

    def _look(self) -> str:
        """Return the function that forgets the distances of a scene, which the state keeps."""
        loops = [
            f"    for (int k = 0; k < {field.size}; ++k) {{\n"
            f"        state->{field.name}[k] = {-ANYWHERE!r};\n    }}"
            for field in self._state
            if field.name in _GAPS
        ]
        return _LOOK.format(loops="\n".join(loops) or "    (void)state;")

    def _source(self, start: Array) -> str:
        body = self._body
        idle = [name for name in ("state", "signals") if f"{name}->" not in "".join(body.lines)]
        lines = [f"(void){name};" for name in idle] + body.lines
        scene, step, in_scene = "", "law_step(", ""
        if fields := self._scene:
            numbers = _initializer(self._scene_row(), fields)
            scene = f"const law_scene law_initial_scene = {numbers};\n\n"
            step, in_scene = "law_step_in(const law_scene *scene, ", _STEP + self._look()
        names = "".join(
            f"const char *const {array}[{len(each)}] = {{{', '.join(map(_string, each))}}};\n"
            for array, each in self._names.items()
        )
        return _SOURCE.format(
            about=_block_comment(self._title),
            names=names,
            helpers=body.helpers + ("\n" if body.helpers else ""),
            initial=_initializer(start, self._state),
            scene=scene,
            step=step,
            body=textwrap.indent("\n".join(lines), "    "),
            in_scene=in_scene,
        )

    def _vector(self, samples: int) -> Vector:
        """Return samples of the experiment's diagram, as NumPy and Drake compute them."""
        simulator = Simulator(self._diagram)
        ApplySimulatorConfig(simulator_config(self._experiment, self._loop), simulator)
        root = simulator.get_mutable_context()
        start_laws((self._loop,), root)
        simulator.Initialize()
        context = self._controller.GetMyContextFromRoot(root)
        period, duration = self._controller.period, self._experiment.document.duration
        law, step = self._reading, self._controller.step_of(context)
        start = x = self._controller.state(context)
        inputs, after, velocity = [], [], []
        for k in range(min(samples, max(1, int(duration / period)))):
            t, u = root.get_time(), self._controller.signals(context)
            inputs.append(self._input_row(root, u, t))
            # The law's own step: what a plant does at the same time is not among these signals.
            x = step(t, x, u, period)
            simulator.AdvanceTo((k + 1) * period)
            mean = law.commanded_velocity(t, x)
            if not law.holds_command:
                mean = 0.5 * (mean + law.commanded_velocity(t + period, x))
            after.append(x)
            velocity.append(mean)
        return Vector(start, np.array(inputs), np.array(after), np.array(velocity))

    def _input_row(self, root: Any, u: Mapping[str, Array], t: float) -> Array:
        body = self._loop.virtual_arm or self._loop.arm
        own = {name: body.GetOutputPort(name) for name in ("position", "velocity")}
        rows = []
        for field in self._signals:
            if field.name == "time":
                rows.append(np.array([t]))
            elif field.name in u:
                rows.append(np.ravel(u[field.name]))
            else:
                port = self._loop.measured.get(field.name, own.get(field.name))
                assert port is not None
                system: Any = port.get_system()
                rows.append(np.ravel(port.Eval(system.GetMyContextFromRoot(root))))
        return np.concatenate(rows)

    def _vector_text(self, vector: Vector) -> str:
        n = self._experiment.arm.n
        velocity = Field("velocity", (n,), "")
        rows = [_initializer(row, self._signals) for row in vector.inputs]
        ends = [
            f"{{{_initializer(x, self._state)}, {_initializer(v, [velocity])[1:-1]}}}"
            for x, v in zip(vector.after, vector.velocity, strict=True)
        ]
        return _VECTOR.format(
            about=_block_comment(
                f"The first {len(rows)} samples of {self._experiment.name or 'the experiment'}, "
                "computed by NumPy with the kinematics of Drake."
            ),
            samples=len(rows),
            given=",\n".join(rows),
            expected=",\n".join(ends),
        )

    def readme(self, report: Sequence[str]) -> str:
        """Return the text of the README.

        Args:
            report: What the test vector has shown.
        """
        experiment, operations = self._experiment, self._body.operations
        keeps = experiment.guarantees.command
        rows = [f"| {name} | {_limit(experiment, name)} |" for name in keeps.limits] or [
            "| none | |"
        ]
        if keeps.distance is not None:
            rows.append(f"| distance from itself and from obstacles | {keeps.distance:g} m |")
        obstacles = ""
        if fields := self._scene:
            floor = (
                "touches one" if keeps.distance is None else f"is nearer than {keeps.distance:g} m"
            )
            obstacles = _OBSTACLES.format(floor=floor, first=fields[0].name)
        counts = "\n".join(
            f"| {_NAMES.get(name, f'`{name}`')} | {count} |"
            for name, count in sorted(operations.items(), key=lambda each: -each[1])
        )
        total = sum(operations.values())
        cost = (
            f"At most {total} operations: each loop is counted with its largest number of rounds."
        )
        if not self._body.is_bounded:
            cost = (
                f"{total} operations with one round of each loop without a largest number of "
                "rounds; such a loop has as many as the law's gains need."
            )
        measurements = "\n".join(f"    {line}" for line in report) or (
            "No C compiler was found when these files were made; nothing was measured."
        )
        return _README.format(
            title=self._title,
            rows="\n".join(rows),
            obstacles=obstacles,
            counts=counts,
            cost=cost,
            measurements=measurements,
        )


def _fields_of_scene(numbers: Numbers, solids: Solids | None) -> dict[str, Field]:
    """Return the field in C of each of a law's numbers, by its place.

    Numbers that the law has at several places, as are those of its parts, have one field.

    Args:
        numbers: The numbers.
        solids: The obstacles that they are of; None for none.
    """
    kinds = _names_of_kinds(solids)
    values, fields = numbers.of_reading(numbers.reading), dict[str, Field]()
    owners = dict[str, Array]()
    for place, part in numbers.places.items():
        head, _, tail = place.rpartition(".solids.")
        name, text = (
            _OF_OBSTACLES[tail] if head else (_HOME, "posture that the joints prefer [rad]")
        )
        if not np.array_equal(owners.setdefault(name, values[part]), values[part]):
            name = f"{name}_{len(fields)}"
        fields[place] = Field(name, numbers.shapes[place] or (1,), text.format(**kinds))
    return fields


def _names_of_kinds(solids: Solids | None) -> dict[str, str]:
    """Return the names of obstacles of each kind, in their order."""
    if solids is None:
        return {}
    counts = {"round": solids.radii, "boxes": solids.centers, "walls": solids.levels}
    names, texts = list(solids.names), {"all": ", ".join(solids.names)}
    for kind, each in counts.items():
        texts[kind], names = ", ".join(names[: len(each)]), names[len(each) :]
    return texts | {"cylinders": ", ".join(names)}


def _function(name: str) -> str:
    """Return the name in ``math.h`` of an operation; empty for none."""
    return name if name in LIBRARY.values() else ""


_NAMES = {
    "select": "choices",
    "double": "conversions to double",
    "int": "conversions to int",
    "max": "maxima",
    "min": "minima",
    "neg": "changes of sign",
    "not": "negations",
    "factors": "factorisations of a small matrix",
    "eigen": "eigenvalues of a small matrix",
}


def _join_names(names: Iterable[str]) -> str:
    return "".join(f", and {name}" for name in names)


def _struct(fields: Sequence[Field]) -> str:
    lines = []
    for field in fields:
        shape = f", {' x '.join(map(str, field.shape))}" if len(field.shape) > 1 else ""
        comment = _within_comment(field.comment) + shape
        lines.append(f"    double {field.name}[{field.size}]; /* {comment} */")
    return "\n".join(lines)


def _initializer(values: Array, fields: Sequence[Field]) -> str:
    parts, first = [], 0
    for field in fields:
        row = values[first : first + field.size]
        parts.append("{" + ", ".join(_number(value) for value in row) + "}")
        first += field.size
    return "{" + ", ".join(parts) + "}"


def _string(text: str) -> str:
    """Return a text as C has it, in UTF-8; what is not plain by its octal number."""
    entries = text.encode(errors="replace")
    plain = set(b" _-./") | {c for c in range(128) if chr(c).isalnum()}
    return '"' + "".join(chr(c) if c in plain else f"\\{c:03o}" for c in entries) + '"'


def _number(value: float) -> str:
    if np.isnan(value):
        return "NAN"
    if np.isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return repr(float(value))


def _limit(experiment: Experiment, name: str) -> str:
    """Return the numbers of a limit, with their unit."""
    limits, unit = experiment.limits, LIMIT_UNITS[name]
    if name == "position":
        low, high = limits.position_lower.tolist(), limits.position_upper.tolist()
        pairs = [f"{a:.4g} to {b:.4g}" for a, b in zip(low, high, strict=True)]
        return f"{'; '.join(pairs)} {unit}"
    if (bound := limits.bounds.get(name)) is None:
        return f"as the arm's limits say [{unit}]"
    values = [f"{value:.4g}" for value in bound]
    if limits.has_sides(name):
        values = [f"{-a:.4g} to {b:.4g}" for a, b in zip(*limits.sides(name), strict=True)]
    return f"{', '.join(values)} {unit}"


def _within_comment(text: str) -> str:
    """Return a text, with names of a user's own, as it may stand in a comment in C."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")


def _block_comment(text: str) -> str:
    lines = textwrap.wrap(_within_comment(text), 94)
    return "/* " + "\n * ".join(lines) + " */"


def _replay(folder: Path) -> list[str]:
    """Return what the program that replays the vector prints; nothing without a compiler.

    Raises:
        DrakeRnnError: If the compiler refuses the files, or the program finds another step than
            that of the vector, or ends before it has looked.
    """
    if (program := compiler()) is None:
        return []
    with TemporaryDirectory() as scratch:
        main = str(Path(scratch, "main"))
        files = [str(folder / "main.c"), str(folder / "law.c")]
        run_compiler([*program, *OPTIONS, "-o", main, *files, "-lm"], str(folder))
        try:
            replay = subprocess.run([main], capture_output=True, text=True, check=False)
        except OSError as error:
            raise InvalidInputError(
                f"compiled: {Path(program[0]).name} has written no program that runs here: "
                f"{error.strerror}; set CC to a C compiler"
            ) from None
    if replay.returncode != 0:
        what = "; ".join(replay.stdout.splitlines()) or "it printed nothing"
        raise DrakeRnnError(
            f"{folder}: the steps in C are not those of the test vector (status "
            f"{replay.returncode}): {what}"
        )
    return replay.stdout.splitlines()


_HEADER = """\
#ifndef LAW_H
#define LAW_H

{about}

#ifdef __cplusplus
extern "C" {{
#endif

/* Number of joints, in this order: {joints}. */
#define LAW_JOINTS {n}
extern const char *const law_joints[LAW_JOINTS];
{obstacles}/* Period [s]. */
#define LAW_PERIOD {period}

/* What the law remembers from sample to sample. */
typedef struct {{
{state}
}} law_state;

/* What is given at a sample. */
typedef struct {{
{signals}
}} law_signals;

typedef struct {{
    law_state state; /* the state after the sample */
{velocity}
}} law_output;

{scene}/* The state at the start of the experiment, for the posture in which it starts. */
extern const law_state law_initial;

/* Make one step. Returns 0, or 1 if a result is not finite, which is so only if something that
 * was given is not; then the arm must be stopped. The state may be that of out. */
int law_step(const law_state *state, const law_signals *signals, law_output *out);
{step_in}
#ifdef __cplusplus
}}
#endif

#endif
"""

_OBSTACLE_NAMES = """\
/* Number of obstacles that may move, which have the rows of p_WO in this order: {order}. */
#define LAW_OBSTACLES {count}
extern const char *const law_obstacles[LAW_OBSTACLES];
"""

_SCENE = """\
/* The obstacles: of each shape as many as in the experiment. */
typedef struct {{
{fields}
}} law_scene;

/* The obstacles of the experiment. */
extern const law_scene law_initial_scene;

"""

_STEP_IN = """
/* The same among other obstacles; law_step is among law_initial_scene. */
int law_step_in(const law_scene *scene, const law_state *state, const law_signals *signals,
                law_output *out);

/* Call this whenever the scene is another one, also for law_initial, with the arm at rest: a state
 * keeps distances of the scene before, and the next step then looks at all of them anew. */
void law_look(law_state *state);
"""

_STEP = """
int law_step(const law_state *state, const law_signals *signals, law_output *out)
{
    return law_step_in(&law_initial_scene, state, signals, out);
}
"""

_LOOK = """
void law_look(law_state *state)
{{
{loops}
}}
"""

_SOURCE = """\
{about}

#include "law.h"

#include <math.h>

#ifdef __FAST_MATH__
#error "fast math reorders sums and removes the checks of what is not finite"
#endif

{names}const law_state law_initial = {initial};

{scene}{helpers}int {step}const law_state *state, const law_signals *signals, law_output *out)
{{
{body}
    double odd = 0.0;
    const double *all = (const double *)out;
    for (unsigned k = 0; k < sizeof(*out) / sizeof(double); ++k) {{
        odd += all[k] - all[k];
    }}
    return odd == 0.0 ? 0 : 1;
}}
{in_scene}"""

_VECTOR = """\
{about}

#ifndef VECTOR_H
#define VECTOR_H

#include "law.h"

#define SAMPLES {samples}

static const law_signals given[SAMPLES] = {{
{given}
}};

static const law_output expected[SAMPLES] = {{
{expected}
}};

#endif
"""

_MAIN = """\
/* Replays the test vector, from the state that is expected before each sample, and measures. */

#define _POSIX_C_SOURCE 199309L

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "law.h"
#include "vector.h"

#define TURNS 50
/* A step may be another by this [rad], */
#define WORST 1e-12
/* or by so many times what it changes by where all that is given is changed by its rounding: a law
 * that solves a system of a large condition number makes much of little. */
#define ROUNDINGS 10.0

static double costs[TURNS * SAMPLES];

static double largest(const double *a, const double *b, size_t count)
{
    double most = 0.0;
    for (size_t k = 0; k < count; ++k) {
        const double off = fabs(a[k] - b[k]);
        most = off > most || off != off ? off : most;
    }
    return most;
}

static void change_rounding(double *a, size_t count)
{
    static unsigned long bits = 1;
    for (size_t k = 0; k < count; ++k) {
        bits = (1664525ul * bits + 1013904223ul) & 0xffffffff;
        a[k] += (bits >> 31 ? DBL_EPSILON : -DBL_EPSILON) * a[k];
    }
}

static double seconds(void)
{
#ifdef CLOCK_MONOTONIC
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
#else
    return (double)clock() / CLOCKS_PER_SEC;
#endif
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(void)
{
    double of_velocity = 0.0, of_state = 0.0, of_rounding = 0.0;
    int failures = 0;
    law_output out, near;
    for (int k = 0; k < SAMPLES; ++k) {
        const law_state *before = k == 0 ? &law_initial : &expected[k - 1].state;
        failures += law_step(before, &given[k], &out);
        const double v = largest(out.velocity, expected[k].velocity, LAW_JOINTS);
        const double x = largest((const double *)&out.state, (const double *)&expected[k].state,
                                 sizeof(law_state) / sizeof(double));
        of_velocity = v > of_velocity || v != v ? v : of_velocity;
        of_state = x > of_state || x != x ? x : of_state;
        law_state state = *before;
        law_signals signals = given[k];
        change_rounding((double *)&state, sizeof(state) / sizeof(double));
        change_rounding((double *)&signals, sizeof(signals) / sizeof(double));
        law_step(&state, &signals, &near);
        const double r = largest(out.velocity, near.velocity, LAW_JOINTS);
        of_rounding = r > of_rounding ? r : of_rounding;
    }
    printf("samples %d, of which %d are not finite\\n", SAMPLES, failures);
    printf("largest difference of a joint per sample %.3g rad, of the state %.3g\\n",
           LAW_PERIOD * of_velocity, of_state);
    printf("where what is given is rounded otherwise: %.3g rad\\n", LAW_PERIOD * of_rounding);
    for (int turn = 0; turn < TURNS; ++turn) {
        for (int k = 0; k < SAMPLES; ++k) {
            const double begin = seconds();
            law_step(k == 0 ? &law_initial : &expected[k - 1].state, &given[k], &out);
            costs[turn * SAMPLES + k] = 1e6 * (seconds() - begin);
        }
    }
    qsort(costs, TURNS * SAMPLES, sizeof(double), compare);
    printf("time of a step: median %.2f us, 99.9 %% %.2f us, worst %.2f us\\n",
           costs[TURNS * SAMPLES / 2], costs[TURNS * SAMPLES / 1000 * 999],
           costs[TURNS * SAMPLES - 1]);
    const double most = fmax(WORST, LAW_PERIOD * ROUNDINGS * of_rounding);
    return failures == 0 && LAW_PERIOD * of_velocity <= most ? 0 : 1;
}
"""

_CMAKE = """\
cmake_minimum_required(VERSION 3.10)
project(law C)
set(CMAKE_C_STANDARD 99)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
add_library(law STATIC law.c)
set_target_properties(law PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories(law PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_compile_options(law PRIVATE -Wall -Wextra -Wpedantic -ffp-contract=off)
find_library(MATH m)
if(MATH)
  target_link_libraries(law PUBLIC ${MATH})
endif()
add_executable(replay main.c)
target_link_libraries(replay law)
enable_testing()
add_test(NAME replay COMMAND replay)
"""

_OBSTACLES = """\
## Obstacles

`law_step` keeps clear of the experiment's obstacles. Others, as many of each shape, are given to
`law_step_in`, without compiling anything anew:

```c
law_scene scene = law_initial_scene;
scene.{first}[0] += 0.05; /* law.h says what each number is */
law_look(&out.state);
/* every LAW_PERIOD, in place of law_step: */
law_step_in(&scene, &out.state, &signals, &out)
```

Change them while the arm rests, and only so that no part of it {floor}; then call `law_look`, for
the state keeps distances. One that moves needs `speed` in the experiment; how far it has gone is
then a signal.

"""

_README = """\
# A law in C

{title}

| file | what it is |
|---|---|
| `law.h`, `law.c` | the step, in C99, and its inputs and outputs |
| `main.c`, `vector.h` | a program that replays a test vector and prints the largest difference |
| `CMakeLists.txt` | builds both |

```sh
cmake -S . -B build
cmake --build build
build/replay
```

In a loop of one's own:

```c
law_output out = {{law_initial, {{0.0}}}};
law_signals signals;
/* every LAW_PERIOD: */
/* ... fill in signals ... */
if (law_step(&out.state, &signals, &out) != 0) {{
    /* stop the arm */
}}
/* ... command out.velocity ... */
```

## Limits

The command keeps these by construction, whatever the signals are, if the arm starts at rest within
them and the period is kept.

| limit | values |
|---|---|
{rows}

{obstacles}## Cost

{cost}

| operation | count |
|---|---|
{counts}

Where these files were made, `build/replay` printed:

{measurements}
"""

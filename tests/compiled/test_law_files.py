"""Laws as files in C, and their test."""

import re
import shutil
import subprocess

import pytest
from cli_helpers import call

from drake_rnn import InvalidInputError, law_files, load_experiment
from drake_rnn.compiled.library import compiler
from drake_rnn.errors import DrakeRnnError
from drake_rnn.law_files import FILES, OPTIONS, write_law
from drake_rnn.signals import input_description, state_description

pytest.importorskip("jax")
pytestmark = pytest.mark.skipif(compiler() is None, reason="needs a C compiler")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("law")
    write_law("slc_nephroid_known", place, samples=200)
    return place


def build(folder, scratch, *options, by=None):
    """Return the program that replays the test vector, built without a warning."""
    program = scratch / "replay"
    files = [str(folder / "main.c"), str(folder / "law.c")]
    command = [*([by] if by else compiler()), *OPTIONS, *options, "-o", str(program), *files, "-lm"]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return program


def replay(*command):
    process = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    return process.returncode, process.stdout + process.stderr


def test_the_files_replay_their_test_vector(folder, tmp_path):
    """From Drake's kinematics and NumPy's law to those in C: rounding."""
    assert {each.name for each in folder.iterdir()} == set(FILES)
    code, output = replay(build(folder, tmp_path))
    assert code == 0, output
    assert "samples 200, of which 0 are not finite" in output
    off = float(re.search(r"largest difference of a joint per sample (\S+) rad", output)[1])
    assert off < 1e-15
    assert output.splitlines()[1] in (folder / "README.md").read_text()


@pytest.mark.long
def test_a_stream_with_gaps_replays_its_test_vector(tmp_path):
    """Most of its samples have no target, which is no number."""
    changes = {"obstacles": None, "limits.jerk": None, "law.timeout": 0.1}
    write_law(load_experiment("stream_guarded", changes), tmp_path, samples=200)
    assert "NAN" in (tmp_path / "vector.h").read_text()
    code, output = replay(build(tmp_path, tmp_path))
    assert code == 0, output
    assert "samples 200, of which 0 are not finite" in output


def test_a_wrong_vector_is_seen(folder, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    text = (other / "law.c").read_text()
    gain = re.search(r"\* (\d+\.\d{3,})", text)[1]
    (other / "law.c").write_text(text.replace(gain, gain + "1", 1))
    (other / "law.c").write_text(text.replace(" - ", " + ", 1))
    assert replay(build(other, tmp_path))[0] == 1


@pytest.mark.long
def test_rounding_is_compared_with_what_the_law_makes_of_it(tmp_path):
    """The law solves I + J^T J / softness, whose condition number is 1e7 for an arm of metres.

    Its steps in C differ by 1.5e-12 rad; before, it was refused for more than 1e-12.
    """
    places = ("-0.662 0.935 0.049", "2.002 0.189 -0.633", "-0.378 -1.091 -1.278")
    joints = "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="revolute"><origin xyz="{place}"/>'
        f'<parent link="l{k - 1}"/><child link="l{k}"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" velocity="2" effort="9"/></joint>'
        for k, (place, axis) in enumerate(zip(places, ("1 0 0", "0 1 0", "0 1 0"), strict=True), 1)
    )
    end = '<link name="tip"/><joint name="end" type="fixed"><origin xyz="0.63 0.581 1.295"/>'
    (tmp_path / "three.urdf").write_text(
        f'<robot name="three"><link name="l0"/>{joints}{end}<parent link="l3"/>'
        '<child link="tip"/></joint></robot>'
    )
    document = {
        "arm": {"model": str(tmp_path / "three.urdf"), "frame": "tip"},
        "start": [-0.75, 1.69, -0.29],
        "path": {"kind": "circle", "size": 0.1, "period": 2.0},
        "law": {"kind": "adaptive"},
        "limits": {"velocity": 1.0, "acceleration": 5.0},
        "period": 0.05,
        "duration": 2.0,
    }
    samples, off, rounding, _ = write_law(document, tmp_path)
    assert samples == "samples 40, of which 0 are not finite"
    off, rounding = (float(re.search(r"(\S+) rad", line)[1]) for line in (off, rounding))
    assert off < 1e-11
    assert off < 10 * rounding < 1e-10


SANITIZERS = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.mark.long
def test_no_sanitizer_finds_fault(folder, tmp_path):
    try:
        program = build(folder, tmp_path, *SANITIZERS)
    except subprocess.CalledProcessError:
        pytest.skip("the compiler has no sanitizers")
    assert replay(program)[0] == 0


#: A ball beside a stream of joint targets, and where it is moved to.
BALL = {"kind": "ball", "radius": 0.04, "name": "*/ ball"}
PLACES = [0.307, -0.24, 0.59], [1.5, 1.5, 0.5]


def guarded_stream(place):
    ball = [BALL | {"center": place}]
    return load_experiment("stream_guarded", {"obstacles": ball, "limits.jerk": None})


@pytest.fixture(scope="module")
def among(tmp_path_factory):
    """A folder of the law with its ball far away."""
    folder = tmp_path_factory.mktemp("among")
    write_law(guarded_stream(PLACES[1]), folder, samples=800)
    return folder


#: Follows a vector three times from the start of the law in one go: among the obstacles of a scene
#: that it looks at, of that which it does not look at, and of its own. It is compiled once.
FOLLOW = """
#include <math.h>
#include <stdio.h>

#include "law.h"
#include "vector.h"

static const law_scene scene = {scene};

static void follow(const law_scene *among, int looks)
{{
    law_output out = {{law_initial, {{0.0}}}};
    double most = 0.0;
    if (looks) {{
        law_look(&out.state);
    }}
    for (int k = 0; k < SAMPLES; ++k) {{
        law_step_in(among, &out.state, &given[k], &out);
        for (int i = 0; i < LAW_JOINTS; ++i) {{
            const double off = fabs(out.velocity[i] - expected[k].velocity[i]);
            most = off <= most ? most : off;
        }}
    }}
    printf("%g\\n", most);
}}

int main(void)
{{
    follow(&scene, 1);
    follow(&scene, 0);
    follow(&law_initial_scene, 0);
    return 0;
}}
"""


@pytest.mark.long
def test_an_obstacle_is_moved_without_compiling_the_law_again(among, tmp_path):
    """The law of one scene moves as that of another one, where the arm passes a ball after 3 s.

    It does so if it is given that scene and told to look at it.
    """
    there = law_files._Law(guarded_stream(PLACES[0])).files(samples=800)
    pattern = r"^const law_scene law_initial_scene = (.*);$"
    scene = re.search(pattern, there["law.c"], re.MULTILINE)[1]
    (tmp_path / "law.c").write_text((among / "law.c").read_text())
    (tmp_path / "law.h").write_text((among / "law.h").read_text())
    (tmp_path / "vector.h").write_text(there["vector.h"])

    (tmp_path / "main.c").write_text(FOLLOW.format(scene=scene))
    code, output = replay(build(tmp_path, tmp_path, "-O0"))
    assert code == 0
    looked, unseen, elsewhere = map(float, output.split())
    assert looked < 1e-9
    assert unseen > 1e-2
    assert elsewhere > 1e-2


@pytest.mark.long
def test_the_header_says_where_each_obstacle_is(among):
    header = (among / "law.h").read_text()
    assert "double round_ends[6]; /* both ends of the axis of * / ball, of a ball its" in header
    assert "double round_radii[1]; /* radii of the same [m] */" in header
    assert "law_step_in(const law_scene *scene, const law_state *state," in header
    assert "/* lower bounds of the distances of pairs [m] */" in header
    readme = (among / "README.md").read_text()
    assert "scene.round_ends[0] += 0.05;" in readme
    assert "no part of it is nearer than 0.005 m" in " ".join(readme.split())


NAMES = """
#include <stdio.h>

#include "law.h"

int main(void)
{
    for (int k = 0; k < LAW_JOINTS; ++k) { puts(law_joints[k]); }
    for (int k = 0; k < LAW_OBSTACLES; ++k) { puts(law_obstacles[k]); }
    return 0;
}
"""


@pytest.mark.long
def test_the_files_name_joints_and_obstacles_in_the_order_of_their_list(tmp_path):
    """A box before a ball, whose shape comes first, and a name that is no word of C."""
    box = {"kind": "box", "name": 'a "b\\ü"??/', "center": [2, 2, 0.5], "size": [0.1] * 3}
    things = [{**box, "speed": 0.1}, BALL | {"center": PLACES[1], "speed": 0.1}]
    changes = {"obstacles": things, "limits.jerk": None}
    experiment = load_experiment("stream_guarded", changes)
    texts = law_files._Law(experiment).files(samples=2)
    for name in ("law.c", "law.h"):
        (tmp_path / name).write_text(texts[name])
    (tmp_path / "main.c").write_text(NAMES)
    code, output = replay(build(tmp_path, tmp_path, "-O0"))
    assert code == 0
    assert output.splitlines() == [*experiment.arm.joints, box["name"], BALL["name"]]
    assert f"{box['name']}, * / ball" in texts["law.h"]


@pytest.mark.long
def test_what_has_no_obstacles_has_no_scene(folder):
    assert "scene" not in (folder / "law.h").read_text() + (folder / "law.c").read_text()
    assert "## Obstacles" not in (folder / "README.md").read_text()


#: Laws that look at pairs: balls, capsules and boxes, also with the jerk bounded or with a learned
#: Jacobian; one that moves; a law that knows of none, made safe; joint targets behind a guard.
AMONG_OBSTACLES = {
    "rows": ("adaptive_obstacles", {}),
    "rows, jerk": ("adaptive_obstacles", {"limits.jerk": 20.0}),
    "rows, J learned": ("adaptive_obstacles", {"law.jacobian": "learned"}),
    "moving": ("adaptive_moving_obstacle", {}),
    "safety": ("slc_nephroid_guarded", {}),
    "guard": ("stream_guarded", {}),
    "guard, jerk": ("stream_guarded", {"limits.jerk": 100.0}),
}


@pytest.mark.nightly
@pytest.mark.parametrize("kind", AMONG_OBSTACLES)
def test_laws_among_obstacles_replay_their_test_vectors(kind, tmp_path):
    """Also with sanitizers, and on aarch64 where its compiler and an emulator are."""
    name, changes = AMONG_OBSTACLES[kind]
    write_law(load_experiment(name, {**changes, "accept": None}), tmp_path, samples=200)
    assert replay(build(tmp_path, tmp_path, *SANITIZERS))[0] == 0
    cross, emulator = map(shutil.which, ("aarch64-linux-gnu-gcc", "qemu-aarch64"))
    if cross and emulator:
        program = build(tmp_path, tmp_path, "-static", by=cross)
        assert replay(emulator, program)[0] == 0


def test_what_is_not_finite_is_told(folder, tmp_path):
    """A position that is no number: the step says so, and keeps no number of it."""
    text = (folder / "vector.h").read_text()
    first = text.index("{", text.index("given[SAMPLES] = {") + len("given[SAMPLES] = {"))
    bad_text = text[:first] + re.sub(r"-?\d[\d.e+-]*", "NAN", text[first:], count=1)
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    (other / "vector.h").write_text("#include <math.h>\n" + bad_text)
    code, output = replay(build(other, tmp_path))
    assert code == 1
    assert "of which 1 are not finite" in output


def test_the_header_says_what_each_signal_is(folder):
    header = (folder / "law.h").read_text()
    experiment = load_experiment("slc_nephroid_known")
    for line in (
        "double position[7]; /* joint positions, as measured or as commanded [rad] */",
        "double p_WE_desired[3]; /* desired position of the end effector, in W [m] */",
        "double v_WE_desired[3]; /* desired velocity of the end effector, in W [m/s] */",
        "double v[7]; /* joint velocities that the law commands [rad/s] */",
        "#define LAW_JOINTS 7",
        "#define LAW_PERIOD 0.001",
    ):
        assert line in header
    # Kinematics are in the step; of signals of one's own the unit is not known.
    assert input_description("p_preview").endswith("effector, one period ahead, in W [m]")
    assert input_description("wind") == "input of the law; its unit is not declared"
    assert state_description("wind") == "memory of the law"
    assert state_description("a") == "joint accelerations that the law commands [rad/s^2]"
    assert " J[" not in header
    assert " p_WE[" not in header
    words = " ".join(header.replace("*", " ").split())
    assert all(joint in words for joint in experiment.arm.joints)


def test_the_text_allocates_nothing_and_has_no_state_of_its_own(folder):
    text = (folder / "law.c").read_text()
    assert not re.search(r"\b(malloc|calloc|free|alloca)\b", text)
    assert not re.search(r"^(static )?(double|int) \w+( =|\[|;)", text, re.MULTILINE)
    assert re.findall(r"#include <(.*)>", text) == ["math.h"]


def test_the_readme_says_which_limits_hold(folder):
    text = (folder / "README.md").read_text()
    assert re.search(r"\| velocity \| .* rad/s \|", text)
    assert "| jerk |" not in text


def test_the_command_writes_them_and_says_what_the_test_has_shown(tmp_path):
    place = tmp_path / "law"
    done = call("compile", "pinv_circle", "--to", place, "--samples", "20")
    assert done.exit_code == 0, done.stderr
    assert "samples 20, of which 0 are not finite" in done.stdout
    assert {each.name for each in (tmp_path / "law").iterdir()} == set(FILES)


def test_what_has_no_period_is_refused(tmp_path):
    with pytest.raises(
        InvalidInputError, match="integrator: is Drake's; a compiled law is sampled: give a"
    ):
        write_law("slc_nephroid_known_continuous", tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_step_that_is_not_that_of_the_vector_is_an_error(tmp_path, monkeypatch):
    """The replay looks: one sign in the sum of a step is another."""
    source = law_files._Law._source
    monkeypatch.setattr(
        law_files._Law, "_source", lambda law, start: source(law, start).replace(" + ", " - ", 40)
    )
    with pytest.raises(DrakeRnnError, match="the steps in C are not those of the test vector"):
        write_law("pinv_line", tmp_path, samples=20)
    assert (tmp_path / "law.c").is_file()


def test_what_is_no_regular_file_is_not_replaced(tmp_path):
    (tmp_path / "law.h").symlink_to(tmp_path / "mine.h")
    with pytest.raises(InvalidInputError, match="--to"):
        write_law("pinv_line", tmp_path, samples=20)
    assert not (tmp_path / "law.c").exists()

"""A folder of a result, read where the arm, the law and the path of its run are not."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
import trimesh

from drake_rnn import InvalidInputError, Result, load_experiment, simulate
from process_helpers import PATIENCE

LAW = '''
from functools import cached_property
from typing import Annotated
import numpy as np
from drake_rnn import JointLimits, Layout, Meaning, SampledLaw, validated

@validated
class Transpose(SampledLaw):
    """Joint velocities along the transpose of J."""

    limits: Annotated[JointLimits, Meaning("Limits of the joints.")]
    gain: Annotated[float, Meaning("Gain.", unit="1/s")] = 4.0

    @cached_property
    def state(self):
        return Layout(v=(self.limits.size,), z=(2,))

    @cached_property
    def inputs(self):
        return Layout(p_WE=(3,), J=(3, self.limits.size), p_WE_desired=(3,), v_WE_desired=(3,))

    def step(self, t, x, u, period):
        error = u["v_WE_desired"] + self.gain * (u["p_WE_desired"] - u["p_WE"])
        return self.state.join(np.linalg.pinv(u["J"]) @ error, np.full(2, t))
'''

LINK = """
  <link name="l{k}">
    <inertial><origin xyz="0.15 0 0"/><mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <visual><geometry><mesh filename="{mesh}"/></geometry></visual>
    <collision><origin xyz="0.15 0 0" rpy="0 1.5707963 0"/>
      <geometry><cylinder radius="0.03" length="0.2"/></geometry></collision>
  </link>
  <joint name="j{k}" type="revolute">
    <parent link="{parent}"/><child link="l{k}"/>
    <origin xyz="{x} 0 0"/><axis xyz="{axis}"/>
    <limit lower="-2.5" upper="2.5" velocity="2" effort="50"/>
  </joint>"""

DOCUMENT = """
name: cell
arm: {model: support/urdf/cell.urdf, frame: l4, home: [0.3, 0.6, -0.8, 0.5]}
law: {kind: "transpose_law:Transpose"}
path: {kind: waypoints, file: targets.csv}
obstacles: [{kind: ball, center: [1.5, 1.5, 1.5], radius: 0.1}]
period: 1e-2
duration: 0.1
"""


def make_cell(folder):
    """Write a robot with meshes in a package, a law, a path and a document that names them."""
    (folder / "support/urdf").mkdir(parents=True)
    (folder / "support/meshes").mkdir()
    (folder / "support/package.xml").write_text("<package><name>cell_support</name></package>")
    box = trimesh.creation.box((0.3, 0.04, 0.04))
    for name in ("one.stl", "two.stl"):
        box.export(folder / "support/meshes" / name)
    names = ("package://cell_support/meshes/one.stl", "../meshes/two.stl")
    axes = ("0 0 1", "0 1 0", "0 1 0", "0 0 1")
    links = [
        LINK.format(k=k, mesh=names[k % 2], parent=f"l{k - 1}", x=0.3 * (k > 1), axis=axes[k - 1])
        for k in range(1, 5)
    ]
    model = f'<robot name="cell"><link name="l0"/>{"".join(links)}</robot>'
    (folder / "support/urdf/cell.urdf").write_text(model)
    (folder / "transpose_law.py").write_text(LAW)
    (folder / "targets.csv").write_text("t,x,y,z\n0,0,0,0\n0.1,0,0.002,0.001\n")
    (folder / "cell.yaml").write_text(DOCUMENT)


@pytest.fixture(scope="module")
def there(tmp_path_factory):
    """The folder of a run, copied to where nothing is that the run has read."""
    made, there = tmp_path_factory.mktemp("made"), tmp_path_factory.mktemp("there")
    make_cell(made)
    sys.path.insert(0, str(made))
    try:
        result = simulate(load_experiment(made / "cell.yaml"))
        result.save(made / "out")
        np.save(there / "position.npy", result.series["position"])
    finally:
        sys.path.remove(str(made))
        del sys.modules["transpose_law"]
    shutil.copytree(made / "out", there / "cell")
    shutil.rmtree(made)
    return there


def test_the_folder_encloses_the_files_and_says_what_the_law_is(there):
    document = (there / "cell/experiment.yaml").read_text()
    assert "inputs/arm.model/cell.urdf" in document
    assert "inputs/path.file/targets.csv" in document
    assert "/tmp" not in "\n".join(x for x in document.splitlines() if x[:1] != "#")
    told = json.loads((there / "cell/inputs/inputs.json").read_text())
    meshes = [each["source"] for each in told["files"] if each["key"] == "arm.model: meshes"]
    assert sorted(meshes) == ["one.stl", "two.stl"]
    assert told["left_out"] == {}
    assert told["stand_ins"]["law"]["state"] == {"v": [4], "z": [2]}


def test_it_is_loaded_with_its_numbers_bit_for_bit(there):
    with pytest.warns(UserWarning, match="law.kind: is in the module 'transpose_law'"):
        result = Result.load(there / "cell")
    np.testing.assert_array_equal(result.series["position"], np.load(there / "position.npy"))
    # The arm is the same, with its meshes and shapes.
    arm = result.experiment.arm
    assert arm.warnings == ()
    assert arm.name == "cell"
    assert result.experiment.clearance is not None
    # What the law said is known, and what it computed is not.
    assert type(result.experiment.law).__name__ == "Transpose"
    with pytest.raises(InvalidInputError, match="Transpose is not known here"):
        simulate(result.experiment)


def test_it_is_saved_again_as_it_was(there, tmp_path):
    with pytest.warns(UserWarning, match="the saved "):
        Result.load(there / "cell").save(tmp_path / "again")
    files = [p.relative_to(there / "cell") for p in (there / "cell").rglob("*") if p.is_file()]
    for file in files:
        assert (tmp_path / "again" / file).is_file(), file
    for name in ("experiment.yaml", "metrics.json", "inputs/arm.model/cell.urdf"):
        assert (tmp_path / "again" / name).read_bytes() == (there / "cell" / name).read_bytes()


@pytest.mark.filterwarnings("ignore:.*the saved ")
def test_a_copy_that_was_changed_is_told(there, tmp_path):
    shutil.copytree(there / "cell", tmp_path / "cell")
    (tmp_path / "cell/inputs/path.file/targets.csv").write_text("t,x,y,z\n0,0,0,0\n0.1,0,0,0\n")
    with pytest.warns(UserWarning, match=r"csv: is not what the run has read; it was changed"):
        Result.load(tmp_path / "cell")


def test_a_file_that_is_missing_is_named_and_may_be_given(there, tmp_path):
    shutil.copytree(there / "cell", tmp_path / "cell")
    shutil.move(tmp_path / "cell/inputs/arm.model", tmp_path / "elsewhere")
    with pytest.raises(InvalidInputError) as refused:
        Result.load(tmp_path / "cell")
    assert str(refused.value).endswith(
        "experiment.yaml: arm.model: no file 'inputs/arm.model/cell.urdf'; say where it is now: "
        "--set arm.model=FILE, in Python files={'arm.model': FILE}"
    )
    files = {"arm.model": tmp_path / "elsewhere/cell.urdf"}
    with pytest.warns(UserWarning, match="the saved "):
        result = Result.load(tmp_path / "cell", files=files)
    assert result.experiment.arm.n == 4
    with pytest.raises(InvalidInputError, match=r"law\.gain: of a saved result only the files can"):
        Result.load(tmp_path / "cell", files={"law.gain": 3})


CALLS = """
import sys
from pathlib import Path
from typer.testing import CliRunner
from drake_rnn.cli.commands import app
import warnings
for call in (
    ["plot", "cell", "--only", "overview", "--only", "motion"],
    ["replay", "cell"],
    ["export", "cell", "--format", "csv"],
    ["compare", "cell", "other", "--out", "out"],
    ["figure", "compare", "cell", "other", "--to", "figure.png"],
):
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, (call, done.stdout, done.stderr, done.exception)
    assert "Transpose" in done.stderr or "transpose_law" in done.stderr
"""


@pytest.mark.long
def test_a_folder_without_its_inputs_names_one_cause(there, tmp_path):
    """The law's module is missing here too; the model, which is not read, is not named."""
    shutil.copytree(there / "cell", tmp_path / "cell")
    shutil.rmtree(tmp_path / "cell/inputs")
    with pytest.raises(InvalidInputError) as refused:
        Result.load(tmp_path / "cell")
    message = str(refused.value)
    assert "experiment.yaml: law.kind: " in message
    assert message.endswith(
        "; inputs, where the run has kept what stands for it, is missing in the folder"
    )


@pytest.mark.long
def test_six_of_six_read_it_where_nothing_else_is(there, tmp_path):
    for name in ("cell", "other"):
        shutil.copytree(there / "cell", tmp_path / name)
    run = subprocess.run(
        [sys.executable, "-c", CALLS],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    written = {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*")}
    assert {"cell/playback.html", "cell/figures/overview.png", "figure.png"} <= written
    assert "mesh" in (tmp_path / "cell/playback.html").read_text()

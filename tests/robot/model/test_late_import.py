"""Large modules are imported when a model needs them, not before."""

import subprocess
import sys

import pytest

CODE = """
import sys
import drake_rnn
assert "trimesh.base" not in sys.modules
assert drake_rnn.load_arm("panda").n == 7
assert "trimesh.base" not in sys.modules
import trimesh
assert trimesh.creation.box().volume == 1.0
from drake_rnn.robot.model import meshes
assert meshes.trimesh.Trimesh is trimesh.Trimesh
"""


@pytest.mark.long
def test_meshes_cost_nothing_until_they_are_converted():
    subprocess.run([sys.executable, "-c", CODE], check=True)

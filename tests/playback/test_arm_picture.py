"""Pictures of arms, looked at pixel by pixel."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from drake_rnn import InvalidInputError, load_arm
from drake_rnn.models import MODELS
from drake_rnn.playback import arm_drawing
from drake_rnn.playback.arm_drawing import rendering_fault, write_arm_picture


def pixels(arm, q, folder):
    with Image.open(write_arm_picture(arm, q, folder / "new" / "arm.png")) as image:
        return np.asarray(image).astype(int)


def share(image, channel):
    """Share of pixels that are mainly of one colour."""
    others = [other for other in range(3) if other != channel]
    return (image[..., channel] - image[..., others].max(axis=-1) > 60).mean()


def test_a_machine_without_egl_is_named_before_drake_ends_the_process(tmp_path, monkeypatch):
    def none_installed(name):
        raise OSError(name)

    assert not rendering_fault()
    monkeypatch.setattr(arm_drawing.ctypes, "CDLL", none_installed)
    with pytest.raises(InvalidInputError, match="apt-get install libegl1 libgl1-mesa-dri"):
        write_arm_picture(load_arm("planar6"), np.zeros(6), tmp_path / "arm.png")
    assert not list(tmp_path.iterdir())


def test_the_arm_fills_the_picture_and_its_task_frame_has_three_colours(tmp_path):
    arm = load_arm("iiwa14", frame="tip")
    image = pixels(arm, arm.home, tmp_path)
    shown = (np.abs(image - image[0, 0]).max(axis=-1) > 10).mean()
    assert 0.1 < shown < 0.9
    for channel in (1, 2):
        assert 1e-4 < share(image, channel) < 0.02
    edge = np.concatenate((image[0], image[-1], image[:, 0], image[:, -1]))
    assert (edge == image[0, 0]).all()


def test_a_tool_that_is_added_is_seen(tmp_path):
    """It has a red ball, which on an arm without colours is most of what is red."""
    arm = load_arm(str(MODELS / "ur5" / "ur5.urdf"), frame="tool0")
    q = np.array([0.0, -1.2, 1.6, -2.0, -1.57, 0.0])
    bare = share(pixels(arm, q, tmp_path), 0)
    assert share(pixels(arm.replace(tool={"ball": 0.05}), q, tmp_path), 0) > bare + 2e-3


CORNERS = "v 0 0 0\nv 0.3 0 0\nv 0 0.3 0\nv 0 0 0.3\n"
#: OBJ files that Drake's renderer does not draw as they are; the last one would end the process.
MESHES = {
    "no normals": "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "some normals": "vn 0 0 1\nf 1//1 3//1 2//1\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "no such normals": "vn 0 0 1\nf 1//9 3//9 2//9\nf 1//1 2//1 4//1\nf 2//1 3//1 4//1\n",
    "faces on two lines": "vn 0 0 1\nf 1//1 3//1 \\\n 2//1\nf 1//1 2//1 4//1\nf 2//1 3//1 4//1\n",
    "no such textures": "vn 0 0 1\nf 1/1/1 3/1/1 2/1/1\nf 1/1/1 2/1/1 4/1/1\nf 2/1/1 3/1/1 4/1/1\n",
}


@pytest.mark.parametrize("faces", [None, *MESHES.values()], ids=["STL", *MESHES])
def test_meshes_without_normals_are_seen(tmp_path, faces):
    """They are green, in a model of MuJoCo; Drake's renderer refused them."""
    if faces is None:
        trimesh.creation.box((0.2, 0.2, 0.2)).export(tmp_path / "m.stl")
    else:
        (tmp_path / "m.obj").write_text(CORNERS + faces)
    (tmp_path / "m.xml").write_text(
        f'<mujoco><asset><mesh name="m" file="m.{"stl" if faces is None else "obj"}"/></asset>'
        '<worldbody><body><joint name="j" axis="0 0 1" range="-2 2" limited="true"/>'
        '<geom type="mesh" mesh="m" mass="1" rgba="0 1 0 1"/><body pos="0 0 .3"><joint name="k" '
        'axis="0 1 0" range="-2 2" limited="true"/><geom type="mesh" mesh="m" mass="1" '
        'rgba="0 1 0 1"/><site name="s" pos="0 0 .2"/></body></body></worldbody></mujoco>'
    )
    arm = load_arm(tmp_path / "m.xml", frame="s")
    assert not [told for told in arm.warnings if "cannot be read" in told]
    assert share(pixels(arm, np.array([0.0, 0.3]), tmp_path), 1) > 0.05


def test_a_folder_that_cannot_be_written_to_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    arm = load_arm("planar6")
    with pytest.raises(InvalidInputError, match=r"^picture: .*arm\.png: "):
        write_arm_picture(arm, arm.home, tmp_path / "file" / "arm.png")

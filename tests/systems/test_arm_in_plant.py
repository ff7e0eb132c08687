"""Arms in a plant of a user's own: where they stand, how they are moved, and what is refused."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    AddLoop,
    ArmInPlant,
    Circle,
    InvalidInputError,
    PathSource,
    PlantArm,
    Pseudoinverse,
    SampledController,
    add_motors,
    load_arm,
)

X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, 2.0), [1.0, -0.5, 0.25])
PERIOD = 1e-3
FREE_BASE = """
<robot name="free"><link name="base"/><link name="arm">
  <inertial><mass value="1"/>
  <inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial>
</link><joint name="j" type="revolute"><parent link="base"/><child link="arm"/>
<origin xyz="0.1 0.2 0.3"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/>
</joint></robot>"""


def placed(plant, instance, arm):
    """Pose of E in the world, at the plant's default posture."""
    context = plant.CreateDefaultContext()
    return plant.GetFrameByName(arm.frame, instance).CalcPoseInWorld(context)


@pytest.mark.parametrize("name", ["panda", "ur5", "planar6", "free"])
def test_an_arm_stands_where_it_is_put_and_twice_at_two_places(name, tmp_path):
    (tmp_path / "free.urdf").write_text(FREE_BASE)
    arm = load_arm(tmp_path / "free.urdf", frame="arm") if name == "free" else load_arm(name)
    alone, plant = arm.plant(), MultibodyPlant(1e-3)
    instances = [arm.add_to(plant, X) for X in (X_WB, None, X_WB.inverse())]
    plant.Finalize()
    X_BE = placed(alone, alone.GetJointByName(arm.joints[0]).model_instance(), arm)
    for instance, X in zip(instances, (X_WB, RigidTransform(), X_WB.inverse()), strict=True):
        assert placed(plant, instance, arm).IsNearlyEqualTo(X @ X_BE, 1e-12)
    # Nothing is left that could fall.
    assert plant.num_positions() == 3 * arm.n


def test_what_moves_at_the_world_itself_cannot_be_put_elsewhere(tmp_path):
    model = FREE_BASE.replace('link name="base"', 'link name="world"').replace(
        'parent link="base"', 'parent link="world"'
    )
    (tmp_path / "fixed.urdf").write_text(model)
    arm = load_arm(tmp_path / "fixed.urdf", frame="arm")
    arm.add_to(MultibodyPlant(1e-3))
    with pytest.raises(InvalidInputError, match=r"^X_WB: the model fixes 'j', which moves, to"):
        arm.add_to(MultibodyPlant(1e-3), X_WB)


def path_of(arm):
    circle = Circle(size=0.03, period=2.0)
    return PathSource(circle, arm.kinematics().p_WE(arm.home), preview=PERIOD)


def controller_of(arm):
    return SampledController(Pseudoinverse(limits=arm.limits), PERIOD)


def simulated(arms):
    """Joint positions of arms in one plant after a while, by the place that each stands at."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    instances = [arm.add_to(plant, X) for arm, X in arms]
    for instance, (arm, _) in zip(instances, arms, strict=True):
        add_motors(plant, instance, arm)
    plant.Finalize()
    for k, (instance, (arm, _)) in enumerate(zip(instances, arms, strict=True)):
        path = builder.AddNamedSystem(f"path{k}", path_of(arm))
        body = ArmInPlant(arm, plant, instance)
        AddLoop(builder, body, controller_of(arm), path, prefix=f"arm{k}_")
        body.connect(builder)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.3)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    return [plant.GetPositions(context, instance) for instance in instances]


def test_two_arms_in_one_plant_move_as_each_alone_in_its_own():
    """They are far apart; each follows its path in its own base frame."""
    arms = [(load_arm("planar6").replace(gravity=[0, 0, -9.81]), X_WB), (load_arm("ur5"), None)]
    for q, (arm, _) in zip(simulated(arms), arms, strict=True):
        builder = DiagramBuilder()
        path = builder.AddNamedSystem("path", path_of(arm))
        loop = AddLoop(builder, PlantArm(arm), controller_of(arm), path)
        simulator = Simulator(builder.Build())
        simulator.AdvanceTo(0.3)
        root = simulator.get_context()
        alone = loop.arm.GetOutputPort("position").Eval(loop.arm.GetMyContextFromRoot(root))
        np.testing.assert_allclose(q, alone, atol=1e-9)
        assert np.abs(q - arm.home).max() > 1e-3


def test_what_a_plant_lacks_is_said():
    arm = load_arm("panda")
    plant = MultibodyPlant(1e-3)
    instance = arm.add_to(plant)
    with pytest.raises(InvalidInputError, match=r"^plant: must be finalized, after"):
        ArmInPlant(arm, plant, instance)
    plant.Finalize()
    with pytest.raises(InvalidInputError, match=r"^plant: 'panda_joint1' .* call add_motors\("):
        ArmInPlant(arm, plant, instance)
    with pytest.raises(InvalidInputError, match=r"^plant: is finalized; add motors"):
        add_motors(plant, instance, arm)
    plant = MultibodyPlant(0.0)
    instance = arm.add_to(plant)
    add_motors(plant, instance, arm)
    plant.Finalize()
    with pytest.raises(InvalidInputError, match=r"^plant: must be discrete"):
        ArmInPlant(arm, plant, instance)


def test_gravity_is_that_of_the_base_frame():
    """Of an arm that hangs from a ceiling, its motors would otherwise push the wrong way."""
    arm, plant = load_arm("panda"), MultibodyPlant(1e-3)
    instance = arm.add_to(plant, RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), [0.0, 0.0, 2.0]))
    add_motors(plant, instance, arm)
    plant.Finalize()
    told = r"give arm.replace\(gravity=\[0, 0, 9.81\]\)$"
    with pytest.raises(
        InvalidInputError, match=rf"^arm\.gravity: in the base frame of panda .* {told}"
    ):
        ArmInPlant(arm, plant, instance)
    ArmInPlant(arm.replace(gravity=[0, 0, 9.81]), plant, instance)


def test_an_arm_that_is_not_joined_to_its_plant_says_so():
    """Two arms in a plant: the instance of the other, and a forgotten `connect`."""
    arm, other = load_arm("panda"), load_arm("ur5")
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    instances = [
        each.add_to(plant, RigidTransform([k, 0, 0])) for k, each in enumerate((arm, other))
    ]
    for instance, each in zip(instances, (arm, other), strict=True):
        add_motors(plant, instance, each)
    plant.Finalize()
    message = r"^instance: '\w+' has no joint 'panda_joint1' of panda; give what panda's add_to"
    with pytest.raises(InvalidInputError, match=message):
        ArmInPlant(arm, plant, instances[1])
    AddLoop(
        builder,
        ArmInPlant(arm, plant, instances[0]),
        controller_of(arm),
        builder.AddNamedSystem("path", path_of(arm)),
    )
    simulator = Simulator(builder.Build())
    with pytest.raises(InvalidInputError, match=r"^ArmInPlant: .* call body\.connect\(builder\)"):
        simulator.AdvanceTo(0.01)

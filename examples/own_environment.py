"""Press on a surface of your own: a dome under an iiwa with full dynamics."""

from typing import Any

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem

from drake_rnn import (
    AddLoop,
    Circle,
    Contact,
    ContactModel,
    ForceProfile,
    MotionForce,
    OnlineStiffness,
    PathSource,
    PlantArm,
    SampledController,
    load_arm,
)

RADIUS = 0.3


class Dome(ContactModel):
    """A rigid ball with its top below the tool at the start."""

    is_plane = False

    def add_to(self, plant: MultibodyPlant, p_WS: np.ndarray) -> None:
        properties = ProximityProperties()
        AddRigidHydroelasticProperties(0.02, properties)
        AddContactMaterial(friction=CoulombFriction(0.3, 0.3), properties=properties)
        pose = RigidTransform(p_WS - [0.0, 0.0, RADIUS])
        world = plant.world_body()
        plant.RegisterCollisionGeometry(world, pose, Sphere(RADIUS), "dome", properties)


class DomeNormal(LeafSystem):
    """Normal of the dome below the tool, as a signal, shape (3,)."""

    def __init__(self, centre: np.ndarray) -> None:
        super().__init__()
        p_WE = self.DeclareVectorInputPort("p_WE", 3)

        def normal(context: Context, output: Any) -> None:
            away = p_WE.Eval(context) - centre
            output.set_value(away / np.linalg.norm(away))

        self.DeclareVectorOutputPort("normal_WE", 3, normal)


def main() -> None:
    """Press on the dome along a circle."""
    arm = load_arm("iiwa14").replace(frame="tip")
    kinematics = arm.kinematics()
    contact = Contact(Dome(gap=2e-3), ForceProfile(value=5.0))
    centre = contact.place(arm, arm.home) - [0.0, 0.0, RADIUS]

    builder = DiagramBuilder()
    path = PathSource(
        Circle(size=0.04, period=8.0, timing="sin2"),
        kinematics.p_WE(arm.home),
        R_WE=kinematics.R_WE(arm.home),
    )
    builder.AddNamedSystem("path", path)
    normal = builder.AddNamedSystem("normal", DomeNormal(centre))
    law = MotionForce(limits=arm.limits, stiffness=OnlineStiffness())
    loop = AddLoop(
        builder,
        PlantArm(arm, contact=contact),
        SampledController(law, period=1e-3),
        path,
        signals={"normal_WE": normal.get_output_port()},
    )
    builder.Connect(loop.kinematics.GetOutputPort("p_WE"), normal.get_input_port())

    simulator = Simulator(builder.Build())
    root = simulator.get_context()
    force, p_WE = loop.forces["contact_force"], loop.kinematics.GetOutputPort("p_WE")
    worst, steepest = 0.0, 0.0
    for t in np.arange(2.0, 8.0, 0.05):
        simulator.AdvanceTo(t)
        away = p_WE.Eval(loop.kinematics.GetMyContextFromRoot(root)) - centre
        n = away / np.linalg.norm(away)
        f = force.Eval(force.get_system().GetMyContextFromRoot(root))
        worst = max(worst, abs(f @ n - 5.0))
        steepest = max(steepest, np.degrees(np.arccos(n[2])))
    print(f"the dome slopes by up to {steepest:.1f} degrees; the 5 N are missed by {worst:.3f} N")


if __name__ == "__main__":
    main()

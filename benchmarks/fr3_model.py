"""Write a model of the FR3 that franka-sim's controller makes follow its commands.

Run by an environment that has franka-sim, which takes the file from the environment variable
``FR3_MJCF``::

    /path/to/venv/bin/python benchmarks/fr3_model.py fr3.xml

The links are those of ``models/fr3/fr3.urdf``, with their masses and without shapes. franka-sim's
own servo is a stiff one in steps of 1 ms, so a joint needs some inertia for it, here that of a
rotor behind its gear. With ``--follow`` is printed how far the joints are from commands in
velocity, in time and with every other command a step late, as they come from another process.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import mujoco
import numpy as np

URDF = Path(__file__).parents[1] / "models" / "fr3" / "fr3.urdf"
#: Inertia of the rotors behind their gears [kg m^2], and viscous friction [N m s/rad].
ARMATURE = (1.0, 1.0, 0.8, 0.8, 0.4, 0.4, 0.4)
DAMPING = 1.0
#: Swings of all joints that are followed: largest speed [rad/s] and accelerations [rad/s^2].
SPEED, ACCELERATIONS = 1.0, (2.0, 5.0, 10.0)


def written(file: Path) -> None:
    """Write the model."""
    spec = mujoco.MjSpec.from_file(str(URDF))
    for geom in list(spec.geoms):
        geom.delete()
    for joint in spec.joints:
        joint.armature = ARMATURE[int(joint.name[-1]) - 1]
        joint.damping = DAMPING
    spec.compile()
    file.write_text(spec.to_xml())


def follow(file: Path) -> None:
    """Print how far the joints' velocities are from those that are commanded."""
    os.environ["FR3_MJCF"] = str(file)
    from franka_sim.mujoco_franka_sim import ARM_INITIAL_Q, MujocoFrankaSim

    for acceleration in ACCELERATIONS:
        off = []
        for late in (False, True):
            sim = MujocoFrankaSim()
            sim.initialize_simulation()
            rate = acceleration / SPEED
            t = 1e-3 * np.arange(1, 4001)[:, np.newaxis]
            signs = np.array([1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0])
            v = signs * SPEED * np.sin(rate * t)
            q = ARM_INITIAL_Q + 1e-3 * np.cumsum(v, axis=0)
            errors = []
            for k in range(len(q)):
                # Of two that come together the newer counts.
                if not late or k % 2:
                    sim.update_joint_positions(q[k])
                sim._apply_control()
                mujoco.mj_step(sim.model, sim.data)
                errors.append(np.abs(sim.data.qvel[sim.arm_dofs_idx] - v[k]))
            off.append(np.max(errors, axis=0))
        print(acceleration, *(np.round(each, 3).tolist() for each in off))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, help="file to write")
    parser.add_argument("--follow", action="store_true", help="print how it follows, too")
    asked = parser.parse_args()
    written(asked.file)
    if asked.follow:
        follow(asked.file)


if __name__ == "__main__":
    main()

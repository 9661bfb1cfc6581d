"""Play a proven pick and place in MuJoCo by position servos, and see what touches: pip install mujoco."""

# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

import rrtik_ompl as rrtik
from rrtik_robots.example_arms import data_folder

STEP = 0.002  # [s]
DAMPING = 0.05  # [s]
plan = rrtik.Task.load("panda_pick_place").plan(seed=1)
motion = plan.time_parameterize(pause=0.3, tip_speed=0.3).trajectory  # friction alone holds the cup
clock = np.arange(0.0, motion.duration, STEP)
arm = motion(clock)
fingers = np.repeat(motion.gripper_positions(clock), 2, axis=1)
panda = data_folder() / "panda_description"
compiler = f'<compiler meshdir="{panda}/meshes/collision" strippath="true" discardvisual="true" fusestatic="false"/>'
option = f'<option timestep="{STEP}" integrator="implicitfast" cone="elliptic" impratio="10"/>'  # a grasp does not slip
urdf = (panda / "urdf/panda.urdf").read_text().replace("</robot>", f"<mujoco>{compiler}{option}</mujoco></robot>")
spec = mujoco.MjSpec.from_string(urdf)
for joint in spec.joints:
    kp = 20000.0 if "finger" in joint.name else 8000.0
    spec.add_actuator(target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_position(kp=kp, kv=DAMPING * kp)
for link in spec.bodies:
    link.gravcomp = 1.0  # as an arm's own controller does
for thing in plan.worlds[0].scene.obstacles:
    body = spec.worldbody.add_body(name=thing.name, pos=thing.pose.translation)
    assert isinstance(thing.shape, rrtik.Box)
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=0.5 * thing.shape.size, mass=0.1, solref=[2.0 * STEP, 1.0])
    if any(thing.name == held.name for world in plan.worlds for held in world.scene.attached):
        body.add_freejoint()
model = spec.compile()
data = mujoco.MjData(model)
data.qpos[:9] = np.append(arm.positions[0], fingers[0])
touching = set()
for data.ctrl in np.hstack([arm.positions + DAMPING * arm.velocities, fingers - 0.002]):  # 2 mm further, to press
    mujoco.mj_step(model, data)
    touching |= {frozenset(model.body(model.geom_bodyid[g]).name for g in each.geom) for each in data.contact}
print(*(" and ".join(sorted(pair)) for pair in touching), sep="\n")

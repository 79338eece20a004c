"""Thirty quantities of a Franka Panda, its table and two objects at once: `python docs/examples/arm.py`."""

import pathlib
import sys

import jax
import jax.numpy as jnp
import mujoco
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import LogUniform, Uniform
from mjx_arenas.dr import Term

PICTURE = pathlib.Path(__file__).with_suffix(".png")
HOME = [0.0, 0.1, 0.0, -2.2, 0.0, 2.3, 0.8]  # [rad]
GOAL = jnp.array([0.0, 0.55, 0.0, -2.0, 0.0, 2.55, 0.8])
STIFF = jnp.array([600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0])
LINKS, JOINTS, PADS = "arm_link.", "arm_joint.", "arm_(left|right)_pad."
ARM = {  # 21 quantities of the robot and its surroundings: "add" and "scale" are of the numbers in the MJCF
    "mass": (Term("body.mass", LINKS), Uniform(0.9, 1.1, "scale")),  # inertias and inverse weights follow
    "com": (Term("body.ipos", LINKS), Uniform(-0.005, 0.005, "add")),
    "armature": (Term("joint.armature", JOINTS), Uniform(0.8, 1.3, "scale")),
    "damping": (Term("joint.damping", JOINTS), LogUniform(0.5, 2.0, "scale")),
    "range": (Term("joint.range", JOINTS), Uniform(0.97, 1.0, "scale")),
    "stop": (Term("joint.solref_limit", JOINTS, axes="timeconst"), Uniform(0.01, 0.03)),
    "spring": (Term("joint.stiffness", "arm_.*_spring_link_joint"), Uniform(0.8, 1.2, "scale")),
    "motor": (Term("actuator.gear", "arm_actuator.", axes="first"), Uniform(0.95, 1.05, "scale")),
    "grip": (Term("actuator.gainprm", "arm_fingers_actuator", axes="0"), Uniform(0.8, 1.2, "scale")),
    "squeeze": (Term("actuator.forcerange", "arm_fingers_actuator"), Uniform(0.7, 1.3, "scale", tied="axes")),
    "rubber": (Term("geom.friction", PADS, axes="sliding"), Uniform(0.7, 1.3, "scale")),
    "softness": (Term("geom.solref", PADS, axes="timeconst"), Uniform(0.004, 0.01)),
    "give": (Term("geom.solimp", PADS, axes="width"), Uniform(0.5, 2.0, "scale")),
    "pinch": (Term("site.pos", "arm_pinch"), Uniform(-0.003, 0.003, "add")),
    "eye": (Term("camera.pos", "arm_handcam_.*"), Uniform(-0.01, 0.01, "add")),
    "gaze": (Term("camera.rpy", "arm_handcam_.*"), Uniform(-0.05, 0.05)),
    "lens": (Term("camera.fovy", "arm_handcam_.*"), Uniform(0.95, 1.05, "scale")),
    "shell": (Term("material.rgba", ["arm_white", "arm_off_white"], axes=("red", "green", "blue")), Uniform(0.4, 1.0)),
    "lamp": (Term("light.pos"), Uniform(-0.5, 0.5, "add")),
    "lamplight": (Term("light.diffuse"), Uniform(0.3, 0.7)),
    "gravity": (Term("option.gravity"), Uniform(-0.1, 0.1, "add")),
}
ARENA = {  # 9 of the table and the objects
    "table_offsets": Uniform([-0.05, -0.05, -0.2], [0.05, 0.05, 0.15], "add"),
    "table_rots": Uniform(-0.6, 0.6),
    "table_full_sizes": Uniform([0.9, 0.8, 0.03], [1.2, 1.1, 0.08]),
    "table_frictions": Uniform([0.4, 0.005, 0.0001], [1.2, 0.005, 0.0001]),
    "has_legs": mja.Bernoulli(0.5),
    "object_full_sizes": Uniform(0.7, 1.3, "scale", tied="axes"),
    "object_masses": LogUniform(0.05, 0.5),
    "object_frictions": Uniform([0.4, 0.005, 0.0001], [1.5, 0.005, 0.0001]),
    "object_rgba": Uniform([0.2, 0.2, 0.2, 1], 1.0),
}


def scene(robot: pathlib.Path | None = None) -> mja.TableArena:
    """A Panda on a table, with a can and a box in front of it; without a path that of the package gym_hil."""
    panda = mja.robots.load("panda") if robot is None else mujoco.MjSpec.from_file(str(robot))
    panda.add_key(name="home", qpos=HOME + 8 * [0.0])  # the gripper has eight joints
    objects = [
        mja.Object("can", "cylinder", (0.07, 0.07, 0.11), pos=(0.2, 0.15)),
        mja.Object("box", full_size=0.08, pos=(0.2, -0.2)),
    ]
    arena = mja.TableArena(table_full_size=(1.1, 0.9, 0.05), objects=objects, table_priority=0)
    arena.attach(panda, prefix="arm_", pos=(-0.35, 0, 0), on=0)  # it follows its table
    arena.vary(**{name: term for name, (term, _) in ARM.items()})
    return arena


def reach(data: mjx.Data, step: jax.Array) -> jax.Array:
    """(W, 8) torques towards `GOAL`, and an open gripper."""
    q, v = data.qpos[:, :7], data.qvel[:, :7]  # the arm comes first in the model
    torques = STIFF * (GOAL - q) - 2 * jnp.sqrt(STIFF) * v + data.qfrc_bias[:, :7]
    return jnp.append(torques, jnp.zeros((len(q), 1)), axis=1)


def main(
    robot: pathlib.Path | None = None, worlds: int = 6, steps: int = 20, picture: pathlib.Path | None = PICTURE
) -> tuple[int, dict[str, float], jax.Array]:
    """Gives how many quantities vary, how far worlds are from recompiled ones, and `qpos` (W, nq) at the end."""
    arena = scene(robot)
    ranges = mja.ArenaRanges(**ARENA, terms={name: distribution for name, (_, distribution) in ARM.items()})
    keys = mja.world_keys(0, range(worlds))
    batch = arena.randomize(arena.put_model("warp"), keys, ranges)
    data = mja.make_data(batch, keys, keyframe="arm_home")
    data = mja.rollout(batch, data, steps, control=reach)
    print(f"{len(ranges.varying)} quantities vary, {batch.nbytes} bytes of a world's model.")

    compiled = {i: arena.compile(batch.world(i)) for i in range(worlds)}
    off = mja.differences(batch.model, compiled)
    print(
        f"{worlds} worlds against MuJoCo's compiler: no number is off by more than {max(off.values()):.1e} of itself."
    )
    if picture is not None:
        view = mujoco.MjvCamera()
        view.azimuth, view.elevation, view.distance, view.lookat = 140, -25, 2.1, [0, 0, 0.95]
        sheet = arena.contact_sheet(batch.params, data, columns=3, camera=view, width=304, height=228)
        sheet.save(picture, optimize=True)
    return len(ranges.varying), off, data.qpos


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None)

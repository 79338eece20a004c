"""Thirty quantities of an arm and its arena: sampled and written, in units of a step, and of a copy of the bytes."""

import functools
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import mujoco

import mjx_arenas as mja
from benchmarks import measure, scene
from mjx_arenas import Uniform, dr
from mjx_arenas.demo import ranges as table_ranges

LINKS = 7


def arm_xml() -> str:
    """A chain of capsules with a gripper of two slides, position servos, a camera and a site at its hand."""
    links, closing = "", ""
    for i in range(LINKS):
        axis = "0 0 1" if i % 2 == 0 else "0 1 0"
        links += (
            f'<body name="link{i}" pos="0 0 {0.05 if i == 0 else 0.15}"><joint name="joint{i}" axis="{axis}" range="-2.5 2.5" '
            f'damping="1" armature=".1" frictionloss=".1" stiffness=".1"/>'
            f'<geom name="link{i}" type="capsule" size=".04" fromto="0 0 .02 0 0 .13" mass="{2.5 - 0.25 * i}"/>'
        )
        closing += "</body>"
    fingers = "".join(
        f'<body name="finger{k}" pos="0 {y} .19"><joint name="finger{k}" type="slide" axis="0 {-y / abs(y):g} 0" range="0 .04" damping="5" '
        f'armature=".1" frictionloss=".1"/><geom name="finger{k}" type="box" size=".01 .005 .03" mass=".05"/></body>'
        for k, y in enumerate((0.05, -0.05))
    )
    hand = f'<site name="hand" pos="0 0 .2"/><camera name="wrist" pos=".05 0 .1" fovy="60"/>{fingers}'
    servos = "".join(
        f'<position name="joint{i}" joint="joint{i}" kp="200" kv="20" forcerange="-90 90"/>' for i in range(LINKS)
    )
    servos += "".join(
        f'<position name="finger{k}" joint="finger{k}" kp="100" kv="10" forcerange="-20 20"/>' for k in range(2)
    )
    pairs = "".join(f'<exclude body1="link{i}" body2="link{i + 1}"/>' for i in range(LINKS - 1))
    pairs += "".join(f'<exclude body1="link{LINKS - 1}" body2="finger{k}"/>' for k in range(2))
    return (
        f'<mujoco><compiler angle="radian"/><worldbody><body name="base"><geom name="base" type="cylinder" size=".06 .02" mass="3" '
        f'pos="0 0 .02" contype="0" conaffinity="0"/>{links}{hand}{closing}</body></worldbody><contact>{pairs}</contact>'
        f"<actuator>{servos}</actuator></mujoco>"
    )


SCALED = Uniform(0.9, 1.1, relative="scale")
HEAVY = {
    "mass": (dr.Term("body.mass", ["arm_link.*", "arm_finger."]), SCALED),
    "com": (dr.Term("body.ipos", "arm_link.*"), Uniform(-0.005, 0.005, relative="add")),
    "armature": (dr.Term("joint.armature", "arm_.*"), SCALED),
}
"""What moves the weights of the arm's tree."""
LIGHT = {
    "damping": (dr.Term("joint.damping", "arm_.*"), SCALED),
    "friction_loss": (dr.Term("joint.frictionloss", "arm_.*"), SCALED),
    "stiffness": (dr.Term("joint.stiffness", "arm_joint.*"), SCALED),
    "range": (dr.Term("joint.range", "arm_.*"), SCALED),
    "limit": (dr.Term("joint.solref_limit", "arm_.*"), SCALED),
    "kp": (dr.Term("actuator.kp", "arm_.*"), SCALED),
    "kv": (dr.Term("actuator.kv", "arm_.*"), SCALED),
    "force": (dr.Term("actuator.forcerange", "arm_.*"), SCALED),
    "grip": (dr.Term("geom.friction", "arm_.*"), SCALED),
    "softness": (dr.Term("geom.solref", "arm_finger."), SCALED),
    "stiff": (dr.Term("geom.solimp", "arm_finger.", axes=("width",)), SCALED),
    "mix": (dr.Term("geom.solmix", "arm_finger."), SCALED),
    "colour": (dr.Term("geom.rgba", "arm_.*"), Uniform(0.0, 1.0)),
    "hand": (dr.Term("site.pos", "arm_hand"), Uniform(-0.005, 0.005, relative="add")),
    "eye": (dr.Term("camera.pos", "arm_wrist"), Uniform(-0.01, 0.01, relative="add")),
    "gaze": (dr.Term("camera.rpy", "arm_wrist"), Uniform(-0.05, 0.05)),
    "fovy": (dr.Term("camera.fovy", "arm_wrist"), SCALED),
    "lamp": (dr.Term("light.pos"), Uniform(-0.2, 0.2, relative="add")),
    "lamplight": (dr.Term("light.diffuse"), Uniform(0.2, 0.9)),
    "gravity": (dr.Term("option.gravity"), Uniform([0, 0, -0.4], [0, 0, 0.4], relative="add")),
}


@functools.cache
def arena() -> mja.TableArena:
    """The arm on a table with three cubes."""
    made = mja.TableArena(objects=[mja.Object(f"cube{k}") for k in range(3)], table_priority=0)
    option = made.spec.option
    option.solver, option.cone = mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtCone.mjCONE_PYRAMIDAL
    option.iterations, option.ls_iterations, option.timestep = 5, 8, 0.004
    made.attach(arm_xml(), "arm_", pos=(-0.3, 0, 0), on=0)
    made.vary(**{name: term for name, (term, _) in {**HEAVY, **LIGHT}.items()})
    return made


def ranges(*, heavy: bool) -> mja.ArenaRanges:
    """Of all thirty quantities, or of those that leave weights as they are."""
    terms = {**(HEAVY if heavy else {}), **LIGHT}
    tables = table_ranges()._replace(table_active=None, object_active=None, object_tables=None, object_masses=None)
    objects = {
        "object_frictions": Uniform([0.5, 0.005, 0.0001], [1.5, 0.005, 0.0001]),
        "object_rgba": Uniform(0.0, 1.0),
        "object_full_sizes": Uniform(0.8, 1.2, relative="scale") if heavy else None,
        "object_densities": None,
    }
    return tables._replace(**objects, terms={name: dist for name, (_, dist) in terms.items()})


def terms(impl: str, worlds: int, light_worlds: int, n_steps: int) -> Iterator[dict[str, Any]]:
    """All of them beside steps of the same worlds; those that leave weights alone beside a copy of their bytes."""
    one = arena()
    model = scene.model(one, impl)

    def writer(given: mja.ArenaRanges) -> Any:
        return jax.jit(lambda keys: scene.written(one.randomize(model, keys, given)))

    every, light = ranges(heavy=True), ranges(heavy=False)
    keys, many = scene.keys(worlds), scene.keys(light_worlds)
    batch = one.randomize(model, keys, every)
    data = mja.make_data(batch, keys)
    write_all, write_light = writer(every), writer(light)
    flat = jnp.zeros(sum(x.nbytes for x in jax.tree.leaves(write_light(many))) // 4, jnp.float32)
    copy = jax.jit(jnp.copy)
    seconds = measure.interleaved(
        {
            "all": functools.partial(write_all, keys),
            "steps": functools.partial(mja.rollout, batch, data, n_steps),
            "light": functools.partial(write_light, many),
            "copy": functools.partial(copy, flat),
        }
    )
    yield {
        "worlds": worlds,
        "quantities": len(every.varying & set(one.record.everything)),
        "seconds": seconds["all"],
        "step_seconds": seconds["steps"] / n_steps,
        "in_steps": seconds["all"] / (seconds["steps"] / n_steps),
        "light_worlds": light_worlds,
        "light_quantities": len(light.varying & set(one.record.everything)),
        "light_seconds": seconds["light"],
        "light_share": seconds["copy"] / seconds["light"],
        "light_bytes_per_world": flat.nbytes / light_worlds,
    }


FEATURES = {
    "joints": ("damping", "friction_loss", "stiffness", "range", "limit"),
    "actuators": ("kp", "kv", "force"),
    "geoms": ("grip", "softness", "stiff", "mix", "colour"),
    "site": ("hand",),
    "camera": ("eye", "gaze", "fovy"),
    "light": ("lamp", "lamplight"),
    "gravity": ("gravity",),
}
"""The quantities of `LIGHT` by what they are about."""


def kernels(impl: str, worlds: int) -> Iterator[dict[str, Any]]:
    """What leaves weights alone, on the device: all of it, without each part, and only the arm where its table takes it.

    Raises:
        Skipped: there is no GPU.
    """
    if jax.default_backend() != "gpu":
        raise measure.Skipped("it profiles the kernels of a GPU, and there is none")
    one = arena()
    model, keys = scene.model(one, impl), scene.keys(worlds)
    light = ranges(heavy=False)
    given = {"nothing": light}
    for name, quantities in FEATURES.items():
        given[name] = light._replace(terms={n: d for n, d in light.terms.items() if n not in quantities})
    still = {name: None for name in mja.ArenaRanges._fields if name != "terms"}
    given["places of tables"] = light._replace(table_offsets=None, table_rots=None)
    given["tables and objects"] = light._replace(**still)
    given["all but places of tables"] = mja.ArenaRanges(table_offsets=light.table_offsets, table_rots=light.table_rots)
    copy = jax.jit(jnp.copy)
    for without, kept in given.items():
        write = jax.jit(lambda keys, kept=kept: scene.written(one.randomize(model, keys, kept)))
        n_bytes = sum(x.nbytes for x in jax.tree.leaves(write(keys)))
        flat = jnp.zeros(n_bytes // 4, jnp.float32)
        seconds, count = measure.on_device(functools.partial(write, keys))
        copied, _ = measure.on_device(functools.partial(copy, flat))
        yield {
            "without": without,
            "worlds": worlds,
            "device_seconds": seconds,
            "kernels": count,
            "bytes_per_world": n_bytes / worlds,
            "accessed_bytes_per_world": measure.accessed(write, keys) / worlds,
            "copy_seconds": copied,
            "share": copied / seconds,
        }


def holding(kind: Callable[[type], type], impl: str, length: int = 100, substeps: int = 5) -> Any:
    """An environment whose episodes each draw all of them, in which nothing is to be done; of a class that `kind` changes."""
    from mjx_arenas.envs import ArenaEnv, env_config

    class Hold(ArenaEnv):
        """Nothing is to be done."""

        def __init__(self) -> None:
            dt = arena().spec.option.timestep
            super().__init__(arena(), ranges(heavy=True), env_config(dt * substeps, dt, length), {"impl": impl})

        def draw_task(self, key: jax.Array, params: mja.ArenaParams, qpos: jax.Array) -> Any:
            return {}

        def control(self, action: jax.Array) -> jax.Array:
            return 0.1 * action

        def observe(self, data: Any, episode: Any) -> Any:
            return {"state": data.qpos, "privileged_state": data.qpos}

        def score(self, data: Any, episode: Any, action: jax.Array) -> Any:
            return jnp.zeros(()), jnp.zeros((), bool), {"success": jnp.zeros(())}

    return kind(Hold)()

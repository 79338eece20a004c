"""Scenes that the oracle of pictures draws: arenas, what varies in their worlds, and the cameras that look at them."""

import dataclasses
import functools
import operator
import pathlib
from collections.abc import Callable
from typing import NamedTuple

import jax
import mujoco
import numpy as np

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.envs.tasks import robots

WIDTH, HEIGHT = 96, 72
ON_JAX = 24  # worlds
# Of texels not much smaller than pixels: OpenGL smooths finer ones, the ray caster takes the colour at a point.
TEXTURES = {
    "oak": mja.textures.Wood(rings=4, seed=1, size=16),
    "stone": mja.textures.Noise(size=16),
    "tiles": mja.textures.Checker(n=3, size=18),
}


class View(NamedTuple):
    """A scene."""

    made: Callable[[], mja.Arena]
    ranges: mja.ArenaRanges
    cameras: tuple[str, ...]
    n: int
    """Worlds on Warp."""
    shadows: bool = False


def suns(arena):
    """OpenGL lights the corners of a face, the ray caster each pixel: alike for light from afar."""
    for light in arena.spec.lights:
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL


def tables():
    """Tables and objects, all that can be told apart of them in a picture, and a robot."""
    objects = [
        mja.Object("cube", full_size=0.12),
        mja.Object("brick", full_size=(0.1, 0.15, 0.2), on=1),
        mja.Object("ball", "sphere", 0.12, on=1),
        mja.Object("pill", "capsule", (0.2, 0.08, 0.08)),
    ]
    arena = mja.MultiTableArena(table_offsets=[[0, -0.5, 0.8], [0, 0.6, 0.8]], objects=objects)
    arena.spec.worldbody.add_camera(name="low", pos=[1.8, -1.5, 1.5], xyaxes=[0.64, 0.77, 0, -0.3, 0.25, 0.92], fovy=55)
    suns(arena)
    arena.attach(robots.gripper(), prefix="robot_", pos=(0, 0, 0), on=0)
    for name, texture in TEXTURES.items():
        arena.add_material(name, texture, specular=0.0)
    arena.vary(
        joints=dr.Term("joint.qpos", "robot_[xyz]"),
        board=dr.Term("geom.material", "table._visual"),
        lens=dr.Term("camera.fovy", "frontview"),
        eye=dr.Term("camera.pos", "frontview"),
        gaze=dr.Term("camera.rpy", "low"),
        lamp=dr.Term("light.dir"),
        colour=dr.Term("light.diffuse"),
    )
    return arena


OF_TABLES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.3], [0.1, 0.1, 0.2], relative="add"),
    table_rots=mja.Uniform(-1.0, 1.0),
    table_full_sizes=mja.Uniform([0.5, 0.5, 0.03], [0.9, 0.8, 0.2]),
    has_legs=mja.Bernoulli(0.5),
    table_active=mja.Bernoulli([1.0, 0.5]),
    object_active=mja.Count(1, 4),
    object_full_sizes=mja.Uniform(0.7, 1.4, relative="scale"),
    object_rgba=mja.Uniform([0, 0, 0, 1], 1.0),
    terms={
        "joints": mja.Uniform(-0.25, 0.1),
        "board": mja.Choice([1, 3, 4, 5]),  # materials: the tables' own, and the three
        "lens": mja.Uniform(0.8, 1.3, relative="scale"),
        "eye": mja.Uniform(-0.1, 0.1, relative="add"),
        "gaze": mja.Uniform(-0.2, 0.2),
        "lamp": mja.Uniform(-0.4, 0.4, relative="add"),
        # Together below 1, where OpenGL cuts light off before it is multiplied with textures.
        "colour": mja.Uniform(0.02, 0.18),
    },
)


def looks():
    """A shelf, a mesh, materials, lamps that go on and off and cast shadows or none, and cameras on a hand and on an object."""
    wedge = pathlib.Path(__file__).parent / "data" / "wedge.obj"
    objects = [
        mja.Object("cart", full_size=(0.14, 0.1, 0.06)),
        mja.Object("wedge", "mesh", (0.24, 0.18, 0.15), file=wedge),
        mja.Object("ball", "sphere", 0.16),
    ]
    arena = mja.MultiTableArena(table_offsets=[[0, -0.3, 0.7]], objects=objects)
    for name, texture in TEXTURES.items():
        arena.add_material(name, texture, specular=0.0)
    arena.add_material("gloss", specular=0.8, shininess=0.1)
    arena.add_material("matte", specular=0.0)
    arena.add_part(mja.furniture.Shelf("rack", pos=(-0.2, 0.8, 0), heights=(0.1, 0.5, 0.9), material="gloss"))
    arena.attach(robots.gripper(), prefix="robot_", on=0)
    arena.add_camera("wrist", pos=(0.25, 0.1, 0.3), look_at=(0, 0, -0.4), fovy=70, on="robot_hand")
    arena.add_camera("rider", pos=(-0.3, 0.05, 0.3), look_at=(0.1, 0, 0), fovy=75, on="cart")
    # OpenGL computes highlights at the corners of a mesh's faces, and multiplies them with textures: neither has any here.
    arena.spec.geom("ball_g0").material, arena.spec.geom("wedge_g0").material = "gloss", "matte"
    arena.spec.material("table_ceramic").specular = 0
    suns(arena)
    # With the headlight's 0.25 from all sides below 1, where OpenGL cuts light off before it is multiplied with textures.
    arena.spec.visual.headlight.diffuse = [0.2] * 3
    for light in arena.spec.lights:
        light.diffuse, light.specular = [0.27] * 3, [0.2] * 3
    # Finer than the defaults: faces on whose corners OpenGL computes highlights, and maps of shadows.
    quality = arena.spec.visual.quality
    quality.numquads, quality.shadowsize, quality.offsamples = 32, 2048, 0
    arena.vary(
        joints=dr.Term("joint.qpos", "robot_([xyz]|yaw)"),
        picture=dr.Term("material.texture", "table_ceramic|floorplane"),
        paint=dr.Term("material.rgba", "table_ceramic|table_legs_metal"),
        shine=dr.Term("material.specular", "gloss"),
        on=dr.Term("light.active"),
        casts=dr.Term("light.castshadow"),
        eye=dr.Term("camera.pos", "wrist"),
        lamp=dr.Term("light.dir"),
    )
    return arena


OF_LOOKS = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.1], [0.1, 0.1, 0.1], relative="add"),
    table_rots=mja.Uniform(-0.5, 0.5),
    table_full_sizes=mja.Uniform([0.6, 0.7, 0.03], [0.9, 0.9, 0.1]),
    object_active=mja.Bernoulli([1.0, 0.8, 0.8]),  # the first has a camera
    object_rgba=mja.Uniform([0.3, 0.3, 0.3, 1], 1.0),
    terms={
        "rack.heights": mja.Uniform(-0.08, 0.08, relative="add"),
        "rack.size": mja.Uniform(0.8, 1.2, relative="scale"),
        "rack.pieces_active": mja.Bernoulli([0.5, 0.5, 1.0]),
        "joints": mja.Uniform([-0.2, -0.2, -0.2, -1.0], [0.2, 0.2, 0.1, 1.0]),
        "picture": mja.Choice([-1, 1, 2, 3, 4]),
        "paint": mja.Uniform([0.3, 0.3, 0.3, 1], 1.0),
        "shine": mja.Uniform(0.0, 1.0),
        "on": mja.Bernoulli(0.6),
        "casts": mja.Bernoulli(0.6),
        "eye": mja.Uniform(-0.05, 0.05, relative="add"),
        "lamp": mja.Uniform(-0.3, 0.3, relative="add"),
    },
)
VIEWS = {
    "tables": View(tables, OF_TABLES, ("frontview", "agentview", "low"), 200),
    "looks": View(looks, OF_LOOKS, ("frontview", "wrist", "rider"), 100, shadows=True),
}


@functools.cache
def arena(view):
    return VIEWS[view].made()


def renderer(view):
    """Draws a view's cameras."""
    sizes = dict.fromkeys(VIEWS[view].cameras, (WIDTH, HEIGHT))
    return arena(view).renderer(sizes, depth=True, segmentation=True, shadows=VIEWS[view].shadows)


def worlds(view, impl, n):
    batch = rows(randomized(view, impl), n)
    return batch, mja.make_data(batch, mja.world_keys(3, range(n)))


@functools.cache
def randomized(view, impl):
    """As many worlds as any test has, of which others take the first: another number would be another program."""
    n = VIEWS[view].n if impl == "warp" else ON_JAX
    return arena(view).randomize(arena(view).put_model(impl), mja.world_keys(3, range(n)), VIEWS[view].ranges)


def rows(batch, n):
    """The first `n` worlds."""
    first = {name: operator.attrgetter(name)(batch.model)[:n] for name in batch.fields}
    params = jax.tree.map(lambda x: x[:n], batch.params)
    return dataclasses.replace(batch, model=batch.model.tree_replace(first), params=params, valid=batch.valid[:n])


def stale(batch, **fields):
    """The batch with other numbers of some fields of its model."""
    shaped = {name: np.broadcast_to(value, getattr(batch.model, name).shape) for name, value in fields.items()}
    return dataclasses.replace(batch, model=batch.model.tree_replace(shaped))

"""What `simplify` does to a spec (host)."""

from collections.abc import Collection, Iterator, Mapping

import mujoco
import numpy as np
from mujoco.mjx._src import collision_driver

from mjx_arenas.build import overlaps
from mjx_arenas.build.from_mjcf import unused
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.robots import convex, fitting, rules
from mjx_arenas.robots.fitting import Fitted
from mjx_arenas.robots.report import Cost, Reshaped, SimplifyReport
from mjx_arenas.robots.rules import Rules
from mjx_arenas.spec import comparing, masses, scaled, specs
from mjx_arenas.terms.attributes import prepare

_STAYS = (
    *(
        "body_mass",
        "body_inertia",
        "body_ipos",
        "body_pos",
        "body_quat",
        "body_gravcomp",
        "jnt_pos",
        "jnt_axis",
        "jnt_range",
    ),
    *("jnt_stiffness", "dof_damping", "dof_armature", "dof_frictionloss", "site_pos", "site_quat", "qpos0"),
)
"""What no simpler shape changes."""
_HIDDEN = 3  # the first group of geoms that MuJoCo does not draw unless it is told to
_MESH, _GEOM = mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtObj.mjOBJ_GEOM
_WRAPS = (mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER)


def simplified(spec: mujoco.MjSpec, model: mujoco.MjModel, asked: Rules) -> tuple[mujoco.MjSpec, SimplifyReport]:
    """A spec, which is used up, with what was asked for; `model` is compiled of it."""
    asked_of = model
    aligns = [(body.joints[0], body.joints[0].align) for body in spec.bodies if masses.aligned(body)]
    before = cost(model)
    if aligns:  # the compiler moves these bodies' frames: what is edited is where the spec has it
        for joint, _ in aligns:
            joint.align = mujoco.mjtAlignFree.mjALIGNFREE_FALSE
        model = specs.compiled(spec.copy(), "robot")
    shapes = _shapes(model, asked)
    geoms, actuators = ({one.id: one for one in of} for of in (spec.geoms, spec.actuators))  # until the first edit
    away = _away(spec, model, geoms, asked)
    left = [] if asked.visual else [i for i in rules.colliding(model) if i not in away]
    hidden = [i for i in left if model.geom_group[i] >= _HIDDEN]
    changed = {*asked.shapes, *away, *hidden}
    scaled.refuse(spec, [geoms[i] for i in sorted(changed)], "robot")
    _keep_inertials(spec, model, changed)
    hulls = _add_hulls(spec, model, shapes)
    for geom, shape in shapes.items():
        if asked.visual and _is_drawn(model, geom):
            _draw_on(spec, geoms[geom])
        _reshape(model, geom, geoms[geom], shape, hulls)
    for geom in hidden:
        geoms[geom].group = 0  # nothing else shows the robot
    for geom in asked.shapes.keys() - shapes.keys():
        specs.assign(geoms[geom], contype=0, conaffinity=0)
    for geom in away:
        spec.delete(geoms[geom])
    _forget_meshes(spec)
    sensors = _drop_actuators(spec, model, {i: actuators[i] for i in asked.gone})
    options = {name: (getattr(model.opt, name), value) for name, value in asked.options.items()}
    specs.assign(spec.option, **asked.options)
    excluded = _exclude(spec, model, asked)
    gone = tuple(model.actuator(i).name for i in asked.gone)
    for joint, align in aligns:
        joint.align = align
    after = specs.compiled(spec, "robot")
    if others := sorted(name for name in _STAYS if comparing.differ(asked_of, after, name)):
        raise error([problem("robot", "not_simplified", None, None, names=others)])
    reshaped = tuple(
        Reshaped(model.geom(geom).name or specs.geom_name(model, geom), _kind(model, geom), *_now(shapes.get(geom)))
        for geom in asked.shapes
    )
    options = {name: both for name, both in options.items() if not np.array_equal(*both)}
    return spec, SimplifyReport(before, cost(after), reshaped, excluded, gone, sensors, options)


def cost(model: mujoco.MjModel) -> Cost:
    """What a robot costs."""
    colliding = rules.colliding(model)
    meshes = [int(model.geom_dataid[geom]) for geom in colliding if model.geom_type[geom] == _MESH]
    corners = sum(len(convex.hull(model, mesh)) for mesh in meshes)
    pairs = sum(1 for _ in collision_driver.geom_pairs(model))
    return Cost(pairs, len(colliding), corners, model.ngeom - len(colliding))


def _shapes(model: mujoco.MjModel, asked: Rules) -> dict[int, Fitted]:
    """The new shapes of geoms, those of one mesh fitted once."""
    fits: dict[tuple[int, str], Fitted] = {}
    found: dict[int, Fitted] = {}
    for geom, shape in asked.shapes.items():
        if shape != "none":
            mesh = int(model.geom_dataid[geom])
            if (mesh, shape) not in fits:
                kinds = tuple(fitting.PRIMITIVES) if shape == "primitive" else (shape,)
                fits[mesh, shape] = fitting.fitted(model, mesh, kinds, asked.hull)
            found[geom] = fits[mesh, shape]
    return found


def _now(shape: Fitted | None) -> tuple[str, float]:
    return ("none", 0.0) if shape is None else (shape.kind, shape.change)


def _kind(model: mujoco.MjModel, geom: int) -> str:
    return mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()


def _is_drawn(model: mujoco.MjModel, geom: int) -> bool:
    return bool(model.geom_group[geom] < _HIDDEN and model.geom_rgba[geom, 3] > 0)


def _away(spec: mujoco.MjSpec, model: mujoco.MjModel, geoms: Mapping[int, mujoco.MjsGeom], asked: Rules) -> list[int]:
    """Geoms that go: what is to collide no more and is not drawn, and without `visual` all that does not collide."""
    colliding, referred = set(rules.colliding(model)), _referred(spec)
    none = {geom for geom, shape in asked.shapes.items() if shape == "none"}
    going = {geom for geom in none if not asked.visual or not _is_drawn(model, geom)}
    if not asked.visual:
        going |= {geom for geom in geoms if geom not in colliding and geom not in asked.kept}
    return sorted(geom for geom in going if geoms[geom].name not in referred)


def _referred(spec: mujoco.MjSpec) -> set[str]:
    """Names of the geoms that pairs, sensors, tendons and tuples refer to."""
    found = {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)}
    found |= {sensor.objname for sensor in spec.sensors if sensor.objtype == _GEOM}
    found |= {sensor.refname for sensor in spec.sensors if sensor.reftype == _GEOM}
    found |= {wrap.target.name for tendon in spec.tendons for wrap in tendon.path if wrap.type in _WRAPS}
    found |= {name for one in spec.tuples for name in one.objname}
    return found - {""}


def _keep_inertials(spec: mujoco.MjSpec, model: mujoco.MjModel, geoms: Collection[int]) -> None:
    """Gives the bodies of geoms that change the inertials that the compiler made of their geoms.

    A `settotalmass` would scale these again and all others for the first time, so that all bodies get theirs.
    """
    bodies = set(model.geom_bodyid[sorted(geoms)].tolist()) - {0}
    if bodies and spec.compiler.settotalmass > 0:
        kept = [body for body in spec.bodies if body.id]
    else:
        kept = [body for body in spec.bodies if body.id in bodies and masses.inferred(body)]
    for body in [body for body in kept if not model.body_mass[body.id]]:
        kept.remove(body)  # the compiler makes the same as before, if nothing on it weighs in another group either
        for geom in body.geoms:
            geom.mass = 0
    for body in kept:
        prepare.weighed(spec, body, model, body.id)


def _add_hulls(spec: mujoco.MjSpec, model: mujoco.MjModel, shapes: Mapping[int, Fitted]) -> dict[int, str]:
    """Adds the hulls among the shapes of geoms as meshes, whose names it gives, by the meshes in the places of which they are."""
    names: dict[int, str] = {}
    for geom, shape in shapes.items():
        mesh = int(model.geom_dataid[geom])
        if shape.kind == "hull" and mesh not in names:
            names[mesh] = unused(f"{model.mesh(mesh).name}_hull", {one.name for one in spec.meshes})
            specs.add_mesh(spec, names[mesh], uservert=shape.points.reshape(-1))
    return names


def _draw_on(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> None:
    """Adds a geom that looks like another one, and that neither collides nor weighs; the other is not drawn any more."""
    name = unused(f"{geom.name}_visual", {one.name for one in spec.geoms}) if geom.name else ""
    drawn = specs.copy_geom(geom, geom.parent, name)
    specs.assign(drawn, contype=0, conaffinity=0, mass=0)
    if geom.frame is not None:
        drawn.set_frame(geom.frame)
    geom.group = _HIDDEN


def _reshape(model: mujoco.MjModel, index: int, geom: mujoco.MjsGeom, shape: Fitted, hulls: Mapping[int, str]) -> None:
    """Gives a geom another shape where its mesh stands, which is as in the model, where it has an index; names of hulls by meshes."""
    stands = np.array(model.geom_pos[index]), np.array(model.geom_quat[index])
    specs.out_of_frames(geom)  # the model has poses in the body
    geom.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    if shape.kind == "hull":
        specs.assign(geom, meshname=hulls[int(model.geom_dataid[index])], pos=stands[0], quat=stands[1])
        return
    quat = np.zeros(4)
    mujoco.mju_mulQuat(quat, stands[1], shape.quat)
    pos = convex.placed(shape.pos[None], *stands)[0]
    specs.assign(geom, type=fitting.PRIMITIVES[shape.kind], size=shape.size, pos=pos, quat=quat, meshname="")


def _forget_meshes(spec: mujoco.MjSpec) -> None:
    """Deletes meshes that nothing has, which would be read all the same."""
    mesh = mujoco.mjtObj.mjOBJ_MESH
    used = {getattr(one, "meshname", "") for one in (*spec.geoms, *spec.sites)}
    used |= {sensor.objname for sensor in spec.sensors if sensor.objtype == mesh}  # tactile ones
    used |= {name for one in spec.tuples for name, kind in zip(one.objname, one.objtype, strict=True) if kind == mesh}
    for mesh in [mesh for mesh in spec.meshes if mesh.name not in used]:
        spec.delete(mesh)


def _drop_actuators(
    spec: mujoco.MjSpec, model: mujoco.MjModel, gone: Mapping[int, mujoco.MjsActuator]
) -> tuple[str, ...]:
    """Deletes actuators, by their ids in the model, with their numbers in keyframes and their sensors, whose names it gives."""
    names = {one.name for one in gone.values()} - {""}
    of_them = [s for s in spec.sensors if s.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR and s.objname in names]
    sensors = tuple(sensor.name for sensor in of_them)
    ids = list(gone)
    ctrl = _places(model.actuator_ctrladr[ids], model.actuator_ctrlnum[ids])
    act = _places(model.actuator_actadr[ids], model.actuator_actnum[ids])
    # MuJoCo before 4.0 leaves these in keyframes, and does not compile them.
    left = [
        tuple(np.delete(x, at) if len(x) else x for x, at in ((key.ctrl, ctrl), (key.act, act))) for key in spec.keys
    ]
    for element in (*of_them, *gone.values()):
        spec.delete(element)
    for key, (ctrls, acts) in zip(spec.keys, left, strict=True):
        specs.assign(key, ctrl=ctrls, act=acts)
    return sensors


def _places(addresses: np.ndarray, counts: np.ndarray) -> list[int]:
    """Places of numbers that stand together, as many as counted from each address."""
    return [at for adr, n in zip(addresses, counts, strict=True) for at in range(adr, adr + n)]


def _exclude(spec: mujoco.MjSpec, before: mujoco.MjModel, asked: Rules) -> tuple[tuple[str, str], ...]:
    """Leaves out contacts of bodies that the new shapes put inside each other, and without self-collisions of all others."""
    model = specs.compiled(spec, "robot")
    pairs = [o.bodies for o in overlaps.overlaps(model, "", ())]
    old = {o.bodies for o in overlaps.overlaps(before, "", ())}
    found = dict.fromkeys(bodies for bodies in pairs if bodies not in old)
    if not asked.self_collisions:
        keeping = {before.body(before.geom_bodyid[geom]).name for geom in asked.kept}
        found |= dict.fromkeys(bodies for bodies in _touching(model) if not keeping.issuperset(bodies))
    chosen = tuple(bodies for bodies in found if "" not in bodies and "world" not in bodies)  # the arena's world, then
    for one, other in chosen:
        spec.add_exclude(bodyname1=one, bodyname2=other)
    return chosen


def _touching(model: mujoco.MjModel) -> Iterator[tuple[str, str]]:
    """Names of the bodies whose geoms may collide."""
    for one, other, _ in collision_driver.geom_pairs(model):
        first, second = sorted((int(model.geom_bodyid[one]), int(model.geom_bodyid[other])))
        yield model.body(first).name, model.body(second).name

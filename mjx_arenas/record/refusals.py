"""What no arena may have, whatever its parameters are: what the compiler or MJX would do behind their back (host)."""

import mujoco
import numpy as np
from mujoco.mjx._src import collision_driver

from mjx_arenas.build import assemble
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Problem, Told, problem
from mjx_arenas.problems import messages
from mjx_arenas.record.layout import Layout
from mjx_arenas.rules import validation
from mjx_arenas.spec import masses, objects, specs
from mjx_arenas.spec.names import element
from mjx_arenas.terms.attributes.actuators import many
from mjx_arenas.terms.attributes.attribute import IDLE
from mjx_arenas.terms.attributes.poses import GEOM_WRAP, WRAP_UNSEEN
from mjx_arenas.terms.elements import Elements
from mjx_arenas.terms.parts import Parts
from mjx_arenas.write import writer
from mjx_arenas.write.scene import Scene

_OBJ = mujoco.mjtObj
_STILL = 1e-9  # [m], and of a quaternion
SHAPING = ("geom.size", "geom.pos", "geom.rpy", "geom.mass", "geom.density")
WEIGHING = ("body.mass", "body.mass_alone", "body.inertia", "body.pseudo_inertia", "body.payload", *SHAPING)


def check_rules(spec: mujoco.MjSpec, parts: Parts) -> None:
    """Refuses tables and objects that are gone or move, and what the compiler would do to them behind the parameters' back."""
    validation.raise_all(parts.problems(spec), "`arena.spec`")
    for texture in spec.textures:
        if texture.data:
            raise messages.error([problem("arena.spec", "pixels_in_data", None, texture.name)])
    if spec.compiler.fusestatic or spec.compiler.discardvisual:
        raise messages.error([problem("spec.compiler", "compiler_removes")])
    rules = masses.mass_rules(spec) if parts.objects else []
    if rules:
        raise messages.error([problem("spec.compiler", "compiler_weighs", None, None, names=rules)])
    varied = [t.name for t in parts.varied if t.attribute in WEIGHING]
    furnished = [term.quantities[0] for term in parts.furniture if term.moving_geoms]
    weighing, of_terms = varied + furnished, {"inertiafromgeom"} | (set() if furnished else {"inertiagrouprange"})
    shared = [rule for rule in masses.mass_rules(spec) if rule not in of_terms] if weighing else []
    if shared:
        raise messages.error(
            [problem("spec.compiler", "compiler_weighs_all", None, None, names=shared, varied=weighing[0])]
        )
    for t in (t for t in parts.varied if t.attribute in WEIGHING):
        _check_bounds(spec, t)
    added = objects.addition_problems(spec, parts.objects, parts.geoms_of_variants)
    validation.raise_all(added, "`arena.spec`")


def _check_bounds(spec: mujoco.MjSpec, term: Elements) -> None:
    """Refuses a term that decides masses of a body that was attached with bounds of them in the compiler of its MJCF."""
    for name in term.elements:
        element = getattr(spec, term.kind)(name)
        body = element if term.kind == "body" else element.parent
        if term.kind == "geom" and not masses.inferred(body):
            continue
        bounds = [
            f"{rule}={getattr(body.compiler, rule):g}" for rule in masses.BOUNDS if getattr(body.compiler, rule) > 0
        ]
        if bounds:
            told = {"body": body.name, "bounds": " and ".join(bounds), "name": term.name}
            raise messages.error([problem(f"arena.vary({term.name}=...)", "bounds_of_masses", None, None, told)])


def check_files(spec: mujoco.MjSpec, parts: Parts, params: ArenaParams) -> None:
    """Refuses terms that give a texture another file or `data`: worlds share all pixels."""
    other = spec.copy()
    assemble.set_params(other, parts, params)
    for one, texture in zip(spec.textures, other.textures, strict=False):
        if _files(one) != _files(texture):
            raise messages.error([problem("arena.spec", "texture_files", None, one.name)])


def _files(texture: mujoco.MjsTexture) -> tuple[str, list[str], bytes]:
    return texture.file, list(texture.cubefiles), bytes(texture.data)


def check_armatures(model: mujoco.MjModel, parts: Parts) -> None:
    """Refuses armatures of tendons that end on two things that vary."""
    layout = Layout.of(model, parts)
    for i in np.flatnonzero(model.tendon_armature):
        if len({int(layout.owner[b]) for b in layout.tendon_bodies[i]}) > 1:
            raise messages.error([problem("arena.spec", "tied_armature", None, Told(element(model, "tendon", int(i))))])


def check_actuators(scene: Scene, quantities: frozenset[str]) -> None:
    """Refuses numbers that follow for each output of actuators, where one has several."""
    several = many(scene.model)
    if len(several) and "actuator_acc0" in writer.field_names(scene, quantities):
        name = element(scene.model, "actuator", int(several[0]))
        raise messages.error([problem("arena.spec", "many_outputs", None, Told(name))])


def check_variants(model: mujoco.MjModel, parts: Parts) -> None:
    """Refuses what needs a variant of an object that is not there in all worlds."""
    geoms = {model.geom(name).id: name for names in parts.slots for name in names}
    wrapped = np.isin(model.wrap_type, (mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER))
    found = [("a tendon", g) for g in model.wrap_objid[wrapped].tolist() if g in geoms]
    for kinds, ids in ((model.sensor_objtype, model.sensor_objid), (model.sensor_reftype, model.sensor_refid)):
        found += [
            (element(model, "sensor", s), int(ids[s]))
            for s in np.flatnonzero(kinds == _OBJ.mjOBJ_GEOM).tolist()
            if int(ids[s]) in geoms
        ]
    for what, geom in found[:1]:
        raise messages.error([problem("arena.spec", "geom_of_variant", None, geoms[geom], what=what)])


def of_variants_on_jax(model: mujoco.MjModel, parts: Parts) -> list[Problem]:
    """What makes MJX on JAX choose among contacts, where variants that are not there would take the place of what is."""
    limits = ("max_geom_pairs", "max_contact_points")
    given = [name for name in limits if mujoco.mj_name2id(model, _OBJ.mjOBJ_NUMERIC, name) >= 0]
    return [problem("arena.spec", "limits_of_variants", names=given)] if given and parts.slots else []


def of_fields_on_jax(scene: Scene) -> list[Problem]:
    """A geom whose size differs between worlds and that meets a height field, which MJX on JAX tests by the template's bounds."""
    model, found = scene.model, []
    sized = {int(g): row for row in scene.owned if row.field == "geom_size" for g in row.elements // 3}
    fields = model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD
    for field, geom, _ in collision_driver.geom_pairs(model) if fields.any() else ():
        if fields[field] and geom in sized and not found:
            names = {"geom": element(model, "geom", int(geom)), "field": specs.geom_name(model, int(field))}
            found.append(problem("model", "sized_on_field", None, None, names, named=min(sized[int(geom)].depends)))
    return found


def of_parts_on_jax(scene: Scene, varied: frozenset[str]) -> list[Problem]:
    """What tables, objects and parts vary and MJX on JAX would not see; `varied` are the terms that say so of their own elements."""
    model, found = scene.model, []
    around = np.isin(model.wrap_type, GEOM_WRAP) & (model.wrap_prm >= 0)
    sides = {"geom_size": model.wrap_objid[around], "geom_pos": model.wrap_objid[around]}
    sides["site_pos"] = np.round(model.wrap_prm[around]).astype(int)
    for owned in scene.owned:
        if owned.term in varied:
            continue
        kind, why, unseen = "", "", np.zeros(0, int)
        if owned.field in sides:
            kind, why, rows = owned.field.partition("_")[0], WRAP_UNSEEN, owned.elements // 3
            unseen = rows[np.isin(rows, sides[owned.field])]
        elif owned.field == "dof_frictionloss":
            kind, why = "joint", IDLE
            unseen = model.dof_jntid[owned.elements[model.dof_frictionloss[owned.elements] == 0]]
        if len(unseen):
            named = [name for name in owned.depends if name.endswith(owned.field.partition("_")[2])]
            what = {
                "attribute": min(named or owned.depends),
                "kind": kind,
                "name": getattr(model, kind)(unseen[0]).name,
            }
            what |= {"why": why, "or_else": ""}
            found.append(problem("model", "unseen_on_jax", None, None, what))
    return found[:1]


def check_carriers(model: mujoco.MjModel, parts: Parts) -> None:
    """Refuses what tables hang on where it was moved since they were taken over."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for table in parts.tables:
        carrier = int(model.body_parentid[model.body(table.body).id])
        pos, quat = data.xpos[carrier], data.xquat[carrier]
        same = abs(float(quat @ table.frame.quat)) > 1 - _STILL and np.abs(pos - table.frame.pos).max() <= _STILL
        if not same:
            raise messages.error(
                [problem("arena.spec", "carrier_moved", None, Told(element(model, "body", carrier)), table=table.body)]
            )


def check_coming(model: mujoco.MjModel, parts: Parts) -> None:
    """Refuses bodies that come and go while something ties them to what stays; warns of sensors that read where they are kept."""
    n, layout = len(parts.tables) + len(parts.objects), Layout.of(model, parts)
    for index, name in layout.held().items():
        if index >= n:
            raise messages.error([problem("arena.spec", "tied_body", None, parts.presence.bodies[index], name=name)])
    of = {_OBJ.mjOBJ_SITE: model.site_bodyid, _OBJ.mjOBJ_GEOM: model.geom_bodyid, _OBJ.mjOBJ_CAMERA: model.cam_bodyid}
    of |= dict.fromkeys((_OBJ.mjOBJ_BODY, _OBJ.mjOBJ_XBODY), np.arange(model.nbody))
    for sensor in range(model.nsensor):
        ends = (model.sensor_objtype, model.sensor_objid), (model.sensor_reftype, model.sensor_refid)
        seen = [
            of[_OBJ(kinds[sensor])][ids[sensor]]
            for kinds, ids in ends
            if _OBJ(kinds[sensor]) in of and ids[sensor] >= 0
        ]
        away = [parts.presence.bodies[layout.owner[body]] for body in seen if layout.owner[body] >= n]
        if away:
            messages.warn(
                problem("arena.spec", "sensor_of_absent", None, away[0], name=element(model, "sensor", sensor))
            )


def check_wraps(scene: Scene, quantities: frozenset[str]) -> None:
    """Refuses tendons whose path around a cylinder with a `sidesite` varies: MJX computes the side differently from C."""
    model, touched = scene.model, scene.touched(quantities)
    round_ = (model.wrap_type == mujoco.mjtWrap.mjWRAP_CYLINDER) & (model.wrap_prm >= 0)
    for i in range(model.ntendon):
        path = slice(model.tendon_adr[i], model.tendon_adr[i] + model.tendon_num[i])
        if round_[path].any() and touched.reroutes(i):
            names = element(model, "tendon", i), element(model, "geom", int(model.wrap_objid[path][round_[path]][0]))
            raise messages.error([problem("arena.spec", "wrapped_aside", None, Told(names[0]), geom=names[1])])

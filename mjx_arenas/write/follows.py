"""Fields that follow from other fields: what each reads, and its value (device, pure).

No rule knows a table, an object or a parameter. A rule declares the fields that it reads, and is computed only where one of them
differs between worlds, and where `reached` finds that this has an effect in the model at hand. Its `value` reads the model in which all
fields above it are written.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.named import ON_WARP
from mjx_arenas.quaternions import quat_mul, quat_rotate, quat_to_mat
from mjx_arenas.rows import replace_rows, take
from mjx_arenas.terms.term import Boxes, Depends
from mjx_arenas.write import statistics
from mjx_arenas.write.equalities import eq_data
from mjx_arenas.write.inertia import inertia_of, reflected
from mjx_arenas.write.kinematics import Alike, Kinematics, kinematics
from mjx_arenas.write.references import References, references, subtree_com, subtree_mass
from mjx_arenas.write.replace import replace
from mjx_arenas.write.scene import INERTIAL, Scene
from mjx_arenas.write.set_const import set_const
from mjx_arenas.write.touched import Touched
from mjx_arenas.write.weights import weights

_TRN, _EQ = mujoco.mjtTrn, mujoco.mjtEq
_AXIAL = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)

PRESENCE = "presence"
"""What is there, beside the fields of the model."""
_TURNS = frozenset({"body_quat", "qpos0"})  # how bodies are turned at `qpos0`
_POSES = _TURNS | {"body_pos", "jnt_pos"}
_PATHS = _POSES | {"site_pos", "geom_pos", "geom_quat", "geom_size"}  # of tendons
_INERTIA = _PATHS | {*INERTIAL, "jnt_axis", "dof_armature", "tendon_armature"}
_CENTRES = frozenset({"body_mass", "body_ipos"})  # of subtrees
_REACH = _POSES | {
    PRESENCE,
    "geom_size",
    "geom_rbound",
    "geom_pos",
    "body_ipos",
}  # of bodies from their centres of mass


class World:
    """One world while its fields are written."""

    def __init__(
        self,
        scene: Scene,
        template: mjx.Model,
        model: mjx.Model,
        there: jax.Array,
        boxes: Boxes | None,
        touched: Touched,
    ) -> None:
        self.scene, self.template, self.model = scene, template, model
        self.boxes, self.touched = boxes, touched
        self._there, self._memo = there, dict[str, Any]()

    def once(self, name: str, value: Callable[[], Any]) -> Any:
        """What several fields are read from; their rules stand below those of all that it is derived from."""
        if name not in self._memo:
            self._memo[name] = value()
        return self._memo[name]

    @property
    def there(self) -> jax.Array:
        """(nbody,) bool."""
        return self.once("there", lambda: self._there[self.scene.groups.body])

    @property
    def shown(self) -> jax.Array | None:
        """(ngeom,) bool: of the variant of its object that is there, or of none; None where objects have no variants."""
        groups = self.scene.groups
        return self.once("shown", lambda: self._there[groups.geom]) if groups.slots else None

    def kinematics(self, bodies: np.ndarray | None = None) -> Kinematics:
        """The poses in this world; of `bodies` that do not move, those of the template, the same for all worlds."""
        if bodies is not None and not self.scene.moves[bodies].any():
            return self.compiled
        return self.once("kinematics", lambda: kinematics(self.model, compiled=True, alike=self._alike))

    @property
    def compiled(self) -> Kinematics:
        """The poses of the template."""
        return self.once("compiled", lambda: kinematics(self.template, compiled=True))

    @property
    def _alike(self) -> Alike:
        absent, other = self.scene.absent, self.touched.rows("body_pos") | self.touched.rows("body_quat")
        for name in ("body_pos", "body_quat"):  # what is absent in the template may be there
            if name in absent:
                other[absent[name].elements // getattr(self.scene.model, name).shape[1]] = True
        return Alike(self.template, other)


class Rule(NamedTuple):
    """How a field follows from others."""

    field: str
    reads: frozenset[str]
    """Names of the fields from which it follows; `PRESENCE` may be among them."""
    value: Callable[[World], jax.Array]
    reached: Callable[[Scene, Touched], bool] = lambda scene, touched: True
    """Whether what differs of these fields reaches it in this model: of a tree that stands elsewhere as a whole no mass matters."""
    completes: bool = False
    """Terms decide some of its elements, from which the others follow."""

    def differs(self, scene: Scene, touched: Touched) -> bool:
        """Whether the field can differ between worlds."""
        read = touched.any(*self.reads - {PRESENCE}) or (PRESENCE in self.reads and touched.comes_and_goes)
        return read and self.reached(scene, touched)


def complete(
    scene: Scene,
    template: mjx.Model,
    written: dict[str, jax.Array],
    names: tuple[str, ...],
    there: jax.Array,
    boxes: Boxes | None,
    varying: Depends,
) -> dict[str, jax.Array]:
    """The fields that are written and, of these `names`, those that follow from them."""
    model = replace(template, {name: x for name, x in written.items() if name not in ON_WARP})
    world = World(scene, template, model, there, boxes, scene.touched(varying))
    for rule in RULES:
        if rule.field in names and (rule.field not in written or rule.completes):
            written[rule.field] = rule.value(world)
            world.model = replace(world.model, {rule.field: written[rule.field]})
    return written


# Masses and weights.


def _heavier(scene: Scene, touched: Touched) -> bool:
    return bool(len(touched.heavier_roots))


def _weight(name: str) -> Rule:
    def value(world: World) -> jax.Array:
        found = world.once("weights", lambda: weights(world.model, world.touched.heavier_roots))
        return getattr(found, name)

    return Rule(name, _INERTIA, value, _heavier)


def _constant(name: str, reads: frozenset[str], reached: Callable[[Scene, Touched], bool]) -> Rule:
    return Rule(
        name, reads, lambda world: getattr(world.once("set_const", lambda: set_const(world.model)), name), reached
    )


def _tendons_move(scene: Scene, touched: Touched) -> bool:
    return bool(scene.model.ntendon) and touched.any(*_PATHS)


def _tendon_weights(scene: Scene, touched: Touched) -> bool:
    return _tendons_move(scene, touched) or (bool(scene.model.ntendon) and _heavier(scene, touched))


def _actuators(scene: Scene, touched: Touched) -> bool:
    """Actuators feel their trees' weights; all but those along the axis of a hinge or a slide feel poses, too."""
    model = scene.model
    axis = (
        np.isin(model.jnt_type[model.actuator_trnid[:, 0].clip(0, max(model.njnt - 1, 0))], _AXIAL)
        if model.njnt
        else False
    )
    along = (model.actuator_trntype == _TRN.mjTRN_JOINT) & axis | (model.actuator_trntype == _TRN.mjTRN_BODY)
    posed = not along.all() and (touched.moved.any() or touched.any("qpos0", "site_pos", "site_quat"))
    posed |= bool((model.actuator_trntype == _TRN.mjTRN_TENDON).any()) and _tendons_move(scene, touched)
    return bool(model.nu) and bool(
        posed or _heavier(scene, touched) or touched.any("actuator_gear", "actuator_cranklength")
    )


_SERVOS = frozenset({"actuator_biasprm", "actuator_gainprm", "actuator_gear"})


def _rated(scene: Scene, touched: Touched) -> bool:
    """Whether servos have a `dampratio`, and other gains, gears or weights."""
    weighs = _heavier(scene, touched) or _tendon_weights(scene, touched)
    return bool(len(scene.ratios.ids)) and (weighs or touched.any("actuator_gainprm", "actuator_gear"))


def _biasprm(world: World) -> jax.Array:
    model, ratios = world.model, world.scene.ratios
    bias = model.actuator_biasprm
    places = ratios.ids * bias.shape[-1] + 2
    return replace_rows(bias.reshape(-1), places, -ratios.dampings(model)).reshape(bias.shape)


def _tied_bodies_move(scene: Scene, touched: Touched) -> bool:
    """Whether bodies that an equality connects or welds stand elsewhere."""
    model = scene.model
    tied = np.isin(model.eq_type, (int(_EQ.mjEQ_CONNECT), int(_EQ.mjEQ_WELD)))
    tied &= model.eq_objtype == mujoco.mjtObj.mjOBJ_BODY
    bodies = np.concatenate([model.eq_obj1id[tied], model.eq_obj2id[tied]])
    return bool(touched.moved[bodies].any() or touched.rows("eq_data")[tied].any())


# Statistics.


def _statistics(world: World) -> statistics.Statistic:
    """Statistics over what is there, as if the model did not have the rest.

    Only `meaninertia` still divides by `nv`: MJX scales costs by its product with `nv`, which then is that of the model
    without what is absent. What does not move is computed once for all worlds; what closed forms cover, and bodies that are
    spheres here, in closed form.
    """
    scene, model, there = world.scene, world.model, world.there
    kin, ball = world.kinematics(), scene.ball_geom
    ball_body = scene.model.geom_bodyid[ball]
    sized = model if world.touched.rows("geom_size")[ball].any() else world.template
    center, radius = take(kin.pos, ball_body), take(sized.geom_rbound, ball)
    still = world.kinematics(scene.still.body)
    corners = [
        statistics.bounds(world.template, still, scene.still),
        statistics.bounds(model, kin, scene.rest, there, world.shown),
        _box(center - radius[:, None], center + radius[:, None], there[ball_body]),
    ]
    known = jnp.zeros(model.nbody)
    if world.boxes is not None:
        boxes = world.boxes
        corners.append(_box(jnp.asarray(boxes.low), jnp.asarray(boxes.high), there[boxes.bodies]))
        known = replace_rows(known, boxes.bodies, jnp.asarray(boxes.reach))
    low = functools.reduce(jnp.minimum, [low for low, _ in corners])
    high = functools.reduce(jnp.maximum, [high for _, high in corners])

    rigid = scene.rigid(world.touched)
    reaching = np.setdiff1d(np.arange(1, model.nbody), rigid)
    same = statistics.sizes(world.template, world.compiled, scene.every, rigid, shown=world.shown)
    other = statistics.sizes(model, kin, scene.every, reaching, there, world.shown)
    other = jnp.maximum(other, take(replace_rows(known, ball_body, radius), reaching))
    reach = jnp.where(take(there, rigid), same, 0.0).sum() + jnp.where(take(there, reaching), other, 0.0).sum()
    count = jnp.maximum(there[1:].sum(), 1)
    inertia = model.dof_M0
    if scene.reflects:
        inertia = inertia + reflected(inertia_of(model, kinematics(model), np.zeros(0, int)))
    moves = there[model.dof_bodyid]
    inertia = jnp.where(moves, inertia, 0.0)
    mean = (
        jnp.where(moves.any(), inertia.mean(), 1.0) if model.nv else model.stat.meaninertia
    )  # 1: the compiler's of none
    return statistics.combine(
        low,
        high,
        reach / count,
        jnp.where(there, model.body_mass, 0.0)[1:].sum() / count,
        mean,
        some=there[1:].any(),
    )


def _box(low: jax.Array, high: jax.Array, there: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Corners (3,) of the box around those boxes (n, 3) that are there."""
    if not len(there):
        return jnp.full(3, statistics.FAR), jnp.full(3, -statistics.FAR)
    low, high = jnp.where(there[:, None], low, statistics.FAR), jnp.where(there[:, None], high, -statistics.FAR)
    return low.min(0, initial=statistics.FAR), high.max(0, initial=-statistics.FAR)


def _statistic(
    name: str, reads: frozenset[str], reached: Callable[[Scene, Touched], bool] = lambda scene, touched: True
) -> Rule:
    return Rule(
        f"stat.{name}", reads, lambda world: getattr(world.once("statistic", lambda: _statistics(world)), name), reached
    )


def _bounds_change(scene: Scene, touched: Touched) -> bool:
    """How geoms are turned does not matter to the spheres around them, but where C has moved them a little."""
    reads = _REACH - {PRESENCE} | {"site_pos"}
    return touched.comes_and_goes or touched.any(*reads) or _snap_out(scene, touched)


def _reaches_change(scene: Scene, touched: Touched) -> bool:
    """How bodies stand does not matter to how far they reach, but to the joints of their children."""
    moved = touched.any("geom_size", "geom_pos", "body_ipos", "jnt_pos") or tree_inner(scene, touched)
    return touched.comes_and_goes or moved or _snap_out(scene, touched)


def _snap_out(scene: Scene, touched: Touched) -> bool:
    """Whether geoms turn that are 1e-6 m or less off the frame of their body or of its inertia: C has them there until they do."""
    model, same = scene.model, mujoco.mjtSameFrame
    off = model.geom_pos - model.body_ipos[model.geom_bodyid]
    by_body, by_mass = (model.geom_sameframe == kind for kind in (same.mjSAMEFRAME_BODY, same.mjSAMEFRAME_INERTIA))
    return touched.any("geom_quat") and bool(model.geom_pos[by_body].any() or off[by_mass].any())


def tree_inner(scene: Scene, touched: Touched) -> bool:
    """Whether joints' anchors move in the frames of the bodies that carry them."""
    model = scene.model
    own = touched.rows("body_pos") | touched.rows("body_quat")
    hinged = model.jnt_bodyid[model.jnt_type != mujoco.mjtJoint.mjJNT_FREE]
    return bool(own[hinged].any())


# Cameras and lights.


def _reference(kind: str, name: str, reads: frozenset[str], reached: Callable[[Scene, Touched], bool]) -> Rule:
    def value(world: World) -> jax.Array:
        def found() -> References:
            body, target = world.scene.aimed[kind].T
            kin = world.kinematics()
            com = subtree_com(world.model, kin, np.where(target >= 0, target, body), world.scene.heavy)
            return references(world.kinematics(body), body, getattr(world.model, f"{kind}_pos"), com)

        return getattr(world.once(kind, found), name)

    return Rule(f"{kind}_{name}", reads | {f"{kind}_pos"}, value, reached)


def _turns(kind: str, *own: str) -> Callable[[Scene, Touched], bool]:
    """Whether cameras or lights stand turned otherwise in the world, or their own fields differ."""
    return lambda scene, touched: bool(touched.turned[scene.aimed[kind][:, 0]].any() or touched.any(*own))


def _there(kind: str) -> Callable[[Scene, Touched], bool]:
    return lambda scene, touched: bool(len(scene.aimed[kind]))


def _cam_mat0(world: World) -> jax.Array:
    body = world.scene.aimed["cam"][:, 0]
    return quat_to_mat(quat_mul(world.kinematics(body).quat[body], world.model.cam_quat))


def _light_dir0(world: World) -> jax.Array:
    body = world.scene.aimed["light"][:, 0]
    return quat_rotate(world.kinematics(body).quat[body], world.model.light_dir)


RULES: tuple[Rule, ...] = (
    Rule("body_subtreemass", frozenset({"body_mass"}), lambda world: subtree_mass(world.model)),
    _weight("dof_M0"),
    _weight("dof_invweight0"),
    _weight("body_invweight0"),
    _constant("tendon_length0", _PATHS, _tendons_move),
    _constant("tendon_invweight0", _INERTIA, _tendon_weights),
    _constant("actuator_acc0", _INERTIA | {"site_quat", "actuator_gear", "actuator_cranklength"}, _actuators),
    Rule("actuator_biasprm", _INERTIA | _SERVOS, _biasprm, _rated, completes=True),
    Rule(
        "eq_data",
        _POSES | {"eq_data"},
        lambda world: eq_data(world.model, world.kinematics()),
        _tied_bodies_move,
        completes=True,
    ),
    _statistic("center", _REACH | {"site_pos", "geom_quat"}, _bounds_change),
    _statistic("extent", _REACH | {"site_pos", "geom_quat"}, _bounds_change),
    _statistic("meansize", _REACH | {"geom_quat"}, _reaches_change),
    _statistic("meanmass", frozenset({PRESENCE, "body_mass"})),
    _statistic(
        "meaninertia", _INERTIA | {PRESENCE}, lambda scene, touched: touched.comes_and_goes or _heavier(scene, touched)
    ),
    _reference("cam", "pos0", _TURNS, _turns("cam", "cam_pos")),
    Rule("cam_mat0", _TURNS | {"cam_quat"}, _cam_mat0, _turns("cam", "cam_quat")),
    _reference("cam", "poscom0", _POSES | _CENTRES, _there("cam")),
    _reference("light", "pos0", _TURNS, _turns("light", "light_pos")),
    Rule("light_dir0", _TURNS | {"light_dir"}, _light_dir0, _turns("light", "light_dir")),
    _reference("light", "poscom0", _POSES | _CENTRES, _there("light")),
)
"""Every field that follows, below those from which it follows."""

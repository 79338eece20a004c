"""Friction that varies is that of contacts in C MuJoCo, or a warning says that it is not."""

import warnings

import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.problems.messages import problems_of
from mjx_arenas.terms.rubbing import rubbing


def sliding(least, most):
    """A range of sliding friction alone."""
    return mja.Uniform([least, 0.005, 0.0001], [most, 0.005, 0.0001])


def arena(priority=0, objects=1, raised=0, stick=None, apart=None, vary=True):
    """A table with cubes in a row, the first of which has a `priority`, and a stick of a friction, on a joint of its own.

    `apart`: stick and table have an "exclude", or a "pair" with friction of its own.
    """
    cubes = [mja.Object(f"cube{i}", full_size=0.06, pos=(0.08 * i, 0)) for i in range(objects)]
    made = mja.TableArena(objects=cubes, table_priority=priority)
    for name in ["cube0_g0"][:objects]:
        made.spec.geom(name).priority = raised
    if stick is not None:
        body = made.spec.worldbody.add_body(name="stick", pos=(-0.1, 0, 0.819))
        body.add_joint(name="stick", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(1, 0, 0))
        body.add_geom(
            name="stick",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=(0.02, 0.02, 0.02),
            mass=1,
            friction=(stick, 0.005, 0.0001),
        )
        if apart == "exclude":
            made.spec.add_exclude(bodyname1="stick", bodyname2="table")
        if apart == "pair":
            made.spec.add_pair(geomname1="table_collision", geomname2="stick", friction=[0.7] * 5)
        if vary:
            made.vary(pad=dr.Term("geom.friction", "stick", axes="sliding"))
    return made


def contacts(one, quantity, value):
    """Sliding friction of the contacts in C of the recompiled world with a number, by the names of the geoms, pushed together."""
    params = one.nominal_params()
    old = params.terms[quantity] if quantity in params.terms else getattr(params, quantity)
    new = np.array(old, float)
    new[:, 0] = value
    given = {"terms": {**params.terms, quantity: new}} if quantity in params.terms else {quantity: new}
    model, data = one.c_world(params._replace(**given))
    for i in range(1, len(one.objects)):
        data.joint(f"cube{i}_joint0").qpos[0] = data.joint("cube0_joint0").qpos[0] + 0.0595 * i
    for name in ["stick"][: bool(params.terms)]:
        data.joint(name).qpos[0] = 0.051
    mujoco.mj_forward(model, data)
    return {tuple(model.geom(g).name for g in c.geom): float(c.friction[0]) for c in data.contact}


CASES = (  # arena, quantity, range, rule
    ({"priority": 0}, "table_frictions", (0.2, 0.9), "idle_sliding"),
    ({"priority": 0}, "table_frictions", (0.4, 1.2), "idle_below"),
    ({"priority": 0}, "table_frictions", (1.0, 1.2), None),
    ({"priority": 1}, "table_frictions", (0.2, 0.9), None),
    ({"priority": 1, "raised": 2}, "table_frictions", (0.2, 0.9), "idle_priority"),
    ({"priority": 0, "stick": 0.3, "objects": 0}, "table_frictions", (0.4, 0.9), None),
    ({"priority": 0}, "object_frictions", (0.2, 0.9), "idle_sliding"),
    ({"priority": 0, "objects": 2}, "object_frictions", (0.2, 0.9), None),
    ({"priority": 1}, "object_frictions", (0.2, 0.9), "idle_objects"),
    ({"priority": 2, "raised": 1, "stick": 1.5}, "object_frictions", (0.2, 0.9), None),
    ({"priority": 2, "raised": 1, "stick": 1.5}, "pad", (0.2, 0.9), "idle_sliding"),
    ({"priority": 0, "stick": 1.5}, "pad", (0.2, 0.9), "idle_sliding"),
    ({"priority": 0, "stick": 1.5}, "pad", (1.1, 1.9), None),
    ({"priority": 0, "stick": 0.3}, "table_frictions", (0.4, 0.9), None),
    ({"priority": 0, "stick": 0.3, "apart": "exclude"}, "table_frictions", (0.4, 0.9), "idle_sliding"),
    ({"priority": 0, "stick": 0.3, "apart": "pair"}, "table_frictions", (0.4, 0.9), "idle_sliding"),
)


def test_a_fixed_number_has_no_effect():
    """One number for all worlds is as idle as a range; not the nominal one."""
    objects = [mja.Object("cube", friction=(0.3, 0.005, 1e-4))]
    rough = mja.TableArena(objects=objects, table_priority=0)
    rough.check_ranges(mja.ArenaRanges(object_frictions=mja.Fixed(rough.nominal_params().object_frictions)))  # rounded
    given = {"low": mja.Fixed(0.3), "nominal": mja.Fixed(1.0), "high": mja.Fixed(1.5)}
    for name, dist in given.items():
        one = arena(priority=0, stick=1.2 if name == "low" else 1.0)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            one.check_ranges(mja.ArenaRanges(table_frictions=dist))
        assert [problems_of(w.message)[0].rule for w in caught] == ["idle_sliding"] * (name == "low")


@pytest.mark.parametrize(("made", "quantity", "bounds", "rule"), CASES)
def test_a_warning_where_no_contact_changes(made, quantity, bounds, rule):
    """And where below some number none does; none where one does all the way."""
    one = arena(**made)
    given = {"terms": {quantity: mja.Uniform(*bounds)}} if quantity == "pad" else {quantity: sliding(*bounds)}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        one.check_ranges(mja.ArenaRanges(**given))
    assert [problems_of(w.message)[0].rule for w in caught] == [rule] * (rule is not None)
    if made.get("objects") == 0:
        return  # nothing touches anything in its nominal world
    low, high = bounds
    least, middle, most = (contacts(one, quantity, x) for x in (low, low + (high - low) / 4, high))
    assert least.keys() == most.keys() != set()
    assert (least != most) == (rule in (None, "idle_below"))
    assert (least == middle) == (rule is not None)


@pytest.mark.parametrize("priority", [0, 1, 2])
@pytest.mark.parametrize("scene", [False, True], ids=["of its own", "of a scene"])
def test_furniture_is_like_tables(priority, scene):
    """An object has the same friction on a board as on a table, whichever of the two decides; the warning knows both."""
    objects = [mja.Object("a", full_size=0.06, friction=(0.8, 0.005, 0.0001))]
    if scene:
        xml = '<mujoco><worldbody><geom name="desk" type="box" size=".5 .5 .02" pos="0 0 .7" friction=".3"/></worldbody></mujoco>'
        made = mja.Arena.from_xml(xml, ["desk"], objects=objects, table_priority=priority)
    else:
        made = mja.TableArena(table_friction=(0.3, 0.005, 0.0001), objects=objects, table_priority=priority)
    made.add_part(furniture.Shelf("rack", pos=(2, 0, 0), friction=(0.3, 0.005, 0.0001)))
    made.add_object(mja.Object("b", full_size=0.06, friction=(0.8, 0.005, 0.0001), on="rack_board1"))
    for name in ("a_g0", "b_g0"):
        made.spec.geom(name).priority = int(priority == 2)
    for value in (0.2, 0.9):
        frictions = np.array([[value, 0.005, 0.0001]] * 2)
        model, data = made.c_world(made.nominal_params()._replace(object_frictions=frictions))
        for name in "ab":
            data.joint(f"{name}_joint0").qpos[2] -= 1e-4
        mujoco.mj_forward(model, data)
        found = {
            model.geom(g).name: float(c.friction[0])
            for c in data.contact
            for g in c.geom
            if model.geom(g).name[:2] in ("a_", "b_")
        }
        want = 0.3 if priority else max(value, 0.3)
        assert found == pytest.approx({"a_g0": want, "b_g0": want})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made.check_ranges(mja.ArenaRanges(object_frictions=sliding(0.4, 0.9)))
    told = [str(w.message).partition(". ")[0] for w in caught if problems_of(w.message)[0].rule == "idle_objects"]
    said = "`ranges.object_frictions` has no effect on tables and furniture, whose own friction counts"
    assert told == [said] * (priority == 1)


TREE = """<mujoco><option><flag {flag}/></option><worldbody><geom name="floor" type="plane" size="1 1 .1"/>
  <body name="shelf"><geom name="shelf" size=".1"/></body>
  <body name="marker" mocap="true"><geom name="marker" size=".1"/><body name="flag"><geom name="flag" size=".1"/></body></body>
  <body name="upper"><joint/><geom name="upper" size=".1"/>
    <body name="plate"><geom name="plate" size=".1"/>
      <body name="fore"><joint/><geom name="fore" size=".1"/><geom name="skin" size=".1" contype="2" conaffinity="0"/>
        <body name="tip"><joint/><geom name="tip" size=".1" conaffinity="3"/></body></body></body></body>
  <body name="free"><freejoint/><geom name="free" size=".1" contype="0" conaffinity="2"/>
    <geom name="shown" size=".1" contype="0" conaffinity="0"/></body>
  </worldbody><contact><exclude body1="tip" body2="upper"/><exclude body1="world" body2="fore"/>
    <pair geom1="upper" geom2="fore"/><pair geom1="tip" geom2="marker"/></contact></mujoco>"""


@pytest.mark.parametrize("raised", [0, 1])
def test_friction_of_robots(raised):
    """What `dr.robot` varies is that of a contact with the object, or a warning says that the object's counts, and how much it can be."""
    one = arena(raised=raised, stick=1.5, vary=False)
    preset = dr.robot(one.spec, "stick")
    one.vary(stickfriction=preset.terms["stickfriction"])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        one.check_ranges(mja.ArenaRanges(terms={"stickfriction": preset.ranges["stickfriction"]}))
    assert [problems_of(w.message)[0].rule for w in caught] == ["idle_on_objects"] * raised
    met = [contacts(one, "stickfriction", x)["cube0_g0", "stick"] for x in (1.05, 1.95)]
    assert met == ([1.0, 1.0] if raised else [1.05, 1.95])


@pytest.mark.filterwarnings("ignore:The arena. geoms are inside each other")
@pytest.mark.parametrize("flag", ["", 'filterparent="disable"', 'contact="disable"'])
def test_what_may_touch(flag):
    """The geoms whose friction meets are those of C's contacts, of a model in which all are in one place."""
    made = mja.Arena.from_xml(TREE.format(flag=flag))
    found = rubbing(made.spec, made.record.parts)
    names = [geom.name for body in made.spec.bodies for geom in body.geoms if geom.contype or geom.conaffinity]
    got = {frozenset((names[i], names[j])) for i, j in zip(*np.nonzero(found.touch), strict=True)}
    model = made.mj_model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    paired = {frozenset(x) for x in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)}
    touching = {frozenset(c.geom.tolist()) for c in data.contact} - paired
    assert got == {frozenset(model.geom(g).name for g in pair) for pair in touching}
    assert bool(got) == ("contact" not in flag)


@pytest.mark.xslow
@pytest.mark.slow
@pytest.mark.parametrize("task", ["PickAndPlace", pytest.param("Lift", marks=pytest.mark.xslow)])
def test_friction_of_tasks(task):
    """A box has its table's friction on it, in C, and its own between fingers; both differ between worlds, and critics are told them."""
    envs = pytest.importorskip("mjx_arenas.envs")
    import jax

    env = getattr(envs, task)(config_overrides={"impl": "jax"})
    module = __import__(
        f"mjx_arenas.envs.tasks.{'lift' if task == 'Lift' else 'pick_and_place'}", fromlist=["wider_ranges"]
    )
    env.arena.check_ranges(module.wider_ranges())  # a warning would be an error
    first = jax.device_get(jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), 5)))
    tables = env.arena.mj_model.geom(f"{env.arena.table_names[0]}_collision").name
    seen = []
    for w in range(5):
        model, data = env.arena.c_world(jax.tree.map(lambda x, w=w: x[w], first.info["episode"].params))
        data.qpos[:] = first.data.qpos[w]
        box = data.joint("box_joint0").qpos
        box[2] -= 0.002
        found = {}
        for _ in range(2):
            mujoco.mj_forward(model, data)
            for c in data.contact:
                found[frozenset(model.geom(g).name for g in c.geom)] = c.friction[0]
            box[:3] = data.site("arm_tool").xpos
            for name in env.finger_joints:
                data.joint(name).qpos[0] = -0.04
        left, right, table = (found[frozenset({"box_g0", name})] for name in ("arm_left", "arm_right", tables))
        assert left == right
        seen.append((left, table))
        told = first.obs["privileged_state"][w]
        np.testing.assert_allclose(told[[-2, -1] if task == "Lift" else [-3, -2]], seen[-1], rtol=1e-6)
    seen = np.array(seen)
    assert (seen >= 0.4).all()
    assert (seen <= 1.2).all()
    assert (np.ptp(seen, axis=0) > 0.2).all()
    assert abs(np.corrcoef(seen.T)[0, 1]) < 0.999


@pytest.mark.slow
def test_slides_on_furniture():
    """A ball that slides on a worktop is slowed by the worktop's friction, on MJX as in C, and much as Coulomb's law says."""
    made = mja.TableArena()
    made.add_part(furniture.Counter("c", pos=(2, 0, 0), widths=[2.0]))
    made.add_object(mja.Object("ball", "sphere", 0.06, on="c_top0"))
    ranges = mja.ArenaRanges(terms={"c.friction": sliding(0.2, 0.9)})
    keys, speed, rest, steps = mja.world_keys(0, range(6)), 0.8, 50, 10
    batch = made.randomize(made.put_model("jax"), keys, ranges)
    data = mja.rollout(batch, mja.make_data(batch), rest)
    slowed = speed - np.asarray(mja.rollout(batch, data.replace(qvel=data.qvel.at[:, 1].set(speed)), steps).qvel)[:, 1]
    for i in range(len(keys)):
        model, one = made.c_world(batch.world(i))
        for step in range(rest + steps):
            if step == rest:
                one.qvel[1] = speed
            mujoco.mj_step(model, one)
        assert slowed[i] == pytest.approx(speed - one.qvel[1], rel=1e-3)
    friction = np.asarray(batch.params.terms["c.friction"])[:, 0, 0]
    np.testing.assert_allclose(slowed, friction * 9.81 * steps * model.opt.timestep, rtol=0.25)  # it springs a little


def test_without_tables():
    """Furniture alone decides as tables do: with `table_priority=0` the objects' friction counts where it is larger."""
    scene = "<mujoco><worldbody><geom name='floor' type='plane' size='3 3 .1'/></worldbody></mujoco>"

    def drawn(priority, least, most):
        made = mja.Arena.from_xml(scene, table_priority=priority)
        made.add_part(mja.furniture.Counter("c"))
        made.add_object(mja.Object("cube", on="c_top0"))
        made.check_ranges(mja.ArenaRanges(object_frictions=sliding(least, most)))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn(0, 1.1, 1.5)
    with pytest.warns(
        UserWarning, match="has no effect: everything that can touch these geoms has a sliding friction of 1 or more"
    ):
        drawn(0, 0.2, 0.9)
    with pytest.warns(
        UserWarning, match=r"^`ranges\.object_frictions` has no effect on furniture, whose own friction counts"
    ):
        drawn(1, 1.1, 1.5)


BLOCK = """<mujoco><worldbody><body name="block"><freejoint/><geom name="low" size=".02"/>
  <geom name="high" size=".02" pos="0 0 .03" priority="3"/></body></worldbody></mujoco>"""


def test_priorities_of_objects(tmp_path):
    """Are given, or those of an MJCF file, of each geom and variant; a file of an arena keeps them."""

    def mjcf(**given):
        return mja.Object("block", "mjcf", file=str(tmp_path / "block.xml"), **given)

    (tmp_path / "block.xml").write_text(BLOCK)
    variants = [mja.Object("a", priority=3), mja.Object("b", "sphere", 0.05)]
    for block, low, high in ((mjcf(), 0, 3), (mjcf(priority=-2), -2, -2)):
        objects = [
            mja.Object("cube", priority=1),
            mja.Object("ball", "sphere"),
            mja.Object("v", variants=variants),
            block,
        ]
        arena = mja.TableArena(table_priority=2, objects=objects)
        mja.save(tmp_path / "arena.yaml", arena)
        want = {
            "cube_g0": 1,
            "ball_g0": 0,
            "v_a_g0": 3,
            "v_b_g0": 0,
            "block_low": low,
            "block_high": high,
            "table_collision": 2,
        }
        for model in (arena.mj_model, mja.load(tmp_path / "arena.yaml")[0].mj_model):
            assert {name: int(model.geom(name).priority[0]) for name in want} == want
    for wrong in (1.5, True, "high"):
        with pytest.raises(ValueError, match=r"^Object 'cube': `priority` must be a whole number, got "):
            mja.TableArena(objects=[mja.Object("cube", priority=wrong)])
    with pytest.raises(ValueError, match="`priority`"):
        mja.TableArena(objects=[mja.Object("v", variants=variants, priority=1)])

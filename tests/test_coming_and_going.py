"""Bodies that come and go (`body.active`): worlds are those that the compiler makes without them."""

import re

import jax
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.write import follows

SCENE = """<mujoco><worldbody><light name="sun" pos="0 0 4"/><geom name="floor" type="plane" size="3 3 .1"/>
<body name="shelf" pos=".5 0 0"><geom name="back" type="box" size=".02 .5 .5" pos=".3 0 .5" mass="3"/>
<body name="board" pos="0 0 .4"><geom name="board" type="box" size=".3 .5 .02" rgba=".5 .3 .1 1"/>
<body name="lip" pos="-.3 0 .04"><geom name="lip" type="box" size=".01 .5 .02"/><site name="tip" size=".01"/></body></body></body>
<body name="post" pos="-1 0 .3" euler="0 20 0"><geom name="post" type="capsule" size=".1 .2"/></body>
<body name="ball" pos=".5 0 .6"><freejoint name="free"/><geom name="ball" size=".05"/></body>
<body name="door" pos="0 2 .5"><joint name="hinge"/><geom name="door" type="box" size=".3 .02 .4"/></body>
<body name="base" pos="0 -2 .5" euler="0 0 30"><geom name="base" type="box" size=".1 .1 .1" contype="0" conaffinity="0"/>
<body name="link" pos="0 0 .2"><joint name="shoulder" axis="0 1 0" damping=".2" armature=".02"/>
<geom name="link" type="capsule" size=".03" fromto="0 0 0 .1 0 .3"/></body></body></worldbody>
<actuator><position name="lift" joint="shoulder" kp="5"/></actuator></mujoco>"""
BODIES = ("shelf", "board", "lip", "post", "door", "base")
CASES = [
    (True, False, True, False, True, True),
    (False, True, True, True, False, True),
    (True, True, False, True, True, False),
    (True, True, True, True, True, True),
]


@pytest.fixture(scope="module")
def arena():
    arena = mja.Arena.from_xml(SCENE)
    sized = ["board", "post", "door", "link"]
    arena.vary(there=dr.Term("body.active", list(BODIES)), size=dr.Term("geom.size", sized))
    return arena


def params_of(arena, there):
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    return nominal._replace(terms={"there": np.array(there), "size": nominal.terms["size"] * 1.2})


@pytest.mark.slow
@pytest.mark.slow_on("warp")
@pytest.mark.parametrize("there", CASES)
def test_what_is_left_is_compiled(arena, impl, there):
    """Field by field, each element that is left as in the world compiled without the rest; statistics, too."""
    hold(arena, impl, params_of(arena, there), there)


def test_presence_alone_varies():
    """Bodies come and go, and no mass differs: what follows from masses is still that of what is left."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(there=dr.Term("body.active", list(BODIES)))
    params = jax.tree.map(np.asarray, arena.nominal_params())
    for there in CASES[:2]:
        hold(arena, "jax", params._replace(terms={"there": np.array(there)}), there)


def test_a_statistic_that_is_forgotten_is_found(monkeypatch):
    """When the arena is compiled: a rule that says that the mean inertia does not follow is refused."""
    rules = tuple(r for r in follows.RULES if r.field != "stat.meaninertia")
    monkeypatch.setattr(follows, "RULES", rules)
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(there=dr.Term("body.active", "door"))
    with pytest.raises(ValueError, match=r"stat\.meaninertia would be stale where something is absent"):
        arena.mj_model  # noqa: B018


def hold(arena, impl, params, there):
    """The written world against the compiled one."""
    compiled = arena.compile(params)
    gone = {name for name, here in zip(BODIES, there, strict=True) if not here}
    if "shelf" in gone:
        gone |= {"board", "lip"}
    elif "board" in gone:
        gone |= {"lip"}
    gone |= {"link"} & {name.replace("base", "link") for name in gone}
    names = {compiled.body(i).name for i in range(compiled.nbody)}
    assert names == {"world", *BODIES, "link", "ball"} - gone
    compared, off = oracle.of_what_is_left(arena.apply(arena.put_model(impl), params), arena.mj_model, compiled)
    assert not off
    assert len(compared) > 40
    assert compared >= {
        "stat.meaninertia",
        "dof_M0",
        "dof_invweight0",
        "actuator_acc0",
        "body_mass",
        "geom_size",
        "jnt_range",
    }


@pytest.mark.xslow_on("jax")
@pytest.mark.slow_on("jax")
@pytest.mark.slow
def test_balls_fall_through_what_is_not_there(arena, impl):
    """As in C; nothing is drawn of it, and rays pass."""
    batch = arena.batch(
        arena.put_model(impl), jax.tree.map(lambda *x: np.stack(x), *(params_of(arena, t) for t in CASES))
    )
    assert batch.valid.all()
    data = mja.rollout(batch, mja.make_data(batch), 250)
    for i, there in enumerate(CASES):
        model, c = arena.c_world(batch.world(i))
        mujoco.mj_step(model, c, 250)
        np.testing.assert_allclose(data.qpos[i, 2], c.joint("free").qpos[2], atol=2e-4)
        if there[5]:  # the arm swings as in C
            swings = data.qpos[i, arena.mj_model.joint("shoulder").qposadr[0]]
            np.testing.assert_allclose(swings, c.joint("shoulder").qpos[0], atol=2e-4)
        on_board = there[0] and there[1]
        assert (data.qpos[i, 2] > 0.3) == on_board
        assert (np.asarray(batch.model.geom_rgba)[i, arena.mj_model.geom("board").id, 3] > 0) == on_board
        shown = arena.c_world(batch.world(i), data=mja.take(data, i))[1]
        joints = [arena.mj_model.joint(shown.model.joint(j).name) for j in range(shown.model.njnt)]
        np.testing.assert_allclose(
            shown.qpos, np.concatenate([data.qpos[i, j.qposadr[0] :][: len(j.qpos0)] for j in joints]), atol=1e-6
        )


@pytest.mark.slow
def test_drawn_and_written(arena, tmp_path):
    """By `Bernoulli` or `Count`; files leave out what is not there."""
    ranges = mja.ArenaRanges(terms={"there": mja.Bernoulli(0.5)})
    batch = arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(64)), ranges)
    assert batch.valid.all()
    share = np.asarray(batch.params.terms["there"]).mean(0)
    assert (np.abs(share - 0.5) < 4 * 0.5 / 8).all()
    params = params_of(arena, (True, False, True, True, True, False))
    assert "board" not in arena.to_xml(params)
    arena.export(params, tmp_path / "world")
    assert "board" not in (tmp_path / "world" / "world.xml").read_text()
    assert mja.check(arena, ranges, n_worlds=8, n_steps=5, engine="c").ok


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.parametrize("engine", ["jax", "warp"])
def test_steps_are_healthy(arena, engine):
    """What comes and goes touches nothing where it is kept, on MJX, too."""
    ranges = mja.ArenaRanges(terms={"there": mja.Bernoulli(0.5)})
    assert mja.check(arena, ranges, n_worlds=8, n_steps=5, engine=engine).ok


def test_beside_tables():
    """Tables, objects and other bodies each by their own quantity, together."""
    arena = mja.MultiTableArena(table_offsets=[[0, 0, 0.8], [2, 0, 0.8]], objects=[mja.Object("cube")])
    arena.attach(
        '<mujoco><worldbody><body name="pole" pos="0 0 .5"><geom name="pole" size=".05 .5" type="capsule"/></body></worldbody></mujoco>',
        "r_",
        pos=(1, 2, 0),
    )
    arena.vary(pole=dr.Term("body.active", "r_pole"))
    params = jax.tree.map(np.asarray, arena.nominal_params())
    params = params._replace(table_active=np.array([True, False]), terms={"pole": np.array([False])})
    compiled = arena.compile(params)
    got = arena.apply(arena.put_model("jax"), params)
    for name in ("center", "extent", "meansize", "meanmass", "meaninertia"):
        np.testing.assert_allclose(
            getattr(got.stat, name), getattr(compiled.stat, name), rtol=1e-5, atol=1e-6, err_msg=name
        )
    assert compiled.nbody == arena.mj_model.nbody - 2
    with pytest.raises(
        ValueError, match=r"'body\.active' of body .* cannot vary, as 'cube' comes and goes by its own quantity\.$"
    ):
        mja.TableArena(objects=[mja.Object("cube")]).vary(x=dr.Term("body.active", "cube"))


MORE = """<body name="hand" mocap="true"><geom size=".1" contype="0" conaffinity="0"/></body>
<body name="rod" pos="3 0 1"><joint/><geom size=".1"/><body name="tip" pos="0 0 1"><geom size=".1"/></body></body></worldbody>"""


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("ball", "it is free: make it an Object, which has `object_active`"),
        (
            "tip",
            "it is attached to a moving body, whose mass would change with it: vary `body.active` of what carries it",
        ),
        ("hand", "it is a mocap body, or is attached to one: put that elsewhere by `body.pos`"),
    ],
)
def test_refused(name, why):
    with pytest.raises(ValueError, match=f"cannot vary, as {re.escape(why)}\\.$"):
        mja.Arena.from_xml(SCENE.replace("</worldbody>", MORE)).vary(x=dr.Term("body.active", name))


def test_tied_bodies_stay():
    """What is welded to something else."""
    tied = SCENE.replace("</mujoco>", '<equality><weld name="w" body1="post" body2="ball"/></equality></mujoco>')
    arena = mja.Arena.from_xml(tied)
    arena.vary(x=dr.Term("body.active", "post"))
    with pytest.raises(
        ValueError, match=r"body 'post' cannot come and go \(`body\.active`\), as equality 'w' ties it\.$"
    ):
        arena.mj_model  # noqa: B018


@pytest.mark.parametrize("attribute", ["body.pseudo_inertia", "body.payload"])
def test_beside_principal_axes(attribute):
    """Principal axes may come in another order where something is absent: the tensors are the same."""
    links = (
        '<geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/>',
        '<geom type="box" size=".3 .2 .1" euler="10 20 30"/>',
    )
    for geom in links:
        arena = mja.Arena.from_xml(
            f'<mujoco><worldbody><body name="board"><geom name="board" size=".1"/></body><body name="link" pos="0 0 1"><joint/>'
            f"{geom}</body>"
            "</worldbody></mujoco>"
        )
        arena.vary(there=dr.Term("body.active", "board"), inertia=dr.Term(attribute, "link"))
        assert arena.mj_model.nbody == 3


def test_where_nothing_is_left_that_moves():
    """The mean inertia is the compiler's, which is that of a model without degrees of freedom."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    params = arena.nominal_params()._replace(object_active=np.zeros(1, bool))
    assert max(mja.differences(arena.apply(arena.put_model("jax"), params), arena.compile(params)).values()) < 1e-6


LID = """<body name="{n}" pos="{x} 0 .5"><joint name="{n}" axis="0 1 0" damping=".1"/>
<geom type="box" size=".2 .02 .5" pos=".2 0 0" mass="2" contype="0" conaffinity="0"/></body>"""
LIDS = f"""<mujoco><worldbody><body name="wall" pos="0 1 0"><geom size=".1"/>{LID.format(n="a", x=-0.5)}{LID.format(n="b", x=0.5)}
</body></worldbody><sensor><subtreecom body="world"/></sensor></mujoco>"""


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_what_is_left_moves_as_precisely(impl):
    """An absent lid is 1000 m away, and beside it on the same wall another one turns: the centre of mass of both is not in between."""
    arena = mja.Arena.from_xml(LIDS)
    arena.vary(there=dr.Term("body.active", "a"), turns=dr.Term("joint.qvel", "b"))
    keys = mja.world_keys(0, range(4))
    ranges = mja.ArenaRanges(terms={"there": mja.Bernoulli(0.5), "turns": mja.Uniform(2.0, 3.0)})
    batch = arena.randomize(arena.put_model(impl), keys, ranges)
    ends = mja.rollout(batch, mja.make_data(batch, keys), 200)
    found = set()
    for w in range(4):
        params = batch.world(w)
        model, data = arena.c_world(params)
        mujoco.mj_step(model, data, 200)
        found.add(bool(params.terms["there"][0]))
        of = data.joint("b").qpos[0]
        np.testing.assert_allclose(ends.qpos[w, 1], of, rtol=2e-6)  # float32's 6e-8, 200 times at random
        np.testing.assert_allclose(ends.sensordata[w], data.sensordata, rtol=1e-5, atol=1e-6)
    assert found == {True, False}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`ranges.terms.size` lets 'lip' sink")
def test_one_batch_as_drawn_and_as_given(arena):
    """The same worlds have one structure, for which a rollout is compiled once."""
    ranges = mja.ArenaRanges(terms={"there": mja.Bernoulli(0.5), "size": mja.Uniform(0.8, 1.2, relative="scale")})
    model = arena.put_model("jax")
    drawn = arena.randomize(model, mja.world_keys(0, range(3)), ranges)
    given = arena.batch(model, drawn.params)
    assert jax.tree.structure(drawn) == jax.tree.structure(given)


REFERRED = """<mujoco><worldbody><body name="wall" pos="1 0 .5"><geom type="box" size=".1 .3 .3"/><site name="ws"/></body>
<body name="arm"><joint name="j" axis="0 1 0"/><geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/><site name="tip"/></body></worldbody>
{}</mujoco>"""


def test_actuators_that_refer_to_it():
    """The compiler leaves such an actuator out of the world without the body, MJX does not."""
    general = '<actuator><general name="m" site="tip" refsite="ws" gear="0 0 1 0 0 0"/></actuator>'
    arena = mja.Arena.from_xml(REFERRED.format(general))
    arena.vary(there=dr.Term("body.active", "wall"))
    says = r"^`arena.spec`: body 'wall' cannot come and go \(`body.active`\), as actuator 'm' ties it\.$"
    with pytest.raises(ValueError, match=says):
        _ = arena.mj_model


@pytest.mark.parametrize(
    "sensor",
    [
        '<framepos objtype="site" objname="ws"/>',
        '<framepos objtype="site" objname="tip" reftype="site" refname="ws"/>',
        '<distance body1="arm" body2="wall" cutoff="1"/>',
    ],
)
def test_sensors_of_it(sensor):
    arena = mja.Arena.from_xml(REFERRED.format(f"<sensor>{sensor}</sensor>"))
    arena.vary(there=dr.Term("body.active", "wall"))
    with pytest.warns(
        UserWarning, match=r"^`arena.spec`: sensor 0 .*belongs to body 'wall', which is absent in some worlds"
    ):
        _ = arena.mj_model

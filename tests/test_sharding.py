"""Worlds spread over devices and processes are the same worlds, and each device computes its own."""

import dataclasses
import functools
import json
import operator
import os
import pathlib
import re
import socket
import subprocess
import sys

import jax
import numpy as np
import pytest
import worlds
from jax.sharding import AxisType, NamedSharding
from jax.sharding import PartitionSpec as P

import mjx_arenas as mja
from mjx_arenas.sim import devices

pytestmark = pytest.mark.slow

ROOT = pathlib.Path(__file__).parent.parent
DOCS = (ROOT / "docs" / "scaling.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", DOCS, flags=re.DOTALL)
TIMEOUT = 240  # of a child process [s]
STEPS = 2
ROUNDING = (
    2.0**-20
)  # float32 rounds by 2^-24: up to 16 operations that round otherwise, also of positions of 1 m in two steps
RANGES = mja.ArenaRanges(
    table_rots=worlds.RANGES.table_rots,
    table_full_sizes=worlds.RANGES.table_full_sizes,
    object_full_sizes=worlds.RANGES.object_full_sizes,  # and the inertia that follows
    workspace=mja.Workspace(low=(-1.5, -1.5), high=(1.5, 1.5), gap=0.1),  # placement's loop
)


@functools.cache
def small():
    """A table with two spheres, which MJX on JAX compiles fastest."""
    return mja.TableArena(objects=[mja.Object(name, "sphere", 0.06) for name in "ab"])


@functools.cache
def model_of(impl):
    return small().put_model(impl)


def mesh_of(n, kind=AxisType.Explicit):
    return jax.make_mesh((n,), ("worlds",), axis_types=(kind,))


def keys_on(n, kind=AxisType.Explicit):
    """Keys of 8 worlds, on a mesh of n devices, or on none."""
    spread = NamedSharding(mesh_of(n, kind), P("worlds")) if n else None
    return jax.jit(lambda: jax.random.split(jax.random.key(1), 8), out_shardings=spread)()


@functools.cache
def made(impl, n, kind=AxisType.Explicit):
    """Batch and first data of 8 worlds."""
    keys = keys_on(n, kind)
    batch = small().randomize(model_of(impl), keys, RANGES)
    return batch, mja.make_data(batch, keys)


@functools.cache
def rolled(impl, n, kind=AxisType.Explicit):
    """Last data and records of 8 worlds, which start from the same bits on whatever devices: contacts make much of the last one."""
    (batch, _), (one, _) = made(impl, n, kind), made(impl, 0)
    leaves = {name: operator.attrgetter(name) for name in batch.fields}
    same = {
        name: jax.device_put(np.asarray(leaf(one.model)), leaf(batch.model).sharding) for name, leaf in leaves.items()
    }
    params = jax.tree.map(lambda a, b: jax.device_put(np.asarray(a), b.sharding), one.params, batch.params)
    batch = dataclasses.replace(batch, model=batch.model.tree_replace(same), params=params)
    return mja.rollout(batch, mja.make_data(batch, keys_on(n, kind)), STEPS, record=heights)


def heights(data):
    return data.qpos[:, 2], data.qpos[:, 2].mean()


def compare(got, want):
    """All leaves that are of worlds: numbers to the rounding of another program. Warp's others are of each device."""
    paths = jax.tree_util.tree_leaves_with_path(want)
    for (path, b), a in zip(paths, jax.tree.leaves(got), strict=True):
        name = jax.tree_util.keystr(path)
        if not name.startswith(("._impl.contact__", "._impl.nacon", "._impl.ncollision", "._impl.efc__id")):
            rounding = ROUNDING if np.issubdtype(b.dtype, np.floating) else 0
            np.testing.assert_allclose(a, b, rtol=rounding, atol=rounding, err_msg=name)


@pytest.mark.parametrize(
    ("impl", "n", "kind"),
    [
        ("jax", 4, AxisType.Explicit),
        pytest.param("warp", 1, AxisType.Explicit, marks=pytest.mark.xslow),
        ("warp", 2, AxisType.Auto),
        pytest.param("warp", 4, AxisType.Explicit, marks=pytest.mark.xslow),
    ],
)
def test_worlds_do_not_depend_on_devices(impl, n, kind):
    """Parameters, models and first data are the same, and each device has its part."""
    (batch, data), (one_batch, one_data) = made(impl, n, kind), made(impl, 0)
    for array in (batch.valid, batch.model.geom_size, batch.params.table_rots, data.qpos):
        assert_on(array, n)
    assert batch.valid.all()
    compare(batch.params, one_batch.params)
    compare(batch.model, one_batch.model)
    compare(data, one_data)


@pytest.mark.parametrize(
    ("impl", "n", "kind"),
    [
        ("jax", 4, AxisType.Explicit),
        ("warp", 2, AxisType.Auto),
        pytest.param("warp", 4, AxisType.Explicit, marks=pytest.mark.xslow),
    ],
)
def test_steps_do_not_depend_on_devices(impl, n, kind):
    """Steps are the same, to rounding; records are of all worlds."""
    (last, records), (one_last, one_records) = rolled(impl, n, kind), rolled(impl, 0)
    assert_on(last.qpos, n)
    assert np.abs(np.asarray(one_last.qpos - made(impl, 0)[1].qpos)).max() > 1e-5
    for got, want in zip((last.qpos, *records), (one_last.qpos, *one_records), strict=True):
        np.testing.assert_allclose(got, want, rtol=0, atol=ROUNDING)


def assert_on(array, n):
    shards = array.addressable_shards
    assert len({shard.device for shard in shards}) == n
    assert {shard.data.shape[0] for shard in shards} == {8 // n}


def test_no_empty_array_is_given():
    """XLA's compiler for several GPUs crashes on one that comes from outside (docs/upstream/empty_arrays.md)."""

    def function(x, empty):
        return x, empty + np.zeros((0, 3), np.float32), empty

    spread = devices.Spread(mesh_of(2, AxisType.Auto), "worlds")
    each = devices.on_each(function, spread, (spread.spec, P()))
    traced = jax.make_jaxpr(each)(np.ones((8, 3), np.float32), np.zeros((4, 0, 3), np.float32))
    (inside,) = (eqn.params["jaxpr"] for eqn in traced.jaxpr.eqns if eqn.primitive.name == "shard_map")
    used = {var for eqn in inside.eqns for var in eqn.invars if not hasattr(var, "val")} | {*inside.outvars}
    given = [var for var in inside.invars if not np.prod(var.aval.shape)]
    assert given
    assert not used & {*given}


def test_devices_do_not_talk():
    """The compiled functions hold no collective; XLA's partitioner alone would put some into placement's loop."""
    batch, data = made("warp", 4)
    keys = keys_on(4)
    randomize = jax.jit(lambda m, k: small().randomize(m, k, RANGES)).lower(
        devices.beside(keys, model_of("warp")), keys
    )
    make_data, step = jax.jit(mja.make_data).lower(batch, keys), jax.jit(mja.step).lower(batch, data)
    for lowered in (randomize, make_data, step):
        assert not collectives(lowered)
    automatic = NamedSharding(mesh_of(4, AxisType.Auto), P("worlds"))
    params = jax.tree.map(lambda x: jax.device_put(np.asarray(x), automatic), batch.params)
    place = jax.jit(jax.vmap(small().place))
    assert collectives(place.lower(params, keys_on(4, AxisType.Auto)))


def collectives(lowered):
    return re.findall(
        r"\b(?:all-reduce|all-gather|all-to-all|reduce-scatter|collective-[a-z]+)(?:-start)?\(",
        lowered.compile().as_text(),
    )


def test_inside_jit():
    """On a mesh with explicit axes, a `jax.jit` around the calls sees it."""
    model = devices.beside(keys_on(4), model_of("warp"))

    @jax.jit
    def qpos(keys):
        batch = small().randomize(model, keys, RANGES)
        data = mja.make_data(batch, keys)
        return data._impl.nacon, mja.step(batch, mja.step(batch, data)).qpos

    nacon, got = qpos(keys_on(4))
    assert nacon.shape == (4,)
    # Other fusions in randomize: an object that just touches its table in one program falls freely for two steps in the other.
    fall = (1 + 2) * 9.81 * small().mj_model.opt.timestep ** 2
    np.testing.assert_allclose(got, rolled("warp", 0)[0].qpos, rtol=0, atol=ROUNDING + fall)


@pytest.mark.xslow
def test_docs():
    """docs/scaling.md runs as it stands, on Warp, too; `place` and `place_static` in a `shard_map` are what they are alone."""
    names = {}
    exec(compile(BLOCKS[0], "docs/scaling.md", "exec"), names)
    own_keys = names["keys"]
    block = BLOCKS[1].replace("put_model()", 'put_model("warp")')
    if jax.__version_info__ < (0, 9):
        block = block.replace('("worlds",))', '("worlds",), axis_types=(jax.sharding.AxisType.Explicit,))')
    exec(compile(block, "docs/scaling.md", "exec"), names)
    for block in BLOCKS[3:]:
        exec(compile(block, "docs/scaling.md", "exec"), names)
    batch, data = names["batch"], names["data"]
    assert data.qpos.shape == (64, 14)
    assert len(data.qpos.sharding.device_set) == 4
    np.testing.assert_array_equal(jax.random.key_data(own_keys), jax.random.key_data(names["keys"]))
    assert names["placed"].shape == (64, 2)
    assert names["placed"].all()
    np.testing.assert_allclose(names["moved"].geom_xpos, data.geom_xpos, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(mja.step(batch, names["moved"]).qpos, mja.step(batch, data).qpos, rtol=0, atol=ROUNDING)


@pytest.mark.xslow
def test_on_the_host():
    """One world, or all, of a batch that is spread; keys and positions that come without a sharding."""
    (batch, data), (one, _) = made("warp", 4), made("warp", 0)
    for i in (0, 3, 7):
        compare(batch.world(i), one.world(i))
    assert small().compile(batch.world(5)).nq == data.qpos.shape[1]
    np.testing.assert_array_equal(mja.make_data(batch, keys_on(0)).qpos, data.qpos)
    again = data.replace(qpos=jax.numpy.asarray(np.asarray(data.qpos)))
    np.testing.assert_array_equal(mja.step(batch, again).qpos, mja.step(batch, data).qpos)
    given = small().batch(model_of("warp"), batch.params)
    assert given.valid.sharding.device_set == batch.valid.sharding.device_set
    np.testing.assert_allclose(given.model.geom_pos, batch.model.geom_pos, rtol=0, atol=2.0**-22)
    np.testing.assert_allclose(small().c_batch(batch.params, keys=keys_on(4)).qpos, data.qpos, rtol=0, atol=1e-6)


@pytest.mark.parametrize("impl", ["jax", "warp"])
def test_data_of_other_devices(impl):
    """Data and batch are on the same devices, and Warp's on as many parts; anything else is answered by one sentence."""
    batch, data = made(impl, 4)
    one_batch, one_data = made(impl, 0)
    for call in (mja.step, functools.partial(mja.rollout, n_steps=STEPS)):
        with pytest.raises(ValueError, match=r"^`data` must be on the batch's devices \[0, 1, 2, 3\], .* on \[0\]\.$"):
            call(batch, one_data)
        with pytest.raises(ValueError, match=r"^`data` must be on the batch's devices \[0\], .* on \[0, 1, 2, 3\]\.$"):
            call(one_batch, data)


def test_pictures_of_several_devices():
    """The renderer, which one process has for one device."""
    draw = small().renderer(["agentview"])
    with pytest.raises(
        ValueError, match=r"^`batch` must be on one device: draw in a process for each device \(docs/scaling\.md\)\.$"
    ):
        draw(*made("jax", 2))


def test_parts_on_warp():
    """Contacts that were made for the worlds of two devices are not stepped as those of one."""
    batch, data = made("warp", 2, AxisType.Auto)
    with pytest.raises(ValueError, match=r"^`data` must be made .* on 1 device\(s\), got data of worlds on 2: Warp"):
        jax.jit(mja.step)(batch, data)


CHILD = """
import sys
start, folder, out = sys.argv[1:]
sys.path.insert(0, folder)
import conftest
exec(start)
import numpy as np
import test_sharding
for impl in ("jax", "warp"):
    arrays = test_sharding.told(impl)
    parts = [(s.index[0].start, name, np.asarray(s.data)) for name, x in arrays.items() for s in x.addressable_shards]
    np.savez(f"{out}.{impl}", **{f"{name}.{begin}": part for begin, name, part in parts})
try:
    test_sharding.made("warp", 4)[0].world(0)
except IndexError as error:
    print(error)
"""


def told(impl):
    """What two processes are compared in; steps on Warp, which compile faster."""
    batch, data = made(impl, 4)
    arrays = {"params": batch.params.table_rots, "masses": batch.params.object_masses, "valid": batch.valid}
    arrays |= {"model": batch.model.body_inertia, "first": data.qpos}
    last = mja.rollout(batch, data, STEPS, record=heights)[0] if impl == "warp" else data
    return arrays | {"qpos": last.qpos, "qvel": last.qvel}


@pytest.mark.xslow
def test_two_processes(tmp_path):
    """Two processes on loopback, with two devices each, and one with all four: the same worlds, to the bit."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    flags = os.environ["XLA_FLAGS"].replace("device_count=4", "device_count=2")
    env = {**os.environ, "COORDINATOR": address, "PROCESSES": "2", "XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"}
    env["PYTHONPATH"] = f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    command = [sys.executable, "-c", CHILD, BLOCKS[2], str(ROOT / "tests")]
    children = [
        subprocess.Popen(
            [*command, str(tmp_path / str(rank))],
            env={**env, "PROCESS": str(rank)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for rank in range(2)
    ]
    try:
        said = [child.communicate(timeout=TIMEOUT)[0] for child in children]
    finally:
        for child in children:
            child.kill()
    assert [child.returncode for child in children] == [0, 0], said
    assert "`index` must be of a world of this process, which has 4 to 5, 6 to 7, got 0." in said[1]
    for impl in ("jax", "warp"):
        got = {}
        for rank in range(2):
            with np.load(tmp_path / f"{rank}.{impl}.npz") as parts:
                got |= {name: parts[name] for name in parts.files}
        for name, array in told(impl).items():
            parts = [got.pop(f"{name}.{begin}") for begin in (0, 2, 4, 6)]
            np.testing.assert_array_equal(np.concatenate(parts), array, err_msg=f"{impl} {name}")
        assert not got


@pytest.mark.xslow
def test_benchmark(tmp_path):
    """`benchmarks.devices` measures on the CPU, too, and prints and writes how much faster two devices are."""
    file = tmp_path / "rows.json"
    sizes = ["--worlds-per-device", "4", "--steps", "2", "--repeats", "1", "--timeout", str(TIMEOUT // 2)]
    command = [sys.executable, "-m", "benchmarks.devices", "--engine", "warp", "--ways", "mesh", "--json", file, *sizes]
    env = {**os.environ, "JAX_PLATFORMS": "cpu", "PYTHONPATH": f"{worlds.CHILDREN}{os.pathsep}{ROOT}"}
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"^devices\.warp\.2\.mesh\.speedup \d+\.\d+$", done.stdout, flags=re.MULTILINE)
    rows = json.loads(file.read_text())["rows"]
    assert [row["devices"] for row in rows] == [1, 2]
    assert all(row["steps_per_s"] > 0 and row["worlds_made_per_s"] > 0 for row in rows)


def test_take_of_a_batch_on_devices(impl):
    """Worlds are taken out of a batch that is spread over devices, in any order and more than once."""
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.05)])
    ranges = mja.ArenaRanges(table_full_sizes=mja.Uniform([0.4, 0.4, 0.02], [0.8, 0.8, 0.4]))
    spread = NamedSharding(jax.sharding.Mesh(np.array(jax.devices()[:2]), ("worlds",)), P("worlds"))
    batch = arena.randomize(arena.put_model(impl), jax.device_put(mja.world_keys(0, range(4)), spread), ranges)
    some = mja.take(batch, [3, 0, 0])
    off = mja.differences(some.model, {i: arena.compile(batch.world(w)) for i, w in enumerate((3, 0, 0))})
    assert max(off.values(), default=0.0) < 1e-6
    other = mja.differences(some.model, {i: arena.compile(batch.world(1)) for i in range(3)})
    assert max(other.values()) > 0.01

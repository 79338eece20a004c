"""How exact worlds are far from the origin: as single precision has places there."""

import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr

FAR, ARM = 100.0, 0.2
XML = f"""<mujoco><worldbody><body name="a" pos="{FAR} {FAR} 1"><joint axis="0 1 0"/><geom size=".1" pos="{ARM} 0 0"/>
<body name="b" pos=".3 0 0"><joint axis="0 1 0"/><geom size=".1" pos="{ARM} 0 0"/></body></body></worldbody></mujoco>"""


def test_inertias():
    """An inertia goes with the square of a lever, the difference of two places, each of which is rounded a few times."""
    arena = mja.Arena.from_xml(XML)
    arena.vary(place=dr.Term("body.pos"))
    ranges = mja.ArenaRanges(terms={"place": mja.Uniform(-0.05, 0.05, relative="add")})
    with pytest.warns(UserWarning, match=r"m away: lengths are in metres"):
        batch = arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(8)), ranges)
    found = mja.differences(batch.model, {i: arena.compile(batch.world(i)) for i in range(8)})
    rounding = float(np.spacing(np.float32(FAR)))
    off = {name: float(np.max(x)) for name, x in found.items() if np.max(x) > 1e-6}
    assert set(off) == {
        "body_invweight0",
        "dof_invweight0",
        "dof_M0",
        "stat.meaninertia",
        "stat.meansize",
        "stat.extent",
    }
    assert 1e-5 < off["dof_M0"] < 2 * 2 * rounding / ARM
    assert 1e-5 < off["stat.meaninertia"] < 2 * 2 * rounding / ARM

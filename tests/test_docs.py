"""The code of README and docs runs as it stands, page by page, all blocks of a page in one namespace."""

import importlib
import pathlib
import pkgutil
import re
import types

import mujoco
import numpy as np
import pages
import pytest

import mjx_arenas as mja
from mjx_arenas.geometry import rotate_yaw
from mjx_arenas.params import params

ELSEWHERE = {
    "docs/arms.md": "test_arms.py",
    "docs/examples.md": "test_examples.py",
    "docs/furniture.md": "test_furniture.py",
    "docs/house.md": "test_terms.py",
    "docs/how_to/own_arm.md": "test_own_arm.py",
    "docs/how_to/own_arm_task.md": "test_own_arm_task.py",
    "docs/how_to/own_task.md": "documented.py",
    "docs/pixels.md": "test_pixels.py",
    "docs/policies.md": "documented.py",
    "docs/robots.md": "test_simplify_robots.py",
    "docs/scaling.md": "test_sharding.py",
    "docs/scene.md": "test_scene_documented.py",
    "docs/terms.md": "test_terms_documented.py",
    "docs/training.md": "documented.py",
    "docs/variants.md": "test_variants.py",
}
"""Pages whose code other tests run, each beside more that they hold."""


def check_readme(names):
    assert names["data"].qpos.shape == (64, 14)
    assert names["batch"].valid.all()


def check_quickstart(names):
    assert names["batch"].valid.all()
    assert names["report"].ok
    assert names["compiled"].nbody == 1 + 2 + int(names["batch"].world(3).object_active.sum())
    assert mja.load("first.yaml")[1] == names["ranges"]


def check_arena(names):
    assert names["arena"].mounts == ["arm_mount"]


def check_ranges(names):
    active = np.asarray(names["params"].object_active).sum(1)
    assert ((active >= 1) & (active <= 2)).all()


def check_worlds(names):
    assert (names["reward"] == names["batch"].params.object_active.sum(1)).all()
    tables = names["arena"].layout
    moved = np.asarray(names["data"].geom_xpos)[:, tables.table_geom[:, 0], 2]
    np.testing.assert_allclose(moved, names["batch"].model.body_pos[:, tables.table_body, 2], rtol=0, atol=1e-6)


def check_exactness(names):
    assert names["off"]
    assert max(names["off"].values()) < 1e-5


def check_placement(names):
    assert names["placed"].valid.all()
    assert names["stacked"].valid.shape == (8, 4)
    assert names["data"].qpos.shape == (4, 14)
    assert names["params"].terms["can.pose"].shape == (8, 1)


def check_c_twin(names):
    assert mujoco.MjModel.from_xml_path("world_3/world.xml").nq == names["mj_model"].nq


def check_files(names):
    assert names["same"] == names["ranges"]


def check_own_mjcf(names):
    assert names["arena"].elements("boards") == ("left_board", "right_board", "shelf_board")


def check_own_robot(names):
    tip, tops = np.asarray(names["tip"]), np.asarray(names["batch"].params.table_offsets)[:, 0]
    assert ((tip[:, 2] > tops[:, 2] + 0.3) & (tip[:, 2] < tops[:, 2] + 0.42)).all()
    assert (np.asarray(names["data"].qpos)[:, names["shoulder"]] > 0.3).all()


def check_playground(names):
    assert names["report"].ok
    assert np.isfinite(names["state"].obs).all()


def check_mjlab(names):
    friction = np.asarray(names["batch"].params.terms["fingertip_friction"])
    assert (friction[:, 0] == friction[:, 1]).all()


def check_randomization_fn(names):
    found = str(names["report"])
    assert not names["report"].ok
    assert "body_inertia" in found or "dof_invweight0" in found


def check_robosuite(names):
    camera = names["model"].camera("agentview")
    np.testing.assert_allclose(camera.pos, [0.8, 0, 1.6])
    assert names["model"].opt.impratio == 20
    assert names["places"].valid.all()
    assert names["placed"].valid.all()
    drawn, cube = names["batch"].params, np.asarray(names["data"].qpos)[:, names["tabletop"].layout.object_qpos[0]]
    top, rot = np.asarray(drawn.table_offsets)[:, 0], np.asarray(drawn.table_rots)[:, 0]
    x, y = rotate_yaw(-rot, cube[:, :2] - top[:, :2]).T
    assert ((x > -0.1 + 0.03) & (x < 0.2 - 0.03) & (y > -0.3 + 0.03) & (y < 0.3 - 0.03)).all()
    assert (np.abs(2 * np.arctan2(cube[:, 6], cube[:, 3]) - rot) < 0.3 + 1e-5).all()
    assert names["worlds"].valid.all()


def check_troubleshooting(names):
    assert names["report"].ok


RUN = {
    "README.md": check_readme,
    "docs/arena.md": check_arena,
    "docs/c_twin.md": check_c_twin,
    "docs/exactness.md": check_exactness,
    "docs/files.md": check_files,
    "docs/how_to/mjlab.md": check_mjlab,
    "docs/how_to/own_mjcf.md": check_own_mjcf,
    "docs/how_to/own_robot.md": check_own_robot,
    "docs/how_to/playground.md": check_playground,
    "docs/how_to/randomization_fn.md": check_randomization_fn,
    "docs/how_to/robosuite.md": check_robosuite,
    "docs/placement.md": check_placement,
    "docs/quickstart.md": check_quickstart,
    "docs/ranges.md": check_ranges,
    "docs/troubleshooting.md": check_troubleshooting,
    "docs/worlds.md": check_worlds,
}
"""What holds after the code of a page has run."""
QUICK = ("docs/arena.md", "docs/exactness.md", "docs/files.md", "docs/ranges.md")
LONG = ("docs/how_to/own_robot.md", "docs/placement.md", "docs/worlds.md")
ROWS = [pytest.param(p, marks={p in QUICK: (), p in LONG: pytest.mark.xslow}.get(True, pytest.mark.slow)) for p in RUN]
NO_METHODS = {"spec", "py", "yaml", "set_camera", "get_xml", "configure_location", "set_origin", "set_scale"}
"""What stands behind "arena." on pages: an attribute, files, and methods of robosuite's arenas."""


@pytest.mark.parametrize("page", ROWS)
@pytest.mark.filterwarnings("ignore:The arena. geoms are inside each other")  # kitchen.xml's, which its page says
def test_code(page, tmp_path, monkeypatch):
    """Blocks with a title that begins with "before" are of other libraries, and are only parsed, where these are not ours."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").symlink_to(pages.ROOT / "docs")
    names = {"__name__": "documented"}
    for code, title in pages.blocks(page):
        parsed = compile(code, page, "exec")
        if not title.startswith("before: "):
            exec(parsed, names)
    RUN[page](names)


def test_every_page():
    """Each page with code is run, here or by a test that reads it."""
    coded = {page for page in pages.PAGES if pages.blocks(page) and not page.startswith("docs/upstream/")}
    assert coded == RUN.keys() | ELSEWHERE.keys()
    for page, test in ELSEWHERE.items():
        assert pathlib.Path(page).name in (pages.ROOT / "tests" / test).read_text(), page


@pytest.mark.parametrize("page", pages.PAGES)
def test_names(page):
    """Every public name that a page speaks of is there."""
    for name in re.findall(r"mja\.(\w+)", pages.text(page)):
        assert hasattr(mja, name), name
    for name in re.findall(r"`arena\.(\w+)", pages.text(page)):
        assert hasattr(mja.MultiTableArena, name) or name in NO_METHODS, name


def reference():
    """The names in the reference."""
    return {name for page in pages.PAGES for name in re.findall(r"^::: (\S+)", pages.text(page), flags=re.MULTILINE)}


def test_reference():
    """The reference has all public names, and none that is not there."""
    found = reference()
    for name in found:
        assert pkgutil.resolve_name(name) is not None
    envs = pytest.importorskip("mjx_arenas.envs")
    modules = {"mjx_arenas": mja.__all__, "mjx_arenas.envs": envs.__all__, "mjx_arenas.images": mja.images.__all__}
    modules["mjx_arenas.dr"] = mja.dr.__all__
    for task in ("lift", "open_drawer", "pick_and_place", "push", "reach", "transfer"):
        name = f"mjx_arenas.envs.tasks.{task}"
        module = importlib.import_module(name)
        modules[name] = [n for n in ("default_config", "training_ranges", "wider_ranges") if hasattr(module, n)]
    for module in ("furniture", "robots"):
        public = [n for n, x in vars(getattr(mja, module)).items() if isinstance(x, type) or callable(x)]
        modules[f"mjx_arenas.{module}"] = public
    part = mja.furniture.part
    own = {n: x for n, x in vars(part).items() if getattr(x, "__module__", "") in (part.__name__, params.__name__)}
    modules[part.__name__] = [n for n, x in own.items() if x not in (part.Part, part.stacked) and n != "Quantity"]
    sections = {"dr", "furniture", "robots", "textures", "images", "layouts", "arms"}  # modules
    for module, public in modules.items():
        assert {f"{module}.{name}" for name in public if name not in sections and name[0] != "_"} <= found


def test_imports():
    """The reference has what pages import; docs/house.md alone shows what is inside."""
    shown = [pkgutil.resolve_name(name) for name in reference()]
    imports = re.compile(r"^from (mjx_arenas\S*) import (.+)$", re.MULTILINE)
    for page in pages.PAGES:
        for module, names in imports.findall(pages.text(page)) if page != "docs/house.md" else ():
            for name in names.split(", "):
                one = pkgutil.resolve_name(f"{module}.{name}")
                assert isinstance(one, types.ModuleType) or any(one is other for other in shown), f"{page}: {name}"

"""Materials that are added to an arena: what their textures look like, and that they come through everything an arena goes through."""

import copy
import itertools
import threading

import jax
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.build import materials

T = mja.textures
ALL = {
    "flat": T.Flat((0.2, 0.4, 0.6)),
    "checker": T.Checker(),
    "gradient": T.Gradient(),
    "stone": T.Noise(),
    "oak": T.Wood(),
    "small": T.Wood(seed=3, size=32),
}
RGB = mujoco.mjtTextureRole.mjTEXROLE_RGB


def pixels_of(model, name):
    """(height, width, 3) of a texture of a compiled model."""
    texture = model.texture(name).id
    shape = model.tex_height[texture], model.tex_width[texture], 3
    at = model.tex_adr[texture]
    return model.tex_data[at : at + np.prod(shape)].reshape(shape)


def test_textures_of_the_mjcf_stay():
    """The proof compiles worlds without them; the arena's model has every pixel."""
    spec = mujoco.MjSpec()
    kinds = {"sky": mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, "checker": mujoco.mjtBuiltin.mjBUILTIN_CHECKER}
    for name, builtin in kinds.items():
        spec.add_texture(name=name, builtin=builtin, rgb1=[1, 0, 0], rgb2=[0, 0, 1], width=8, height=8)
    spec.worldbody.add_geom(name="ball", size=[0.1, 0, 0])
    made = mja.Arena.from_xml(spec)
    made.vary(size=dr.Term("geom.size", "ball"))
    want = spec.compile()
    assert want.ntexdata > 3 * 8 * 8
    np.testing.assert_array_equal(made.mj_model.tex_data, want.tex_data)
    np.testing.assert_array_equal(made.compile(made.nominal_params()).tex_data, want.tex_data)


class Own(T.Texture):
    """A texture of a class of one's own, which gives what it is told."""

    given = None

    def _colors(self):
        return self.given


COLOURS = np.full((4, 4, 3), 0.5)
NO_COLOURS = {
    "none": (None, "NoneType"),
    "a text": ("red", "<U3 of shape ()"),
    "rows of other lengths": ([[[0, 0, 0]], [[0, 0]]], "list"),
    "no channels": (COLOURS[..., 0], "float64 of shape (4, 4)"),
    "alpha": (np.ones((4, 4, 4)), "float64 of shape (4, 4, 4)"),
    "another size": (np.ones((8, 8, 3)), "float64 of shape (8, 8, 3)"),
    "complex": (COLOURS * 1j, "complex128 of shape (4, 4, 3)"),
    "nan": (COLOURS * np.nan, "numbers from nan to nan"),
    "one nan": (np.where(np.arange(48).reshape(4, 4, 3) == 7, np.nan, 0.5), "numbers from nan to nan"),
    "bytes": (np.full((4, 4, 3), 200, np.uint8), "numbers from 200 to 200"),
    "below 0": (COLOURS - 1, "numbers from -0.5 to -0.5"),
}


@pytest.mark.parametrize("case", NO_COLOURS)
def test_own_textures_without_colours(case):
    """One sentence, and the arena is as before."""
    given, got = NO_COLOURS[case]
    made, texture = arena(), type("Mine", (Own,), {"given": given})(size=4)
    before = made.spec.to_xml()
    with pytest.raises(ValueError, match="must be") as raised:
        made.add_material("mine", texture)
    assert str(raised.value) == f"`Mine._colors()` must be (4, 4, 3) numbers from 0 to 1, got {got}."
    assert made.spec.to_xml() == before


@pytest.mark.parametrize(
    "given", [COLOURS, COLOURS.tolist(), jax.numpy.array(COLOURS), 2 * COLOURS + 1e-12, 0 * COLOURS - 1e-12]
)
def test_own_textures(given):
    """Arrays and lists of numbers are colours, and so are those that rounding has put beyond 0 or 1."""
    want = np.round(255 * np.clip(np.asarray(given, float), 0, 1))
    made = arena(mine=type("Mine", (Own,), {"given": given})(size=4))
    np.testing.assert_array_equal(pixels_of(made.mj_model, "mine"), want)


def test_own_textures_whose_pixels_are_none():
    texture = type("Mine", (Own,), {"pixels": lambda self: np.zeros((3, 3))})(size=4)
    with pytest.raises(ValueError, match="must be") as raised:
        arena().add_material("mine", texture)
    must = "(height, width, 3) uint8, with 1 to 4096 rows and columns"
    assert str(raised.value) == f"`texture.pixels()` must be {must}, got float64 of shape (3, 3)."


def arena(**textures):
    """One table with an object, and materials."""
    made = mja.MultiTableArena(table_offsets=[[0, 0, 0.8]], objects=[mja.Object("cube")])
    for name, texture in textures.items():
        made.add_material(name, texture)
    return made


# Pixels.


@pytest.mark.parametrize("size", [1, 7, 64, 256])
@pytest.mark.parametrize("kind", [T.Flat, T.Checker, T.Gradient, T.Noise, T.Wood])
def test_pixels(kind, size):
    """Of the size that was asked for, between the two colours, the same each time, and of other arguments others."""
    own = {"rgb": (0.9, 0.1, 0.5)} if kind is T.Flat else {"rgb1": (0.9, 0.1, 0.5), "rgb2": (0.2, 0.4, 0.5)}
    if size == 1 and kind in (T.Checker, T.Noise, T.Wood):
        own |= {{T.Checker: "n", T.Noise: "scale", T.Wood: "rings"}[kind]: 1}
    elif size == 7:
        own |= {T.Checker: {"n": 7}, T.Noise: {"scale": 7}, T.Wood: {"rings": 3.5}}.get(kind, {})
    made = kind(**own, size=size)
    found = made.pixels()
    assert (found.shape, found.dtype) == ((size, size, 3), np.uint8)
    ends = np.round(255 * np.array([list(v) for n, v in own.items() if n.startswith("rgb")]))
    assert (found >= ends.min(0)).all()
    assert (found <= ends.max(0)).all()
    if kind is T.Flat:
        assert (found == ends[0]).all()
    elif size >= 64:
        middle, reach = ends.mean(0), np.ptp(ends, axis=0)
        assert (abs(found.mean((0, 1)) - middle) < 0.25 * reach + 0.5).all()
        assert (found.std((0, 1)) >= 0.1 * reach).all()
    np.testing.assert_array_equal(kind(**own, size=size).pixels(), found)


def test_what_textures_share_is_none():
    with pytest.raises(TypeError, match="abstract class Texture"):
        T.Texture()


@pytest.mark.parametrize("kind", [T.Noise, T.Wood])
def test_seeds(kind):
    """Two boards of one tree are alike in colour, and nothing else."""
    one, other = (kind(seed=seed).pixels().astype(float) for seed in (0, 1))
    assert (abs(one.mean((0, 1)) - other.mean((0, 1))) < 8).all()
    assert abs(np.corrcoef(one.ravel() - one.mean(), other.ravel() - other.mean())[0, 1]) < 0.99
    share = [(x[..., 0] - x[..., 0].mean()).ravel() for x in (one, other)]
    assert abs(np.corrcoef(*share)[0, 1]) < 0.3


def test_checker():
    """Squares by their definition; an odd number of pixels to a square is spread over them."""
    found = T.Checker((0, 0, 0), (1, 1, 1), 4, size=64).pixels()[..., 0]
    for i, j in itertools.product(range(64), repeat=2):
        assert found[i, j] == 255 * ((i // 16 + j // 16) % 2)
    widths = np.diff(np.flatnonzero(np.diff(T.Checker((0, 0, 0), (1, 1, 1), 7, size=64).pixels()[0, :, 0].astype(int))))
    assert set(widths) <= {9, 10}


def test_gradient():
    """Even along the rows, in equal steps down them, from one colour to the other."""
    found = T.Gradient((0, 0.2, 1), (1, 0.4, 0), size=256).pixels()
    assert (found == found[:, :1]).all()
    np.testing.assert_array_equal(found[:, 0, 0], np.arange(256))
    np.testing.assert_array_equal(found[:, 0, 2], np.arange(256)[::-1])
    np.testing.assert_allclose(found[:, 0, 1], np.linspace(51, 102, 256), atol=0.501)


def steps(picture, axis):
    """The largest step between neighbours inside, and over the edge where the texture repeats."""
    values = np.moveaxis(picture.astype(float).sum(-1), axis, 0)
    return abs(np.diff(values, axis=0)).mean(1).max(), abs(values[0] - values[-1]).mean()


@pytest.mark.parametrize("seed", range(4))
def test_tiles(seed):
    """Over the edge it is not rougher than anywhere inside; across, a board ends."""
    for axis in (0, 1):
        inside, over = steps(T.Noise(seed=seed).pixels(), axis)
        assert over <= inside
    inside, over = steps(T.Wood(seed=seed).pixels(), axis=1)
    assert over <= inside
    inside, over = steps(T.Checker().pixels(), axis=0)
    assert over == inside
    assert steps(T.Wood(seed=seed).pixels(), axis=0)[1] > 2 * steps(T.Wood(seed=seed).pixels(), axis=1)[0]


@pytest.mark.parametrize("seed", range(4))
def test_wood_has_a_grain(seed):
    """It changes across the grain, several times as much as along it."""
    values = T.Wood(seed=seed).pixels().astype(float).sum(-1)
    across, along = (abs(np.diff(values, axis=axis)).mean() for axis in (0, 1))
    assert across > 2.5 * along


def test_arrays_are_colours():
    """Lists and arrays become tuples, so that equal textures are equal."""
    assert T.Flat(np.array([0.1, 0.2, 0.3])) == T.Flat([0.1, 0.2, 0.3]) == T.Flat((0.1, 0.2, 0.3))
    assert hash(T.Flat([0.1, 0.2, 0.3])) == hash(T.Flat((0.1, 0.2, 0.3)))


# What an arena makes of them.


def test_material():
    """As asked for, and else MuJoCo's, whatever `<default>` the MJCF has, but for its texture."""
    xml = """<mujoco><default><material emission=".5" specular=".1" reflectance=".3" texrepeat="7 7" texture="own"/></default>
      <asset><texture name="own" type="2d" builtin="flat" width="8" height="8"/></asset></mujoco>"""
    made = mja.TableArena(xml=xml)
    made.add_material("plain")
    made.add_material("oak", T.Wood(), (1, 0.5, 0.5, 0.75), (2, 3), True, 0.2, np.float32(0.25))
    made.add_material("own pixels", np.full((4, 6, 3), 77, np.uint8), texrepeat=np.array([4, 5]))
    plain = mujoco.MjModel.from_xml_string('<mujoco><asset><material name="plain"/></asset></mujoco>').material("plain")
    model = made.mj_model
    for field in ("rgba", "texrepeat", "texuniform", "emission", "specular", "shininess", "reflectance"):
        np.testing.assert_array_equal(getattr(model.material("plain"), field), getattr(plain, field), field)
    assert model.material("plain").texid[RGB] == model.texture("own").id
    oak = model.material("oak")
    np.testing.assert_array_equal(oak.rgba, np.float32([1, 0.5, 0.5, 0.75]))
    np.testing.assert_array_equal(oak.texrepeat, [2, 3])
    assert (oak.texuniform, oak.specular, oak.shininess) == (True, np.float32(0.2), 0.25)
    assert (oak.emission, oak.reflectance) == (0, 0)
    assert [model.texture(i).name for i in oak.texid if i >= 0] == ["oak"]
    assert oak.texid[RGB] == model.texture("oak").id
    assert model.texture("oak").type == mujoco.mjtTexture.mjTEXTURE_2D
    np.testing.assert_array_equal(pixels_of(model, "own pixels"), np.full((4, 6, 3), 77))
    np.testing.assert_array_equal(model.material("own pixels").texrepeat, [4, 5])


@pytest.fixture(scope="module")
def dressed():
    """An arena with all kinds of textures, one of them drawn for its table."""
    made = arena(**ALL)
    made.add_material("same", T.Wood())  # the pixels of another
    made.add_material("mine", np.random.default_rng(0).integers(0, 256, (20, 30, 3)).astype(np.uint8))
    made.vary(top=dr.Term("geom.material", "table0_visual"))
    return made


def wanted(dressed):
    mine = np.random.default_rng(0).integers(0, 256, (20, 30, 3)).astype(np.uint8)
    return {**{name: texture.pixels() for name, texture in ALL.items()}, "same": ALL["oak"].pixels(), "mine": mine}


def check(model, want, prefix=""):
    """Each material has its texture, with every pixel."""
    for name, pixels in want.items():
        np.testing.assert_array_equal(pixels_of(model, prefix + name), pixels)
        assert model.material(prefix + name).texid[RGB] == model.texture(prefix + name).id


def test_in_compiled_worlds(dressed):
    want, params = wanted(dressed), dressed.nominal_params()
    for model in (
        dressed.mj_model,
        dressed.compile(params),
        dressed.spec.copy().compile(),
        copy.deepcopy(dressed).compile(params),
        dressed.record.with_options(dressed.record.mj_model.opt).spec.copy().compile(),
        dressed.c_world(params)[0],
    ):
        check(model, want)


@pytest.mark.parametrize("base", [None, '<mujoco><compiler texturedir="pictures" assetdir="all"/></mujoco>'])
def test_exported(base, tmp_path, monkeypatch):
    """Into MJCF and a binary; the MJCF compiles again from any folder, and so does its text with the arena's assets."""
    made = mja.TableArena(xml=base)
    for name, texture in ALL.items():
        made.add_material(name, texture)
    params, want = made.nominal_params(), {name: texture.pixels() for name, texture in ALL.items()}
    made.export(params, tmp_path / "world")
    made.export(params, tmp_path / "binary", format="mjb")
    monkeypatch.chdir(tmp_path)
    check(mujoco.MjModel.from_xml_path("world/world.xml"), want)
    check(mujoco.MjModel.from_binary_path("binary/world.mjb"), want)
    for xml in (made.to_xml(params), made.xml):
        check(mujoco.MjModel.from_xml_string(xml, dict(made.spec.assets)), want)
    again = mja.Arena.from_xml("world/world.xml")
    check(again.mj_model, want)


def test_merged(tmp_path):
    """Two arenas that have other textures under one name, and one that is the same; and so on."""
    one, other = arena(oak=T.Wood(), wall=T.Noise()), arena(oak=T.Wood(seed=1), wall=T.Noise())
    merged = one.merge(other, "b_", (3, 0, 0)).merge(arena(oak=T.Wood(seed=2)), "c_", (6, 0, 0))
    for model in (merged.mj_model, merged.compile(merged.nominal_params())):
        check(model, {"oak": T.Wood().pixels(), "wall": T.Noise().pixels()})
        check(model, {"oak": T.Wood(seed=1).pixels(), "wall": T.Noise().pixels()}, "b_")
        check(model, {"oak": T.Wood(seed=2).pixels()}, "c_")
    merged.export(merged.nominal_params(), tmp_path / "world")
    check(mujoco.MjModel.from_xml_path(str(tmp_path / "world/world.xml")), {"oak": T.Wood(seed=1).pixels()}, "b_")
    mja.save(tmp_path / "arena.yaml", merged)
    assert mja.load(tmp_path / "arena.yaml")[0].record == merged.record


def test_attached():
    """The spec of an arena, as a robot of another, brings its textures along."""
    made = arena(oak=T.Wood())
    one = mja.TableArena()
    one.attach(made.spec, "other_", pos=(5, 0, 0))
    check(one.mj_model, {"oak": T.Wood().pixels()}, "other_")


def test_drawn(dressed):
    """A choice of materials gives each world what MuJoCo compiles for it, and what is drawn there."""
    ids = [dressed.mj_model.material(name).id for name in ALL]
    ranges = mja.ArenaRanges(terms={"top": mja.Choice(ids)})
    batch = dressed.randomize(dressed.put_model("jax"), jax.random.split(jax.random.key(0), 12), ranges)
    table = dressed.mj_model.geom("table0_visual").id
    drawn = np.asarray(batch.model.geom_matid)[:, table]
    assert len(set(drawn)) > 2
    for i in range(12):
        model = dressed.compile(batch.world(i))
        np.testing.assert_array_equal(model.geom_matid, np.asarray(batch.model.geom_matid)[i])
        assert model.geom_matid[table] in ids


def test_seen(dressed):
    """The table has the texture's colours in pictures."""
    eye = mujoco.MjvCamera()
    eye.lookat, eye.distance, eye.elevation = (0, 0, 0.8), 0.9, -90
    red = {}
    for name in ("flat", "oak"):
        params = dressed.nominal_params()._replace(
            terms={"top": np.array([dressed.mj_model.material(name).id], np.float32)}
        )
        seen = dressed.render(params, camera=eye).astype(float)[20:120, 100:380]  # beside the object
        red[name] = (seen[..., 0] - seen[..., 2]).mean()
        rough = sum(abs(np.diff(seen, axis=axis)).mean() for axis in (0, 1))
        assert (rough > 2) == (name == "oak"), rough  # light falls off evenly
    assert red["flat"] < -20
    assert red["oak"] > 20


# In files.


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_comes_back_from_a_file(suffix, tmp_path):
    """With what was given alone; numbers of any kind; the arenas are equal, with all pixels."""
    made = arena(**ALL)
    made.add_material("plain", rgba=np.float32([0.1, 0.2, 0.3, 1]), texuniform=True)
    made.add_material("tiles", T.Checker(np.float32([0.1, 0, 0]), [1, 1, 1], np.int64(4), size=16), texrepeat=(2, 2))
    made.vary(top=dr.Term("geom.material", "table0_visual"))
    mja.save(tmp_path / f"arena{suffix}", made, mja.ArenaRanges(terms={"top": mja.Choice([0, 1])}))
    again, _ = mja.load(tmp_path / f"arena{suffix}")
    assert again.record == made.record
    assert again.calls == made.calls
    check(again.mj_model, {name: texture.pixels() for name, texture in ALL.items()})
    text = (tmp_path / f"arena{suffix}").read_text()
    assert "0.1" in text
    assert "0.10000000149" not in text
    assert "specular" not in text


def test_as_one_writes_it(tmp_path):
    file = tmp_path / "arena.yaml"
    file.write_text("""
arena:
  type: TableArena
  then:
    - add_material: {name: oak, texture: {Wood: {seed: 1}}}
    - add_material: {name: blue, texture: {Flat: [0, 0, 1]}, texrepeat: [2, 2]}
    - add_material: {name: stone, texture: {Noise: {}}}
    - add_material: plain
    - vary: {top: {attribute: geom.material, elements: table_visual}}
""")
    made = mja.TableArena()
    made.add_material("oak", T.Wood(seed=1))
    made.add_material("blue", T.Flat((0, 0, 1)), texrepeat=(2, 2))
    made.add_material("stone", T.Noise())
    made.add_material("plain")
    made.vary(top=dr.Term("geom.material", "table_visual"))
    again, _ = mja.load(file)
    assert again.record == made.record
    mja.save(tmp_path / "again.yaml", again)
    assert mja.load(tmp_path / "again.yaml")[0].record == made.record


def test_other_pixels_are_another_arena():
    """Though its MJCF differs in the name of a file alone."""
    one, same, other = (arena(oak=T.Wood(seed=seed)) for seed in (0, 0, 1))
    assert one.record == same.record
    assert one.record != other.record


THEN = "arena:\n  type: TableArena\n  then:\n    - add_material: "
WRONG_FILES = {
    "name": (
        "{name: oak, texture: {Woood: {}}}",
        "`arena.then[0].add_material.texture.Woood` is not a texture: did you mean `Wood`?",
    ),
    "argument": (
        "{name: oak, texture: {Wood: {sead: 1}}}",
        "`arena.then[0].add_material.texture.Wood.sead` is not an argument of Wood: did you mean `seed`?",
    ),
    "no colour": ("{name: oak, texture: {Flat: {}}}", "`arena.then[0].add_material.texture.Flat` lacks `rgb`."),
    "a name alone": (
        "{name: oak, texture: Wood}",
        "`arena.then[0].add_material.texture` must be a texture such as {Flat: ...}, got 'Wood'.",
    ),
    "number": (
        "{name: oak, texture: {Wood: {seed: -1}}}",
        "`arena.then[0].add_material`: `texture.seed` must be a whole number from 0 to 2^32 - 1, got -1.",
    ),
    "attribute": (
        "{name: oak, specular: 2}",
        "`arena.then[0].add_material.specular` must be between 0 and 1, got 2.",
    ),
    "taken": (
        "{name: table_ceramic}",
        "`arena.then[0].add_material.name` must be a text that no material or texture of the arena has, got 'table_ceramic'.",
    ),
    "method": (
        "{nane: oak}",
        "`arena.then[0].add_material.nane` is not an argument of add_material: did you mean `name`?",
    ),
}


@pytest.mark.parametrize("case", WRONG_FILES)
def test_wrong_files(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given, says = WRONG_FILES[case]
    (tmp_path / "arena.yaml").write_text(THEN + given)
    with pytest.raises(ValueError) as raised:  # noqa: PT011 (the whole message is compared)
        mja.load("arena.yaml")
    assert says in str(raised.value)
    assert str(raised.value).startswith("arena.yaml:4: ") or "problems in" in str(raised.value)


def test_own_pixels_cannot_be_saved(tmp_path):
    made = arena(oak=T.Wood(), mine=np.zeros((2, 2, 3), np.uint8))
    with pytest.raises(ValueError, match="pixels") as raised:
        mja.save(tmp_path / "arena.yaml", made)
    assert str(raised.value) == (
        "`arena.then[1].add_material.texture` has pixels of its own, which cannot be written to a file: give one of "
        "mjx_arenas.textures."
    )
    assert not list(tmp_path.iterdir())


# Wrong uses.

NAMED = "`name` must be a text that no material or texture of the arena has, got "
KINDS = (
    "one of mjx_arenas.textures (Checker, Flat, Gradient, Noise, Wood), an array (height, width, 3) of uint8, or None"
)
PIXELS = "`texture` must be (height, width, 3) uint8, with 1 to 4096 rows and columns, got "
BAD = {
    "name": ({"name": "table_ceramic"}, NAMED + "'table_ceramic'."),
    "name of a texture": ({"name": "texplane"}, NAMED + "'texplane'."),
    "no name": ({"name": ""}, NAMED + "''."),
    "name of another kind": ({"name": 3}, NAMED + "3."),
    "path": ({"texture": "oak.png"}, f"`texture` must be {KINDS}, got 'oak.png'."),
    "class": ({"texture": T.Wood}, f"`texture` must be {KINDS}, got <class 'mjx_arenas.textures.Wood'>."),
    "floats": ({"texture": np.zeros((4, 4, 3))}, PIXELS + "float64 of shape (4, 4, 3)."),
    "grey": ({"texture": np.zeros((4, 4), np.uint8)}, PIXELS + "uint8 of shape (4, 4)."),
    "with alpha": ({"texture": np.zeros((4, 4, 4), np.uint8)}, PIXELS + "uint8 of shape (4, 4, 4)."),
    "empty": ({"texture": np.zeros((0, 4, 3), np.uint8)}, PIXELS + "uint8 of shape (0, 4, 3)."),
    "large": ({"texture": np.zeros((4097, 1, 3), np.uint8)}, PIXELS + "uint8 of shape (4097, 1, 3)."),
    "seed": (
        {"texture": T.Wood(seed=0.5)},
        "`texture.seed` must be a whole number from 0 to 2^32 - 1, got 0.5.",
    ),
    "rings": (
        {"texture": T.Wood(rings=0)},
        "`texture.rings` must be > 0 and at most 256, its `size`, got 0.",
    ),
    "n": ({"texture": T.Checker(n=300)}, "`texture.n` must be a whole number from 1 to 256, got 300."),
    "scale": ({"texture": T.Noise(scale=2.5)}, "`texture.scale` must be a whole number from 1 to 256, got 2.5."),
    "size": ({"texture": T.Noise(size=5000)}, "`texture.size` must be a whole number from 1 to 4096, got 5000."),
    "bytes": ({"texture": T.Flat((255, 0, 0))}, "`texture.rgb` must be between 0 and 1, got (255, 0, 0)."),
    "colour": ({"texture": T.Flat("red")}, "`texture.rgb` must be 3 finite numbers from 0 to 1, got 'red'."),
    "rgba": ({"rgba": (1, 1, 1)}, "`rgba` must be 4 finite numbers, got (1, 1, 1)."),
    "bright": ({"rgba": (2, 1, 1, 1)}, "`rgba` must be between 0 and 1, got (2, 1, 1, 1)."),
    "texrepeat": ({"texrepeat": (1, 0)}, "`texrepeat` must be > 0, got (1, 0)."),
    "one texrepeat": ({"texrepeat": 2}, "`texrepeat` must be 2 finite numbers, got 2."),
    "texuniform": ({"texuniform": 1}, "`texuniform` must be true or false, got 1."),
    "specular": ({"specular": np.nan}, "`specular` must be a finite number, got nan."),
    "shininess": ({"shininess": -0.1}, "`shininess` must be between 0 and 1, got -0.1."),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_uses(case):
    """One sentence each, and the arena is as before."""
    made = arena()
    before = made.spec.to_xml(), len(made.calls), dict(made.spec.assets)
    given, says = BAD[case]
    with pytest.raises(ValueError, match="must be") as raised:
        made.add_material(**{"name": "oak", **given})
    assert str(raised.value) == says
    assert (made.spec.to_xml(), len(made.calls), dict(made.spec.assets)) == before


def test_all_at_once():
    with pytest.raises(
        ValueError, match=r"^4 problems in `add_material`:\n- `name` .*\n- `texture.size` .*\n- `rgba` .*\n- `texu"
    ):
        arena().add_material("", T.Gradient(size=0), rgba=1, texuniform=None)


def test_of_a_texture_alone():
    with pytest.raises(ValueError, match="must be") as raised:
        T.Gradient(rgb2=(0, 0, -1)).pixels()
    assert str(raised.value) == "`rgb2` must be between 0 and 1, got (0, 0, -1)."


def test_twice():
    made = arena(oak=T.Wood())
    with pytest.raises(ValueError, match="must be") as raised:
        made.add_material("oak")
    assert str(raised.value) == NAMED + "'oak'."


def test_too_late():
    made = arena()
    _ = made.mj_model
    with pytest.raises(ValueError, match=r"^`add_material`: the arena is compiled already: add materials before "):
        made.add_material("oak", T.Wood())


def test_without_pillow(monkeypatch):
    """What to install, before anything is added; a material of one colour needs nothing."""
    monkeypatch.setitem(__import__("sys").modules, "PIL.Image", None)
    made = mja.TableArena()
    with pytest.raises(ImportError) as raised:
        made.add_material("oak", T.Wood())
    assert str(raised.value) == "This needs PIL: pip install 'mjx_arenas[viz]'."
    made.add_material("oak")


def test_one_at_a_time(monkeypatch):
    """Threads that add to one arena wait for each other: none finds the spec in the midst of another's edit."""
    inside, most = [], []
    add = materials.add

    def slow(*arguments):
        inside.append(1)
        most.append(len(inside))
        add(*arguments)
        inside.pop()

    monkeypatch.setattr(materials, "add", slow)
    made = mja.TableArena()
    threads = [threading.Thread(target=made.add_material, args=(f"m{i}", T.Noise(seed=i, size=64))) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert max(most) == 1
    assert {f"m{i}" for i in range(8)} <= {m.name for m in made.spec.materials}
    assert len(made.calls) == 9


@pytest.mark.slow
def test_of_furniture():
    """In each world another material of a whole part, as compiled; also of one that has none by itself."""
    made = arena(oak=ALL["oak"], stone=ALL["stone"])
    made.add_part(mja.furniture.Shelf("rack", pos=(2, 0, 0), material="oak", rgba=(1, 1, 1, 1)))
    made.add_part(mja.furniture.Drawers("unit", pos=(-2, 0, 0)))
    made.vary(wood=dr.Term("geom.material", "rack_.*"), front=dr.Term("geom.material", "unit_drawer._front"))
    ids = [made.mj_model.material(name).id for name in ("oak", "stone")]
    ranges = mja.ArenaRanges(terms={"wood": mja.Choice(ids, tied=True), "front": mja.Choice([-1, *ids])})
    template, seen = made.put_model("jax"), set()
    write = jax.jit(lambda p: made.apply(template, p))
    for key in mja.world_keys(0, range(8)):
        params = jax.tree.map(np.asarray, made.sample_params(key, ranges))
        compiled, model = made.compile(params), write(params)
        assert oracle.from_compiled(model, compiled) <= oracle.STRUCTURE_MAY_DIFFER.keys()
        (whole,) = {compiled.geom(f"rack_{name}").matid[0] for name in ("left", "back", "board0", "board3")}
        seen |= {(whole, compiled.geom(f"unit_drawer{i}_front").matid[0]) for i in range(3)}
    assert {of_rack for of_rack, _ in seen} == set(ids)
    assert {of_front for _, of_front in seen} == {-1, *ids}

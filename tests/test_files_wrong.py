"""Files that are wrong: each mistake is one sentence, with its line and the path of what is wrong."""

import pytest
from command import write

import mjx_arenas as mja
from mjx_arenas.files import paths

EXAMPLES = sorted(file.stem for file in paths.EXAMPLES.glob("*.yaml"))
TABLES = "arena:\n  type: MultiTableArena\n  table_offsets: [[0, -1, 0.8], [0, 1, 0.8]]\n"
BALL = TABLES + "  objects: [cube, {name: ball, type: sphere}]\n"
KNOWN_ARENAS = "MultiTableArena, TableArena, Arena.from_xml"

# Text of arena.yaml, and the sentences, without the file's name before them.
WRONG = {
    "spec that is no path": (
        TABLES + "  spec: 5\n",
        [":4: `arena.spec` must be a path, MJCF text or a mujoco.MjSpec, got 5."],
    ),
    "in other words": (
        TABLES + "ranges:\n  table_rots: {Uniform: {min: 0, max: 1}}\n",
        [
            ":5: `ranges.table_rots.Uniform.min` is not an argument of Uniform: did you mean `low`?",
            ":5: `ranges.table_rots.Uniform.max` is not an argument of Uniform: did you mean `high`?",
            ":5: `ranges.table_rots.Uniform` lacks `low`.",
            ":5: `ranges.table_rots.Uniform` lacks `high`.",
        ],
    ),
    "beside a distribution": (
        TABLES + "ranges:\n  table_rots: {Uniform: [0, 1], relative: add}\n",
        [":5: `ranges.table_rots`: `relative` must stand in Uniform, as in {Uniform: {..., relative: ...}}."],
    ),
    "two distributions": (
        TABLES + "ranges:\n  table_rots: {Uniform: [0, 1], Fixed: 1}\n",
        [':5: `ranges.table_rots` must be a distribution such as {Uniform: ...}, got {"Uniform": [0, 1], "Fixed": 1}.'],
    ),
    "a table's name": (
        TABLES + "  objects: [{name: a, on: tabel1}]\n",
        [
            ":4: `arena.objects[0]`: Object 'a': `on` must be an index from 0 to 1 or one of 'table0', 'table1', got "
            "'tabel1': 'table1' may be meant."
        ],
    ),
    "empty": ("", [": it is empty, and it must have `arena` and `ranges`, by name."]),
    "options": (
        TABLES + "  options: {timestep: fast, gravity: [0, 0], cone: 1.5, tolerence: 1.0e-8}\n",
        [
            ":4: `arena.options.tolerence` is not an option of MuJoCo: did you mean `tolerance`?",
            ":4: `arena.options.timestep` must be a finite number, got 'fast'.",
            ":4: `arena.options.gravity` must be 3 finite numbers, got [0, 0].",
            ":4: `arena.options.cone` must be one of pyramidal (0), elliptic (1), got 1.5.",
        ],
    ),
    "an object without its argument": (
        TABLES + "  then: [{add_object: {name: a, mass: 1}}]\n",
        [':4: `arena.then[0].add_object` must be {obj: {name: ...}}, got {"name": "a", "mass": 1}.'],
    ),
    "a part without its kind": (
        TABLES + "  then: [{add_part: {name: a, widths: [1]}}]\n",
        [':4: `arena.then[0].add_part` must be {part: {Counter: ...}}, got {"name": "a", "widths": [1]}.'],
    ),
    "a number for a name": (
        TABLES + "  objects:\n    - {name: a}\n    - {name: 1}\n",
        [":6: `arena.objects[1]`: An object's `name` must be a non-empty string, got 1."],
    ),
    "names of options": (
        TABLES + "  options: {solver: Gauss, jacobian: 7, integrator: RK4, iterations: many}\n",
        [
            ":4: `arena.options.solver` must be one of pgs (0), cg (1), newton (2), got 'Gauss'.",
            ":4: `arena.options.jacobian` must be one of dense (0), sparse (1), auto (2), got 7.",
            ":4: `arena.options.iterations` must be an integer, got 'many'.",
        ],
    ),
    "options as a list": (
        TABLES + "  options: [timestep]\n",
        [':4: `arena.options` must be MuJoCo\'s options, by name, got ["timestep"].'],
    ),
    "ranges as a number": (TABLES + "ranges: 5\n", [":4: `ranges` must be quantities, by name, got 5."]),
    "terms as a list": (
        TABLES + "ranges: {terms: [speed]}\n",
        [':4: `ranges.terms` must be quantities, by name, got ["speed"].'],
    ),
    "comments alone": ("# to do\n", [": it is empty, and it must have `arena` and `ranges`, by name."]),
    "a list": ("- 1", [": it must have `arena` and `ranges`, by name."]),
    "no arena": ("ranges: {}", [": `arena` is missing."]),
    "part": (TABLES + "rangs: {}", [":4: `rangs` is not a part of a file: did you mean `ranges`?"]),
    "no type": ("arena: shelf", [f":1: `arena` has no `type`; known are {KNOWN_ARENAS}."]),
    "type": (
        "arena:\n  type: MultiTabelArena",
        [":2: `arena.type`: 'MultiTabelArena' is unknown: did you mean `MultiTableArena`?"],
    ),
    "type, in short": (
        "arena: {type: Arena}",
        [":1: `arena.type`: 'Arena' is unknown: did you mean `Arena.from_xml`?"],
    ),
    "type, far off": ("arena: {type: [1]}", [f":1: `arena.type`: [1] is unknown; known are {KNOWN_ARENAS}."]),
    "keys": (
        TABLES + "  table_rotz: 1\n  objects: [{name: a, fricton: 1}]\nranges:\n  table_ofsets: {Uniform: [0, 1]}\n",
        [
            ":4: `arena.table_rotz` is not an argument of MultiTableArena: did you mean `table_rots`?",
            ":5: `arena.objects[0].fricton` is not an argument of Object: did you mean `friction`?",
            ":7: `ranges.table_ofsets` is not an argument of ArenaRanges: did you mean `table_offsets`?",
        ],
    ),
    "key, far off": (
        "arena: {type: Arena.from_xml, xml: a.xml, tables: [a], hue: 1}",
        [
            ":1: `arena.hue` is not an argument of Arena.from_xml; known are xml, tables, objects, table_priority, follow, type, "
            "then, options, spec."
        ],
    ),
    "a part under no argument": (
        "arena:\n  type: TableArena\n  then:\n    - add_part: {Shelf: {name: rack}}",
        [':4: `arena.then[0].add_part` must be {part: {Shelf: ...}}, got {"Shelf": {"name": "rack"}}.'],
    ),
    "terms without names": (
        "arena:\n  type: TableArena\n  then:\n    - vary: [mass]",
        [
            ":4: `arena.then[0].vary` must be terms by name, such as {torque: {attribute: actuator.forcerange, elements: arm_turret}}, "
            "got ['mass']."
        ],
    ),
    "a term in its name": (
        "arena:\n  type: TableArena\n  then:\n    - vary: {mass: {Term: {attribute: body.mass}}}",
        [":4: `arena.then[0].vary.mass` must be the arguments of Term by name, without `Term:` before them."],
    ),
    "an object in its name": (
        "arena:\n  type: TableArena\n  objects: [{Object: {name: cube}}]",
        [":3: `arena.objects[0]` must be the arguments of Object by name, without `Object:` before them."],
    ),
    "argument missing": ("arena: {type: MultiTableArena}", [":1: `arena` lacks `table_offsets`."]),
    "null": (TABLES + "  table_rots: null", [":4: `arena.table_rots` is null: give it a value, or leave it out."]),
    "objects": (TABLES + "  objects: cube", [":4: `arena.objects` must be a list, got 'cube'."]),
    "an object": (
        TABLES + "  objects: [{type: sphere}, null]",
        [
            ":4: `arena.objects[0]` lacks `name`.",
            ":4: `arena.objects[1]` must be [name] or {name: ...}, got null.",
        ],
    ),
    "a word of YAML 1.1": (TABLES + "  has_legs: yes", [":4: `arena.has_legs` must be true or false, got 'yes'."]),
    "values": (
        TABLES + "  table_rots: [1, 2, 3]\n  objects:\n    - {name: cube, full_size: -1}\n    - {name: ball, on: 7}",
        [
            ":4: `arena.table_rots` must be one value, or one for each of the 2 tables, got shape (3,): [1, 2, 3].",
            ":6: `arena.objects[0]`: Object 'cube': `full_size` must be one number or 3 numbers, all > 0 [m], got -1.",
            ":7: `arena.objects[1]`: Object 'ball': `on` must be an index from 0 to 1 or one of 'table0', 'table1', "
            "got 7.",
        ],
    ),
    "arena and ranges": (
        TABLES + "  table_rots: a\nranges: {table_rots: {Uniform: {lo: 1, high: 2}}}",
        [
            ":4: `arena.table_rots` must be numbers in a regular array, got 'a'.",
            ":5: `ranges.table_rots.Uniform.lo` is not an argument of Uniform: did you mean `low`?",
            ":5: `ranges.table_rots.Uniform` lacks `low`.",
        ],
    ),
    "distributions": (
        BALL
        + "ranges:\n  table_rots: {Uniforn: [0, 1]}\n  has_legs: 0.5\n  table_offsets: {Uniform: 3}\n"
        + "  workspace: {Uniform: [0, 1]}\n  table_active: {Bernoulli: null}\n  table_frictions: [0, 1]",
        [
            ":6: `ranges.table_rots.Uniforn` is not a distribution: did you mean `Uniform`?",
            ":7: `ranges.has_legs` must be a distribution such as {Uniform: ...}, got 0.5.",
            ":8: `ranges.table_offsets.Uniform` must be [low, high] or {low: ..., high: ...}, got 3.",
            ":9: `ranges.workspace.Uniform` is not a workspace: write one as {Workspace: ...}.",
            ":10: `ranges.table_active.Bernoulli` must be [p] or {p: ...}, got null.",
            ":11: `ranges.table_frictions` must be a distribution such as {Uniform: ...}, got [0, 1].",
        ],
    ),
    "ranges": (
        BALL
        + "ranges:\n  table_rots: {Uniform: [1, 0]}\n  table_offsets: {Uniform: {low: a, high: 1, relative: add}}\n"
        + "  has_legs: {Uniform: [0, 1]}",
        [
            ":7: `ranges.table_offsets` (Uniform): `low` must be numbers, got 'a'.",
            ":6: `ranges.table_rots` (Uniform): `low` must be <= `high`, got 1 and 0.",
            ":8: `ranges.has_legs` (Uniform): true and false need Bernoulli, Count, Choice or Fixed.",
        ],
    ),
    "values of the wrong kind": (
        TABLES + "  table_rots: {a: 1}",
        [':4: `arena.table_rots` must be a value or a list of values, got {"a": 1}.'],
    ),
    "a workspace of words": (
        TABLES + "ranges: {workspace: {Workspace: [[a, 1], [[1], [2, 3]]]}}",
        [":4: `ranges.workspace`: `low` and `high` must be (x, y) with low < high, got ['a', 1] and [[1], [2, 3]]."],
    ),
    "structure of the wrong kind": (
        TABLES + "ranges:\n  table_offsets: {Uniform: {low: 0, high: 1, tied: [[true], [true, false]]}}",
        [
            (
                ":5: `ranges.table_offsets` (Uniform): `tied` must be true, false, a tuple with one of them for each axis, or "
                "'axes' if there are several axes, got ([true], [true, false])."
            ),
        ],
    ),
    "relative of the wrong kind": (
        TABLES + "ranges:\n  table_rots: {Uniform: {low: 0, high: 1, relative: []}}",
        [":5: `ranges.table_rots`: `relative` of Uniform must be 'add' or 'scale', or left out, got []."],
    ),
    "ranges of another arena": (
        TABLES + "ranges: {object_masses: {Fixed: 1}}",
        [":4: `ranges.object_masses`: the arena has no objects."],
    ),
    "calls": (
        TABLES
        + "  then:\n    - atach: a.xml\n    - attach\n    - attach: {robot: a.xml, onn: 0}\n    - merge: {other: shelf, prefix: b}",
        [
            ":5: `arena.then[0].atach` is not a method: did you mean `attach`?",
            ":6: `arena.then[1]` must be a method such as {attach: ...}, got 'attach'.",
            ":7: `arena.then[2].attach.onn` is not an argument of attach: did you mean `on`?",
            f":8: `arena.then[3].merge.other` has no `type`; known are {KNOWN_ARENAS}.",
        ],
    ),
    "calls, no list": (
        TABLES + "  then: {attach: a}",
        [
            ":4: `arena.then` must be a list of attach, add_camera, add_material, add_part, add_object, vary and merge, got "
            '{"attach": "a"}.'
        ],
    ),
    "call's value": (
        TABLES + "  then:\n    - merge: {other: {type: TableArena, table_offset: [1, 2]}, prefix: b_}\n",
        [":5: `arena.then[0].merge.other.table_offset` must be (x, y, z), got shape (2,): [1, 2]."],
    ),
    "twice": (TABLES + "  table_rots: 0\n  table_rots: 1", [":5: `arena.table_rots` is given twice."]),
    "twice, with all that it holds": (
        TABLES + "ranges:\n" + 2 * "  table_rots: {Uniform: {low: 0, high: 1}}\n",
        [":6: `ranges.table_rots` is given twice."],
    ),
    "nothing": (
        TABLES + "ranges:\n  has_legs:\n  table_rots: {Uniform: {low: 0, high: null, relative: null}}",
        [
            ":5: `ranges.has_legs` is null: give it a value, or leave it out.",
            ":6: `ranges.table_rots.Uniform.high` is null: give it a value.",
            ":6: `ranges.table_rots.Uniform.relative` is null: give it a value, or leave it out.",
        ],
    ),
    "an object's own line": (
        TABLES + "  objects:\n    - cube\n    - {name: slab, full_size: [3, 3, 0.1]}",
        [":6: `arena.objects[1]`: Object 'slab' is 3 x 3 m, larger than table 0, which is 0.8 x 0.8 m."],
    ),
    "names of objects": (
        TABLES + "  objects:\n    - cube\n    - ball\n    - {name: cube}",
        [":7: `arena.objects[2]`: Two objects are named 'cube': names must differ."],
    ),
    "a table that there is not": (
        TABLES + "  then:\n    - attach: {robot: <mujoco/>, on: 7}",
        [
            ":5: `arena.then[0].attach.on` must be the index of a table, or one of 'table0', 'table1', or left out, got 7."
        ],
    ),
    "not YAML": ("arena:\n  type: a: b", [":2:10: not YAML: mapping values are not allowed here."]),
    "not one YAML": (
        "arena:\n---\na: 1",
        [":2:1: not YAML: expected a single document in the stream, but found another document."],
    ),
    "control character": (
        "a: \x07",
        [
            ': not YAML: unacceptable character #x0007: special characters are not allowed in "<unicode string>", position 3.'
        ],
    ),
    "a tag": (
        "arena: !!python/object:os.system x",
        [":1:8: not YAML: could not determine a constructor for the tag 'tag:yaml.org,2002:python/object:os.system'."],
    ),
    "no date": (
        "arena:\n  type: TableArena\n  objects:\n    - name: 2024-13-45\n",
        [":4: '2024-13-45' is no timestamp: put it in quotes if it is text."],
    ),
    "no number": ("arena: !!int abc", [":1: 'abc' is no int: put it in quotes if it is text."]),
    "no truth": ("arena: !!bool maybe", [":1: 'maybe' is no bool: put it in quotes if it is text."]),
    "an alias in itself": ("arena: &a [*a]", [":1: an alias stands in what it names."]),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_file(case, tmp_path, monkeypatch):
    """All problems of a file, each with its line and the path of what is wrong."""
    monkeypatch.chdir(tmp_path)
    text, sentences = WRONG[case]
    write(tmp_path, text)
    sentences = [f"arena.yaml{s}" for s in sentences]
    with pytest.raises(ValueError) as error:  # noqa: PT011 (the whole message is compared)
        mja.load("arena.yaml")
    listed = f"{len(sentences)} problems in arena.yaml:\n" + "\n".join(f"- {s}" for s in sentences)
    assert str(error.value) == (sentences[0] if len(sentences) == 1 else listed)


def test_wrong_json(tmp_path, monkeypatch):
    """JSON has the same answers, without lines, and its syntax errors with theirs."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path, '{"arena": {"type": "TableArena",\n "colour": 1, "type": "TableArena"}}', "a.json")
    with pytest.raises(
        ValueError, match=r"(?s)2 problems.*`arena.type` is given twice.*a.json: `arena.colour` is not an"
    ):
        mja.load("a.json")
    write(tmp_path, '{"arena":\n }', "b.json")
    with pytest.raises(ValueError, match=r"^b.json:2:2: not JSON: Expecting value\.$"):
        mja.load("b.json")


def test_near_files(tmp_path):
    """A file that is not there is answered by the one of its kind beside it whose name is nearest, if any is near."""
    for name in ("Scene.xml", "scene.obj", "mug.obj"):
        (tmp_path / name).touch()
    for path, said in (("scene.xml", ", but 'Scene.xml'."), ("scen.xml", ", but 'Scene.xml'."), ("hall.xml", ".")):
        with pytest.raises(FileNotFoundError) as error:
            mja.TableArena(xml=tmp_path / path)
        assert str(error.value) == f"`xml`: there is no file '{tmp_path / path}'{said}"
    for path, said in ((tmp_path / "mugs.obj", ", but 'mug.obj'."), ("/nowhere/mug.obj", ".")):
        with pytest.raises(ValueError, match="there is no file") as error:
            mja.TableArena(objects=[mja.Object("a", "mesh", file=path)])
        assert str(error.value) == f"Object 'a': there is no file '{path}'{said}"


PATHS = {
    "no file": (FileNotFoundError, "no.yaml", "There is no file 'no.yaml'."),
    "in capitals": (FileNotFoundError, "ARENA.yaml", "There is no file 'ARENA.yaml'. Did you mean arena.yaml?"),
    "a file beside": (FileNotFoundError, "arenna.yaml", "There is no file 'arenna.yaml'. Did you mean arena.yaml?"),
    "no example": (
        FileNotFoundError,
        "shelv",
        f"There is no file 'shelv'; examples: {', '.join(EXAMPLES)}. Did you mean shelf?",
    ),
    "folder": (ValueError, "folder", "'folder' is a folder: give a .yaml, .yml or .json file."),
    "suffix": (ValueError, "a.txt", "'a.txt' must end in .yaml, .yml or .json."),
    "not text": (ValueError, "a.yaml", "a.yaml: not a text file in UTF-8."),
    "type": (TypeError, 3, "`path` must be the path of a file or the name of an example, got 3."),
}


@pytest.mark.parametrize("case", PATHS)
def test_wrong_path(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "a.txt").touch()
    (tmp_path / "arena.yaml").touch()
    (tmp_path / "a.yaml").write_bytes(b"\xff\xfe\x80")
    kind, path, message = PATHS[case]
    with pytest.raises(kind) as error:
        mja.load(path)
    assert str(error.value) == message


def test_unwritable(tmp_path):
    """A folder that is not there, a folder in the file's place, another suffix."""
    arena = mja.TableArena()
    for path, message in {
        tmp_path / "no" / "a.yaml": f"There is no folder '{tmp_path / 'no'}' to write 'a.yaml' in.",
        tmp_path / "folder.json": "Cannot write '{}': Is a directory.",
        tmp_path / "a.xml": "'{}' must end in .yaml, .yml or .json.",
    }.items():
        (tmp_path / "folder.json").mkdir(exist_ok=True)
        with pytest.raises((OSError, ValueError)) as error:
            mja.save(path, arena)
        assert str(error.value) == message.replace("{}", str(path))
    assert [f.name for f in tmp_path.iterdir()] == ["folder.json"]


def test_warnings_name_the_file(tmp_path):
    """What the constructors warn of is said of the file and its line."""
    file = write(tmp_path, "arena:\n  type: MultiTableArena\n  table_offsets: [[0, 0, 0.8], [0, 0.1, 0.8]]")
    with pytest.warns(
        UserWarning,
        match=r"arena.yaml:3: `arena.table_offsets`: Tables 'table0' and 'table1' overlap by 0.7 m horizontally",
    ):
        mja.load(file)

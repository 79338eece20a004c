"""Commands that show and keep worlds."""

import pathlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import click

from mjx_arenas import gpu
from mjx_arenas.cli import options, scenes
from mjx_arenas.cli.scenes import SKY, Scene
from mjx_arenas.cli.terminal import answered, busy, count, counted
from mjx_arenas.viz.limits import FILM, SHEET

if TYPE_CHECKING:
    from PIL import Image

SIZE, SECONDS = (480, 360), 2.0
TIMESTEP = 0.002  # of most arenas [s], before theirs is known
KINDS = ("rgb", "depth", "segmentation")


@click.command(cls=options.Command)
@click.argument("file", type=options.File())
@options.of_worlds(12, 400)
@options.file_out((".png", ".mp4"), "A .png picture or an .mp4 video of a rollout; a file that is there is replaced.")
@click.option("--plan", is_flag=True, help="A plan from above, to scale, with names, sizes and yaws.")
@click.option(
    "--reach", type=options.Positive(100, "m"), help="With --plan: also draw a robot's reach [m].", metavar="R"
)
@click.option(
    "--camera",
    help="Name of a camera of the arena.  [default: a view of all tables; with --engine warp 'room', or the first]",
    metavar="NAME",
)
@click.option("--size", type=options.Size(), help="Size of each picture.  [default: 480x360]")
@click.option("--seconds", type=options.Positive(3600, "s"), help="Length of an .mp4 [s].  [default: 2]", metavar="T")
@options.engine(
    "steps a video",
    "With warp, MuJoCo Warp draws pictures, and with --camera videos; OpenGL draws all others. "
    "Not with --state, which C MuJoCo steps and OpenGL draws.",
)
@click.option(
    "--show",
    type=click.Choice(KINDS),
    help="What a .png of --engine warp shows: colours, distances, or which thing each pixel sees.  [default: rgb]",
)
@options.keyframe
@options.state
def render(
    file: pathlib.Path,
    numbers: Sequence[int],
    seed: int,
    out: pathlib.Path,
    plan: bool,
    reach: float | None,
    camera: str | None,
    size: tuple[int, int] | None,
    seconds: float | None,
    engine: str | None,
    show: str | None,
    keyframe: str | None,
    state: pathlib.Path | None,
) -> None:
    """Draw worlds: one, many in a grid, from above, or in motion.

    \b
    Examples:
      mjx-arenas render shelf -n 12 --seed 3 -o grid.png
      mjx-arenas render shelf --worlds 0,5,17 --size 800x600 -o three.png
      mjx-arenas render pick_and_place --worlds 5 --plan --reach 0.855 -o plan.png
      mjx-arenas render clutter --worlds 0-3 --seconds 3 -o clutter.mp4
      mjx-arenas render shelf --worlds 5 --state state.npz -o later.png
      mjx-arenas render shelf --camera frontview --engine warp --size 64x64 -o seen.png
    """
    film = out.suffix == ".mp4"
    by_warp = engine == "warp" and (camera is not None or not film)  # what draws
    if plan and (film or any(given is not None for given in (camera, size, engine))):
        raise click.UsageError("--plan is a picture from above: give a .png, and no --camera, --size or --engine.")
    if reach is not None and not plan:
        raise click.UsageError("--reach goes with --plan.")
    if seconds is not None and not film:
        raise click.UsageError("--seconds needs a video: let -o end in .mp4.")
    if engine is not None and not film and not by_warp:
        raise click.UsageError(f"--engine {engine} only steps videos: let -o end in .mp4, or take --engine warp.")
    if show is not None and (film or not by_warp):
        raise click.UsageError("--show goes with --engine warp, and a .png.")
    if state is not None and engine not in (None, "c"):
        raise click.UsageError("--state is drawn and stepped by C MuJoCo: leave --engine out.")
    engine = "c" if state is not None else engine
    width, height = size or SIZE
    if not plan:
        options.check_pixels((width, height), len(numbers), FILM if film else SHEET)
    if by_warp and camera is None:
        camera = _default_camera(file)
    seconds, motion = seconds or SECONDS, ""
    n_steps = scenes.steps_on_mjx(engine, round(seconds / TIMESTEP) * len(numbers)) if film else 0
    if film or by_warp:
        gpu.leave_room(engine)
    scene = scenes.make(file, seed, numbers, keyframe, camera, n_steps, state)
    with answered(RuntimeError, ImportError, OSError):
        if by_warp:
            motion = _by_warp(scene, out, seconds, keyframe, str(camera), (width, height), show or "rgb")
        elif film:
            motion = _film(scene, out, seconds, engine, keyframe, camera, width, height)
        else:
            _save(_plans(scene, reach) if plan else _sheet(scene, camera, width, height), out)
    click.echo(f"{out}: {count(len(scene.numbers), 'world')} of {file.name}, seed {seed}{motion}")


def _default_camera(file: pathlib.Path) -> str:
    """The camera that draws a file's worlds where none is named: "room", or the first that has a name."""
    model = scenes.load(file)[0].mj_model
    names = [model.camera(i).name for i in range(model.ncam) if model.camera(i).name]
    if not names:
        raise click.UsageError("--engine warp draws a .png from a camera of the arena: this one has none with a name.")
    return "room" if "room" in names else names[0]


def _sheet(scene: Scene, camera: str | None, width: int, height: int) -> "Image.Image":
    with busy(f"drawing {count(len(scene.numbers), 'world')}") as tell:
        from mjx_arenas.viz import render

        worlds = counted(list(zip(scene.worlds, scene.data, strict=True)), tell)
        return render.grid(render.draw_worlds(scene.arena.record, worlds, camera, width, height), scene.labels)


def _plans(scene: Scene, reach: float | None) -> "Image.Image":
    with busy(f"drawing {count(len(scene.numbers), 'world')}") as tell:
        from mjx_arenas.viz import render

        worlds = counted(list(zip(scene.worlds, scene.data, scene.labels, strict=True)), tell)
        plans: list[Any] = []
        for params, data, label in worlds:
            plans.append(render.picture(scene.arena.plan(params, data, reach or (), label)))
            if len(plans) == 1:  # the others are about as large
                height, width = plans[0].shape[:2]
                options.check_pixels((width, height), len(scene.numbers), SHEET)
        return render.grid(plans, [""] * len(plans), min(2, len(plans)))


def _save(picture: "Image.Image", out: pathlib.Path) -> None:
    from mjx_arenas.files import output

    with busy("writing"), output.whole(out) as unfinished:
        picture.save(unfinished)


def _film(
    scene: Scene,
    out: pathlib.Path,
    seconds: float,
    engine: str | None,
    keyframe: str | None,
    camera: str | None,
    width: int,
    height: int,
) -> str:
    """Writes a video; gives how long it is, and what stepped it."""
    with busy(f"drawing {count(len(scene.numbers), 'world')}") as tell:
        from mjx_arenas import make_data
        from mjx_arenas.checks import engines
        from mjx_arenas.viz import film

        engine, why = engines.choose(engine)
        arena, shown = scene.arena, {"camera": camera, "width": width, "height": height, "labels": scene.labels}
        if engine == "c":
            film.c_video(arena, scene.twins, out, seconds, **shown, progress=tell)
        else:
            batch = arena.randomize(scenes.put_model(arena, scene.ranges, engine), scene.keys, scene.ranges)
            film.video(batch, make_data(batch, scene.keys, keyframe), out, seconds, **shown, progress=tell)
    return f", {seconds:g} s on {why}"


def _by_warp(
    scene: Scene, out: pathlib.Path, seconds: float, keyframe: str | None, camera: str, size: tuple[int, int], show: str
) -> str:
    """Writes a picture or a video that the device's renderer draws; gives what drew it, and stepped it."""
    with busy(f"drawing {count(len(scene.numbers), 'world')}") as tell, answered(ValueError):
        from mjx_arenas import make_data
        from mjx_arenas.viz import seen

        arena, (rgb, depth, things) = scene.arena, (show == kind for kind in KINDS)
        draw = arena.renderer({camera: size}, rgb=rgb, depth=depth, segmentation=things, shadows=True, background=SKY)
        batch = arena.randomize(scenes.put_model(arena, scene.ranges, "warp"), scene.keys, scene.ranges)
        data = make_data(batch, scene.keys, keyframe)
        if out.suffix == ".mp4":
            seen.rollout_video(batch, data, draw, out, seconds, scene.labels, tell)
            return f", {seconds:g} s, stepped and drawn by MJX on Warp"
        names = draw.labels if things else None
        sheet = seen.picture_sheet(draw(batch, data)[camera], show, names, scene.labels)
    _save(sheet, out)
    return f", drawn by MJX on Warp from camera {camera!r}"


@click.command(cls=options.Command)
@click.argument("file", type=options.File())
@options.of_one_world
@click.option("--tile", type=options.Whole(1, 400), metavar="N", help="Worlds 0 to N - 1 side by side, instead of one.")
@options.keyframe
@options.state
def view(
    file: pathlib.Path,
    world: int | None,
    seed: int,
    tile: int | None,
    keyframe: str | None,
    state: pathlib.Path | None,
) -> None:
    """Open MuJoCo's viewer on a world, or on many side by side.

    \b
    Examples:
      mjx-arenas view shelf --world 5
      mjx-arenas view clutter --tile 16
    """
    if world is not None and tile is not None:
        raise click.UsageError("Give --world or --tile, which are worlds 0 to N - 1, not both.")
    from mjx_arenas.viz import render

    try:
        render.check_screen()  # before anything is loaded
    except RuntimeError as error:
        raise click.ClickException(str(error).replace("arena.render", "mjx-arenas render")) from error
    scene = scenes.make(file, seed, [world or 0] if tile is None else range(tile), keyframe, state=state)
    with answered(ValueError, RuntimeError):
        if tile is None:
            scene.arena.view(scene.worlds[0], scene.data[0])
        else:
            scene.arena.view(scene.params, scene.data)


@click.command(cls=options.Command)
@click.argument("file", type=options.File())
@options.of_one_world
@options.folder_out("Folder for the files; it must be new or empty.", required=True, empty=True)
@click.option(
    "--format",
    "form",
    type=click.Choice(["xml", "mjb"]),
    default="xml",
    help="MJCF with its assets, or one binary file for this version of MuJoCo.  [default: xml]",
)
@options.keyframe
@options.state
def export(
    file: pathlib.Path,
    world: int | None,
    seed: int,
    out: pathlib.Path,
    form: Literal["xml", "mjb"],
    keyframe: str | None,
    state: pathlib.Path | None,
) -> None:
    """Write a world as files that any MuJoCo opens.

    The folder also holds the parameters of the world as JSON. In the keyframe "state" objects are in place.

    \b
    Examples:
      mjx-arenas export shelf --world 5 -o world_5
      python -m mujoco.viewer --mjcf=world_5/world.xml
    """
    number = world or 0
    scene = scenes.make(file, seed, [number], keyframe, state=state)
    with answered(ValueError, OSError, RuntimeError), busy("writing"):
        scene.arena.export(scene.worlds[0], out, scene.data[0], form, seed, number)
    click.echo(f"{out}: world {number} of {file.name}, seed {seed}")

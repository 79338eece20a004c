"""What an arena shows of its worlds, and keeps of them: methods that hand its record to functions (host)."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.extras import extra
from mjx_arenas.files import export
from mjx_arenas.keywords import with_known_methods
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.record.record import Record
from mjx_arenas.twin import twin
from mjx_arenas.viz import describe as describe_
from mjx_arenas.viz import render as render_
from mjx_arenas.viz import tile as tile_

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL import Image


@with_known_methods
class Shown:
    """The half of an arena that shows worlds."""

    def unchanged(self) -> Record:
        """The record, if the arena's `spec` is still what was compiled."""
        raise NotImplementedError

    # Seen and kept (host).

    def render(
        self,
        params: ArenaParams,
        data: mjx.Data | mujoco.MjData | None = None,
        camera: str | int | mujoco.MjvCamera | None = None,
        width: int = render_.WIDTH,
        height: int = render_.HEIGHT,
        keyframe: str | None = None,
    ) -> np.ndarray:
        """A picture of one world as it is, without what is absent.

        It needs OpenGL by EGL or OSMesa (on Debian and Ubuntu: apt install libegl1 libgl1-mesa-dri), but no screen. It takes the one
        that works here, or the one that `MUJOCO_GL` names.

        Args:
            params: parameters of one world (`batch.world(i)`).
            data: its state (`mja.take(data, i)`), on either implementation or in C. None: objects rest on their tables at
                their nominal places, not where a key would place them.
            camera: a camera's name or id, -1 for MuJoCo's free one, a `mujoco.MjvCamera`, or None for one that sees all tables
                and furniture, and what moves near them. Names are those of `arena.spec.cameras`: "frontview", "birdview",
                "agentview" and "sideview", unless the arena has an MJCF of its own, and those of robots with their prefix. The error
                for a wrong name lists them all.
            width: of the picture [pixels].
            height: of the picture [pixels].
            keyframe: without data, name of the keyframe that a robot is in; None: it is at `qpos0`.

        Returns:
            (height, width, 3) uint8, red, green and blue, the top row first: as `PIL.Image.fromarray` takes it.

        Raises:
            ValueError: there is no such camera or keyframe; or MuJoCo does not compile the world, or its parameters are wrong, with the
                reasons (`problems`), as in `plan`, `view`, `export`, `c_world`, `compile` and `to_xml`. Other invalid worlds are drawn as
                they are, such as those in which tables overlap or an object is larger than its table, and so are objects without a
                free place.
            RuntimeError: there is no OpenGL here.
        """
        return render_.draw_worlds(self.unchanged(), [(params, data)], camera, width, height, keyframe)[0]

    def contact_sheet(
        self,
        params: ArenaParams,
        data: mjx.Data | Sequence[mujoco.MjData] | None = None,
        labels: Sequence[str] | None = None,
        columns: int = 4,
        camera: str | int | mujoco.MjvCamera | None = None,
        width: int = render_.WIDTH,
        height: int = render_.HEIGHT,
        keyframe: str | None = None,
    ) -> "Image.Image":
        """Pictures of many worlds in a grid, a `PIL.Image`; quicker than `render` for each.

        Args:
            params: (W, ...) of all worlds.
            data: of all worlds, or (W,) of each in C; None as for `render`.
            labels: (W,) text on each picture. Default: "world 0", ... in the order of `params`, which do not know their numbers. Of
                worlds that `take` chose, say which they are: `labels=[f"world {i}" for i in chosen]`.
            columns: largest number of pictures side by side; fewer if these fill as few rows.
            camera: as for `render`.
            width: of each picture [pixels].
            height: of each picture [pixels].
            keyframe: as for `render`.
        """
        record = self.unchanged()
        worlds = twin.worlds(record, params, data)
        labels = [f"world {i}" for i in range(len(worlds))] if labels is None else labels
        render_.check_grid(len(worlds), labels, columns)
        return render_.grid(render_.draw_worlds(record, worlds, camera, width, height, keyframe), labels, columns)

    def plan(
        self,
        params: ArenaParams,
        data: mjx.Data | mujoco.MjData | None = None,
        reach: float | Sequence[tuple[Sequence[float], float]] = (),
        title: str = "",
        keyframe: str | None = None,
    ) -> "Figure":
        """One world seen from above, a `matplotlib` figure: tables, objects, furniture and all else to scale, with names and numbers.

        An arrow in a table shows its x axis. Drawers and doors are where `data` has them. What is absent is listed, not drawn. Planes,
        and floors that reach around everything, are not drawn either. An object that is more than 1 mm above its table or surface, as one
        without a free place is at the start, has a dashed outline, and its label says how far above it is. Distances are measured from
        the robots' mounts, if there are any, else from the middle of the circles of `reach`, else from the arena's origin.

        Args:
            params: of one world.
            data: its state, as for `render`.
            reach: circles to draw, ((x, y), radius) each, in the world [m]; or one radius around each of the mounts, or the
                origin.
            title: of the figure.
            keyframe: as for `render`.
        """
        extra("matplotlib")
        from mjx_arenas.viz import plan, plan_numbers

        record = self.unchanged()
        model, c = twin.c_world(record, params, data, keyframe=keyframe)
        centres, circles = plan.circles(reach, {name: c.body(name).xpos[:2] for name in record.parts.robots})
        own = [name for table in record.parts.tables for name in table.geoms]
        boxes = {geom: term.name for term in record.parts.furniture for geom in term.geoms}
        world = describe_.of(record, params)
        assert isinstance(world, describe_.World)
        lifted = plan_numbers.lifted(record, params, model, c)
        return plan.draw(world, model, c, own, boxes, centres, circles, lifted, title)

    def tile(
        self,
        params: ArenaParams,
        data: mjx.Data | Sequence[mujoco.MjData] | None = None,
        keyframe: str | None = None,
    ) -> tile_.Tiles:
        """Many worlds side by side in one model of C MuJoCo, as its viewer takes it; its names have prefixes "world0_", ...

        Level planes of the world (floors) are there only once, for all worlds. Keyframes are left out. Worlds do not touch
        each other as long as nothing leaves its own world by more than 0.5 m.

        Args:
            params: (W, ...) of all worlds.
            data: of all worlds, or (W,) of each in C, whose states are taken over; None as for `render`.
            keyframe: as for `render`.
        """
        return tile_.of(self.unchanged(), params, data, keyframe)

    def view(
        self,
        params: ArenaParams,
        data: mjx.Data | mujoco.MjData | Sequence[mujoco.MjData] | None = None,
        keyframe: str | None = None,
    ) -> None:
        """Opens MuJoCo's viewer on one world, or on many side by side, and returns when it is closed.

        Args:
            params: of one world, or (W, ...) as for `tile`.
            data: its or their state, as for `render`.
            keyframe: as for `render`.

        Raises:
            RuntimeError: there is no screen here.
        """
        record = self.unchanged()
        if not describe_.are_many(params):
            tile_.view(*twin.c_world(record, params, data, keyframe=keyframe))  # type: ignore[arg-type]
        else:
            tiles = tile_.of(record, params, data, keyframe)  # type: ignore[arg-type]
            tile_.view(tiles.model, tiles.data)

    def describe(self, params: ArenaParams | None = None) -> describe_.World | describe_.Worlds:
        """Describes one world, or statistics of many, in words and numbers. `print` the result, or read its fields.

        Args:
            params: parameters of one world, for its tables and objects; or (W, ...) of many. For many the result has the smallest, mean
                and largest value of each number over the worlds in which its table or object is present, and the share of these worlds.
                None: those of the nominal arena.
        """
        record = self.unchanged()
        return describe_.of(record, record.nominal if params is None else params)

    def export(
        self,
        params: ArenaParams,
        folder: str | os.PathLike,
        data: mjx.Data | mujoco.MjData | None = None,
        format: Literal["xml", "mjb"] = "xml",
        seed: int | None = None,
        world: int | None = None,
        keyframe: str | None = None,
    ) -> None:
        """Writes one world to a folder, so that a plain MuJoCo opens it anywhere. If writing fails, nothing is left behind.

        The folder gets `world.xml` with its meshes and textures under `assets`, or `world.mjb`, which contains everything but only
        works with this version of MuJoCo. It also gets `params.json` with the parameters, the names of tables and objects, and versions.
        The MJCF is in full precision, and compiles to the same model.

        Args:
            params: parameters of one world.
            folder: a folder that does not exist yet, or is empty.
            data: its state as for `render`, which becomes the keyframe "state". None: the keyframe "state" is written only if `keyframe`
                is given.
            format: "xml" or "mjb".
            seed: the seed of the world, to be noted in `params.json`.
            world: the number of the world in that seed, to be noted.
            keyframe: name of the keyframe that a robot is in, if there is no `data`.
        """
        export.export(self.unchanged(), params, folder, data, format, seed, world, keyframe)

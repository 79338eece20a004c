"""The main job, shown: `python -m mjx_arenas.demo`."""

import json
import pathlib
import time
import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mjx_arenas import gpu
from mjx_arenas.files import output
from mjx_arenas.parser import Parser
from mjx_arenas.viz import render

if TYPE_CHECKING:
    import jax
    from mujoco import mjx

    import mjx_arenas as mja

DROP = 0.05  # [m] above the tables
CHUNK = 50  # steps between two looks at the worlds
MAX_STEPS = 1500
AT_REST = 0.02  # [m/s], [rad/s]: slower than this is at rest
TWINS = 8
RECOMPILED = 64
PICTURES = 12
ON_CPU = 256  # worlds that are stepped on a CPU


def arena() -> "mja.MultiTableArena":
    """The three tables of robosuite's `MultiTableArena` example, moved apart, with objects."""
    import mjx_arenas as mja

    return mja.MultiTableArena(
        table_offsets=[[-0.6, 0.0, 0.8], [0.55, 0.0, 0.9], [0.0, 1.0, 0.8]],
        table_rots=[0, 0.785, 0],
        table_full_sizes=[(0.8, 0.8, 0.05), (0.5, 0.5, 0.05), (0.6, 0.6, 0.05)],
        has_legs=[True, True, False],
        objects=[
            mja.Object("cube", "box", 0.08, on=0),
            mja.Object("brick", "box", (0.16, 0.08, 0.06), on=2),
            mja.Object("ball", "sphere", 0.1, on=1),
            mja.Object("rod", "capsule", (0.18, 0.06, 0.06), on=0),
        ],
    )


def ranges() -> "mja.ArenaRanges":
    """Everything varies; the tables stay apart."""
    import mjx_arenas as mja

    return mja.ArenaRanges(
        table_offsets=mja.Uniform([-0.05, -0.05, -0.3], [0.05, 0.05, 0.3], relative="add"),
        table_rots=mja.Uniform(-3.14, 3.14),
        table_full_sizes=mja.Uniform([0.4, 0.4, 0.02], [0.65, 0.65, 0.15]),
        table_frictions=mja.LogUniform([0.2, 0.005, 0.0001], [1.0, 0.005, 0.0001]),
        has_legs=mja.Bernoulli(0.7),
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Builds, randomizes, drops, compares, draws."""
    parser = Parser(prog="python -m mjx_arenas.demo", description=main.__doc__)
    parser.add_argument(
        "-n", "--worlds", type=int, default=1024, help=f"number of arenas (default 1024; on a CPU {ON_CPU} are stepped)"
    )
    engine = "implementation of MJX that steps (default: warp on an NVIDIA GPU, else jax)"
    parser.add_argument("--engine", "--impl", dest="impl", choices=("jax", "warp"), help=engine)
    parser.add_argument(
        "-o", "--out", type=pathlib.Path, default="out/demo", help="folder for the pictures and the MJCF"
    )
    options = parser.parse_args(arguments)
    if options.worlds < PICTURES:
        parser.error(f"-n must be at least {PICTURES}, got {options.worlds}")
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"--out: cannot make {str(options.out)!r}: {error.strerror}")
    gl = render.choose_gl()  # before MuJoCo is imported
    gpu.leave_room(options.impl)
    from mjx_arenas.sim.warp_notes import no_room_answered

    with no_room_answered():
        Demo(options.worlds, options.impl, options.out, gl).run()


class Demo:
    """The stages of the demo; each reports a row of the closing table."""

    def __init__(self, n_worlds: int, impl: str | None, out: pathlib.Path, gl: str | None) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        self.n_worlds, self.impl, self.out, self.gl = n_worlds, impl, out, gl
        self.console = Console()
        if not self.console.is_terminal:
            self.console.width = 110
        columns = (TextColumn("{task.description:46}"), BarColumn(30), MofNCompleteColumn(), TimeElapsedColumn())
        self.progress = Progress(*columns, console=self.console, disable=not self.console.is_terminal)
        self.rows: list[tuple[str, str]] = []
        self.numbers: dict[str, Any] = {}

    def stage(self, what: str, steps: int, do: Callable[[Callable[[], None]], Any]) -> Any:
        """Runs a stage under a progress bar; `do` gets a function that counts one of its steps."""
        if not self.console.is_terminal:
            self.console.print(f"{what} ...")
        task = self.progress.add_task(what, total=steps)
        result = do(lambda: self.progress.advance(task))
        self.progress.update(task, completed=steps)
        return result

    def run(self) -> None:
        """All stages and the table."""
        import jax

        import mjx_arenas as mja

        self.console.print("[bold]mjx_arenas[/]: one compiled model, thousands of arenas")
        with self.progress:
            self.arena = arena()
            self.model = self.arena.put_model(self.impl)
            self.device = f"impl={self.model.impl.value!r} on {jax.devices()[0].device_kind}"
            keys = jax.random.split(jax.random.key(0), self.n_worlds)
            recompiling = self.stage("recompiling arenas, as one would without", RECOMPILED, self.recompile)
            batch = self.stage(
                f"randomizing {self.n_worlds:,} arenas at once", 6, lambda tick: self.randomize(keys, recompiling, tick)
            )
            if jax.default_backend() == "cpu" and self.n_worlds > ON_CPU:
                keys, batch = keys[:ON_CPU], mja.take(batch, range(ON_CPU))
            what = f"dropping the objects of {len(keys):,} worlds until they rest"
            start, data, steps = self.stage(what, MAX_STEPS // CHUNK, lambda tick: self.drop(batch, keys, tick))
            self.stage(
                "stepping recompiled twins in C MuJoCo", TWINS, lambda tick: self.twins(batch, start, data, steps, tick)
            )
            self.stage("drawing the worlds", 1, lambda _: self.draw(batch, data))
        self.report()

    def recompile(self, tick: Callable[[], None]) -> float:
        """Arenas per second of `MjSpec` and MuJoCo's compiler, without this library's checks."""
        import jax
        import numpy as np

        from mjx_arenas.build import assemble

        sample = jax.jit(self.arena.sample_params)
        params = [jax.tree.map(np.asarray, sample(jax.random.key(i), ranges())) for i in range(RECOMPILED)]
        self.arena.mj_model.nbody  # noqa: B018 (compiles the nominal arena)
        begin = time.perf_counter()
        for p in params:
            spec = self.arena.spec.copy()
            assemble.set_params(spec, self.arena.record.parts, p)
            spec.compile()
            tick()
        self.numbers["recompiled_arenas_per_second"] = rate = RECOMPILED / (time.perf_counter() - begin)
        return rate

    def randomize(self, keys: "jax.Array", recompiling: float, tick: Callable[[], None]) -> "mja.ArenaBatch":
        """The batch; the first call compiles, the best of the others counts."""
        import jax

        def once() -> tuple[float, "mja.ArenaBatch"]:
            begin = time.perf_counter()
            batch = jax.block_until_ready(self.arena.randomize(self.model, keys, ranges()))
            tick()
            return time.perf_counter() - begin, batch

        first, batch = once()
        rate = self.n_worlds / sorted(once()[0] for _ in range(5))[2]
        assert batch.valid.all()
        self.numbers |= {"arenas_per_second": rate, "bytes_per_world": batch.nbytes, "randomize_compile_seconds": first}
        self.rows += [
            (
                "arenas",
                f"{rate:,.0f} a second, {rate / recompiling:,.0f} times recompiling ({recompiling:,.0f} a second)",
            ),
            ("", f"{batch.nbytes:,} bytes each; compiled once, in {first:.1f} s"),
        ]
        return batch

    def drop(
        self, batch: "mja.ArenaBatch", keys: "jax.Array", tick: Callable[[], None]
    ) -> tuple["jax.Array", "mjx.Data", int]:
        """Lets all objects fall on their tables; gives the state before, the data after, and the number of steps."""
        import jax
        import jax.numpy as jnp
        import numpy as np

        import mjx_arenas as mja

        layout = self.arena.layout
        data = mja.make_data(batch, keys)
        data = data.replace(qpos=data.qpos.at[:, layout.object_qpos[:, 2]].add(DROP))
        start, seconds = data.qpos, []
        chunk = 0
        while chunk * CHUNK < MAX_STEPS and (not chunk or float(jnp.abs(data.qvel).max()) >= AT_REST):
            chunk += 1
            begin = time.perf_counter()
            data = jax.block_until_ready(mja.rollout(batch, data, CHUNK))
            seconds.append(time.perf_counter() - begin)
            tick()
        rate = len(keys) * CHUNK / np.median(seconds[1:])
        off = np.abs(
            np.asarray(data.qpos)[:, layout.object_qpos[:, 2]]
            - np.asarray(jax.vmap(self.arena.rest_heights)(batch.params))
        )
        still = np.abs(np.asarray(data.qvel).reshape(len(keys), -1, 6)).max(-1) < AT_REST
        right = int(((off < 1e-3) & still).sum())
        self.numbers |= {"world_steps_per_second": rate, "steps": chunk * CHUNK, "step_compile_seconds": seconds[0]}
        self.numbers |= {"objects": off.size, "objects_at_rest_within_1_mm": right}
        self.rows += [
            ("steps", f"{rate:,.0f} world-steps a second, {self.device}"),
            ("", f"{chunk * CHUNK} steps of {len(off):,} worlds; compiled in {seconds[0]:.1f} s"),
            ("at rest", f"{right:,} of {off.size:,} objects, within 1 mm of where their table's top is"),
        ]
        return start, data, chunk * CHUNK

    def twins(
        self, batch: "mja.ArenaBatch", start: "jax.Array", data: "mjx.Data", steps: int, tick: Callable[[], None]
    ) -> None:
        """Compares some worlds with the model that MuJoCo compiles for them, and with C MuJoCo's own steps on it."""
        import mujoco
        import numpy as np

        import mjx_arenas as mja

        model_off = height_off = 0.0
        for i in map(int, np.linspace(0, len(start) - 1, TWINS)):
            twin = self.arena.compile(batch.world(i))
            model_off = max(model_off, *mja.differences(batch.model, {i: twin}).values(), 0.0)
            c = mujoco.MjData(twin)
            c.qpos = start[i]
            mujoco.mj_step(twin, c, nstep=steps)
            z = self.arena.layout.object_qpos[:, 2]
            height_off = max(height_off, float(np.abs(c.qpos[z] - data.qpos[i, z]).max()))
            tick()
        self.numbers |= {"largest_model_difference": model_off, "largest_rest_height_difference_m": height_off}
        self.rows += [
            (
                "exact",
                f"{TWINS} worlds against recompiled twins: no number of the model is off by more than {model_off:.1e} of itself,",
            ),
            ("", f"and no object rests more than {1e3 * height_off:.1e} mm from where it does in C MuJoCo"),
        ]

    def draw(self, batch: "mja.ArenaBatch", data: "mjx.Data") -> None:
        """A sheet of pictures, and one world as MJCF."""
        import mjx_arenas as mja

        xml = self.out / "world_0.xml"
        with output.whole(xml) as unfinished:
            unfinished.write_text(self.arena.to_xml(batch.world(0)), encoding="utf-8")
        self.rows.append(("see one", f"python -m mujoco.viewer --mjcf={xml}"))
        if self.gl is None:
            self.rows.append(("pictures", f"none: {render.NO_GL}"))
            return
        sheet, first = self.out / "worlds.png", range(PICTURES)
        with output.whole(sheet) as unfinished:
            self.arena.contact_sheet(mja.take(batch.params, first), mja.take(data, first)).save(unfinished)
        self.rows.append(("pictures", f"{sheet}: {PICTURES} of the {self.n_worlds:,} worlds"))
        self.rows.append(("", "Some tables have no legs: `has_legs` varies."))

    def report(self) -> None:
        """What came out."""
        import jax
        import mujoco
        from rich.table import Table

        import mjx_arenas

        table = Table(show_header=False, box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for name, what in self.rows:
            table.add_row(f"[bold]{name}[/]", what)
        self.console.print()
        self.console.print(table)
        self.numbers |= {"worlds": self.n_worlds, "device": self.device, "date": time.strftime("%Y-%m-%d")}
        self.numbers |= {"mjx_arenas": mjx_arenas.__version__, "mujoco": mujoco.__version__, "jax": jax.__version__}
        with output.whole(self.out / "report.json") as unfinished:
            unfinished.write_text(json.dumps(self.numbers, indent=2) + "\n")


if __name__ == "__main__":
    warnings.simplefilter("default")
    main()

"""The command that compiles ahead."""

import os
import pathlib
import time
from collections.abc import Iterator

import click

from mjx_arenas import gpu
from mjx_arenas.cli import options, scenes
from mjx_arenas.cli.scenes import SKY
from mjx_arenas.cli.terminal import answered, busy, count


@click.command(cls=options.Command)
@click.argument("file", type=options.File())
@options.how_many(1024)
@options.mjx_engine
@click.option("--camera", help="Also compile what draws the pictures of this camera, by MuJoCo Warp.", metavar="NAME")
@click.option("--size", type=options.Size(), help="With --camera: size of each picture.  [default: 64x64]")
def warmup(
    file: pathlib.Path, n: int | None, impl: str | None, camera: str | None, size: tuple[int, int] | None
) -> None:
    """Compile what a first step needs, and keep it for later processes.

    Warp keeps its kernels by itself. Every program that steps this arena uses them, and so does training. XLA keeps its programs for
    the command line, and for programs of yours that set JAX_COMPILATION_CACHE_DIR to the folder named at the end. Both depend on the
    number of worlds.

    \b
    Examples:
      mjx-arenas warmup shelf -n 8192
      mjx-arenas warmup arena.yaml -n 4096 --engine warp
      mjx-arenas warmup arena.yaml -n 1024 --camera frontview --size 64x64
    """
    if size is not None and camera is None:
        raise click.UsageError("--size goes with --camera.")
    worlds = n or 1024
    gpu.leave_room(impl)
    arena, ranges = scenes.load(file, scenes.OPTIMIZED)
    scenes.check_camera(arena, camera)
    draw = None
    if camera is not None:
        with answered(ValueError, RuntimeError):  # before minutes of compiling
            draw = arena.renderer({camera: size or (64, 64)}, shadows=True, background=SKY)
    with busy("compiling"), answered(ImportError):
        import jax

        import mjx_arenas as mja

        began = time.perf_counter()

        def stages() -> Iterator[str]:
            model = scenes.put_model(arena, ranges, impl)
            keys = mja.world_keys(0, range(worlds))
            batch = arena.randomize(model, keys, ranges)
            yield "randomize"
            data = mja.make_data(batch, keys)
            yield "make_data"
            jax.block_until_ready(mja.step(batch, data))
            yield "step"
            jax.block_until_ready(mja.rollout(batch, data, 2).qpos)
            yield f"rollout on impl={batch.model.impl.value!r}"
            if draw is not None and camera is not None:
                jax.block_until_ready(draw(batch, data)[camera].rgb)
                yield f"pictures of camera {camera!r}"

        for name in stages():
            now = time.perf_counter()
            click.echo(f"{now - began:6.1f} s  {name}")
            began = now
    kept = os.environ.get("JAX_COMPILATION_CACHE_DIR")
    click.echo(
        f"{count(worlds, 'world')} of {scenes.name_of(file)}; XLA's programs {f'are in {kept}' if kept else 'were not kept'}."
    )

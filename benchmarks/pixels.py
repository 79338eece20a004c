"""Pictures of all worlds: what they cost by size, cameras, shadows, textures, meshes and worlds; beside mujoco_warp alone."""

import functools
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco import mjx

import mjx_arenas as mja
from benchmarks import measure
from benchmarks.rivals import WarpAlone
from mjx_arenas.pixels.renderer import Renderer
from mjx_arenas.sim.warp_notes import quiet

CAMERAS = ("agentview", "frontview", "sideview")
_IN_A_ROW = 5  # pictures of each world in one program


def speed(
    worlds: Sequence[int],
    resolutions: Sequence[int],
    n_cameras: Sequence[int],
    triangles: Sequence[int],
    together: Sequence[Mapping[str, Any]],
    n_steps: int,
) -> Iterator[dict[str, Any]]:
    """Pictures alone, one thing changed at a time from 64 by 64 pixels of one camera, without shadows and textures; then with steps.

    Args:
        worlds: numbers of them; the first is that of all other rows.
        resolutions: width and height [pixels].
        n_cameras: at once.
        triangles: subdivisions of the spheres in place of the objects, 20 * 4**n triangles each; 0: the boxes.
        together: settings of which a step and the pictures after it are measured as one program, against mujoco_warp alone.
        n_steps: of a rollout that draws after each step.
    """
    first = worlds[0]
    plain = {"with": "nothing", "worlds": first, "pixels": 64, "cameras": 1, "shadows": False, "textures": False}
    plain |= {"depth": False, "segmentation": False, "triangles": 0}
    rows = [{"worlds": n} for n in worlds]
    rows += [{"pixels": n} for n in resolutions if n != 64]
    rows += [{"cameras": n} for n in n_cameras if n != 1]
    rows += [{"textures": True}, {"shadows": True}, {"shadows": True, "textures": True}]
    rows += [{"depth": True}, {"depth": True, "segmentation": True}]
    rows += [{"triangles": n} for n in triangles]
    for row in rows:
        yield _drawn({**plain, **row})
    for row in together:
        yield _stepped({**plain, **row}, n_steps)


@functools.cache
def _worlds(n: int, triangles: int) -> tuple[Any, mja.ArenaBatch, mjx.Data]:
    arena, ranges = mja.load("pick_and_place")
    if triangles:
        cubes = [mja.Object(name, "mjcf", on=table, file=_round(triangles)) for table, name in enumerate("ab")]
        arena = mja.MultiTableArena(
            table_offsets=[[0, -0.55, 0.8], [0, 0.55, 0.8]], table_full_sizes=(0.6, 0.6, 0.05), objects=cubes
        )
        given = ranges.distributions
        ranges = mja.ArenaRanges(**{name: given[name] for name in given if not name.startswith("object")})
    keys = mja.world_keys(0, range(n))
    batch = arena.randomize(quiet(arena.put_model("warp")), keys, ranges)
    return arena, batch, mja.make_data(batch, keys)


def _round(subdivision: int) -> mujoco.MjSpec:
    """A sphere of 20 * 4**subdivision triangles."""
    spec = mujoco.MjSpec()
    spec.add_mesh(name="round", scale=[0.03] * 3).make_sphere(subdivision=subdivision)
    geom = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="round")
    geom.contype = geom.conaffinity = 0
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.03, 0, 0], group=3)
    return spec


def _renderer(arena: mja.MultiTableArena, row: Mapping[str, Any]) -> Renderer:
    cameras = dict.fromkeys(CAMERAS[: row["cameras"]], (row["pixels"], row["pixels"]))
    kinds = {name: bool(row[name]) for name in ("depth", "segmentation")}
    return arena.renderer(cameras, shadows=row["shadows"], textures=row["textures"], **kinds)


def _drawn(row: Mapping[str, Any]) -> dict[str, Any]:
    """Pictures of states that follow each other, in one program: called one by one, small ones wait for the host."""
    arena, batch, data = _worlds(row["worlds"], row["triangles"])
    drawing, before = _renderer(arena, row), _warp_bytes()

    @jax.jit
    def run(batch: mja.ArenaBatch, data: mjx.Data) -> Any:
        def one(qpos: jax.Array, _: None) -> tuple[jax.Array, Any]:
            pictures = drawing(batch, data.replace(qpos=qpos))
            return qpos + 1e-9 * pictures[CAMERAS[0]].rgb[:, :1, 0, 0], pictures

        return jax.lax.scan(one, data.qpos, length=_IN_A_ROW)[1]

    begin = time.perf_counter()
    jax.block_until_ready(run(batch, data))
    compiled = time.perf_counter() - begin
    seconds = measure.interleaved({"draw": functools.partial(run, batch, data)})["draw"] / _IN_A_ROW
    return {
        **row,
        "frames_per_second": row["worlds"] * row["cameras"] / seconds,
        "milliseconds": 1e3 * seconds,
        "first_call_seconds": compiled,
        "warp_bytes": None if before is None else _warp_bytes() - before,
    }


def _stepped(row: Mapping[str, Any], n_steps: int) -> dict[str, Any]:
    """A step and the pictures after it, in a rollout; of mujoco_warp in one CUDA graph, of the last step's poses."""
    arena, batch, data = _worlds(row["worlds"], row["triangles"])
    drawing = _renderer(arena, row)
    alone = _Alone(batch, data, drawing)
    last = jax.jit(lambda data: drawing(batch, data)["agentview"].rgb)

    def record(data: mjx.Data) -> Any:
        return drawing(batch, data)

    end, _ = mja.rollout(batch, data, n_steps, record)
    off = np.abs(np.asarray(last(end), int) - alone.pictures_at(np.asarray(end.qpos), row["pixels"])).mean()
    if not off < 0.5:
        raise RuntimeError(f"comparison void: pictures differ by {off:.2f} of 255 in the mean")
    seconds = measure.interleaved(
        {
            "ours": lambda: mja.rollout(batch, data, n_steps, record),
            "alone": functools.partial(alone.rollout, n_steps, read=False),
            "step": lambda: mja.rollout(batch, data, n_steps),
        }
    )
    return {
        **row,
        "with": "step",
        "frames_per_second": row["worlds"] * row["cameras"] * n_steps / seconds["ours"],
        "alone_frames_per_second": row["worlds"] * row["cameras"] * n_steps / seconds["alone"],
        "ours_over_alone": seconds["alone"] / seconds["ours"],
        "milliseconds": 1e3 * seconds["ours"] / n_steps,
        "step_milliseconds": 1e3 * seconds["step"] / n_steps,
        "mean_difference": float(off),
    }


class _Alone(WarpAlone):
    """A step and pictures, one CUDA graph."""

    def __init__(self, batch: mja.ArenaBatch, data: mjx.Data, drawing: Renderer) -> None:
        from mujoco.mjx.third_party import mujoco_warp

        super().__init__(batch, data)
        self._draw = mujoco_warp
        camera = drawing.cameras[0]
        with self.wp.ScopedDevice(self.device):
            self.context = mujoco_warp.create_render_context(
                batch.record.mj_model,
                nworld=batch.n_worlds,
                cam_res=[(camera.width, camera.height)] * len(drawing.cameras),
                cam_active=[c.name for c in drawing.cameras],
                render_rgb=True,
                render_depth=False,
                use_textures=drawing.textures,
                use_shadows=drawing.shadows,
                enabled_geom_groups=list(drawing.groups),
            )

            def both() -> None:
                mujoco_warp.step(self.model, self.data)
                self._pictures()

            self.step = both
            if self.device != "cpu":
                both()  # loads the kernels
                with self.wp.ScopedCapture() as capture:
                    both()
                self.step = functools.partial(self.wp.capture_launch, capture.graph)

    def _pictures(self) -> None:
        self._draw.refit_bvh(self.model, self.data, self.context)
        self._draw.render(self.model, self.data, self.context)

    def pictures_at(self, qpos: np.ndarray, pixels: int) -> np.ndarray:
        """(W, H, B, 3) of states."""
        with self.wp.ScopedDevice(self.device):
            self.data.qpos.assign(qpos)
            self._draw.kinematics(self.model, self.data)
            self._draw.com_pos(self.model, self.data)
            self._draw.camlight(self.model, self.data)
            self._pictures()
            packed = self.context.rgb_data.numpy()[:, : pixels * pixels]
        channels = packed.view(np.uint8).reshape(len(packed), pixels, pixels, 4)
        return channels[..., 2::-1].astype(int)


def _warp_bytes() -> int | None:
    """What Warp holds of a GPU's memory."""
    import warp as wp

    return wp.get_mempool_used_mem_current("cuda:0") if wp.is_cuda_available() else None

"""Specs that compile fast: MuJoCo makes the pixels of a sky and the hulls of meshes anew in each compile, for 0.1 s and more."""

import itertools
from collections.abc import Collection, Iterator

import mujoco
import numpy as np

from mjx_arenas.quaternions import quat_to_mat
from mjx_arenas.spec import masses

_FACES = [0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5]
"""Triangles of a box whose corners are in the order of `itertools.product`."""


def unpainted(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """A copy with the smallest textures that still show their colours; those of files are of one colour."""
    spec = spec.copy()
    for texture in spec.textures:
        if texture.builtin == mujoco.mjtBuiltin.mjBUILTIN_NONE:
            texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
        texture.width = texture.height = 3
        texture.file, texture.data = "", b""
        texture.cubefiles = ["" for _ in texture.cubefiles]
    return spec


def boxed(spec: mujoco.MjSpec, model: mujoco.MjModel, but: Collection[str] = ()) -> mujoco.MjSpec:
    """An unpainted copy, with a box for each mesh that decides no mass.

    Args:
        spec: which stays as it is.
        model: what it compiles to.
        but: names of geoms whose meshes stay. The frame of a mesh is its inertia's, and a box has another; what an object weighs may
            come from its meshes.
    """
    quick = unpainted(spec)
    meshes = {mesh.name: mesh for mesh in quick.meshes}
    sizes = {name: model.mesh_vertnum[model.mesh(name).id] for name in _massless(spec, but)}
    for name in sorted(
        sizes, key=sizes.__getitem__, reverse=True
    ):  # each call of `delete` takes longer if more is left
        i = model.mesh(name).id
        points = model.mesh_vert[model.mesh_vertadr[i] :][: sizes[name]]
        corners = np.array(list(itertools.product(*np.stack([points.min(0), points.max(0)], axis=1))))
        placed = corners @ quat_to_mat(model.mesh_quat[i]).T + model.mesh_pos[i]
        quick.delete(meshes[name])  # one that was compiled keeps what it was
        quick.add_mesh(name=name, uservert=placed.reshape(-1), userface=_FACES)
    return quick


def _massless(spec: mujoco.MjSpec, but: Collection[str]) -> Iterator[str]:
    """Names of the meshes of which no body takes its inertial, no geom its size, and none of these geoms its shape."""
    geoms: dict[str, list[mujoco.MjsGeom]] = {}
    for geom in spec.geoms:
        geoms.setdefault(geom.meshname, []).append(geom)
    for mesh in spec.meshes:
        used = geoms.get(mesh.name, [])
        fixed = all(g.type == mujoco.mjtGeom.mjGEOM_MESH and not masses.inferred(g.parent) for g in used)
        if fixed and not {g.name for g in used} & {*but} and not mesh.plugin.active:
            yield mesh.name

"""The places of written fields in the models of MJX; until then they go by MuJoCo's names (device, pure)."""

import jax
import jax.numpy as jnp
import mujoco
from mujoco import mjx
from mujoco.mjx._src.types import Impl

from mjx_arenas.named import ON_WARP


def of_model(model: mjx.Model, written: dict[str, jax.Array]) -> dict[str, jax.Array]:
    """The leaves of `model` for fields by MuJoCo's names; what only Warp has is left out on JAX."""
    warp = model.impl == Impl.WARP
    found = {
        f"_impl.{name}" if name in ON_WARP else name: x for name, x in written.items() if warp or name not in ON_WARP
    }
    if warp and "opt.impratio" in found:  # which MJX on Warp has, and does not read
        found["opt._impl.impratio_invsqrt"] = 1 / jnp.sqrt(jnp.maximum(found["opt.impratio"], mujoco.mjMINVAL))
    return found

"""A contact that no joint can part takes friction and support from everything else in MJX; plain mujoco and mjx."""

import sys

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

# A link that turns about z on a fixed base, into which it sinks 4 cm along z; 1 m away a box slides on the floor. MuJoCo
# filters no contact between a body and its parent where the parent is fixed. `tilt` is of the link's axis [rad].
XML = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <geom name="base" type="box" size=".06 .06 .06" pos="1 0 .3"/>
    <body name="link" pos="1 0 .36">
      <joint axis="0 {tilt} 1" damping=".1"/>
      <geom type="capsule" size=".04" fromto="0 0 0 0 0 .3"/>
    </body>
    <body name="box" pos="0 0 .025">
      <freejoint/>
      <geom type="box" size=".025 .025 .025"/>
    </body>
  </worldbody>
  {contact}
</mujoco>"""
EXCLUDE = '<contact><exclude body1="world" body2="link"/></contact>'
N_STEPS, SPEED = 60, 0.5


def run(impl: str, tilt: float, contact: str = "") -> tuple[float, np.ndarray, np.ndarray, int]:
    """Cost of the constraints at the start, and y and z of the box in C and in MJX after 0.12 s [m]; MJX's iterations."""
    m = mujoco.MjModel.from_xml_string(XML.format(tilt=tilt, contact=contact))
    d = mujoco.MjData(m)
    d.qvel[1] = SPEED
    mujoco.mj_forward(m, d)
    cost = float((d.efc_force**2 / (2 * d.efc_D)).sum())
    mujoco.mj_step(m, d, N_STEPS)

    mx = mjx.put_model(m, impl=impl)
    dx = mjx.make_data(m, impl=impl)
    dx = dx.replace(qvel=dx.qvel.at[1].set(SPEED) if impl == "jax" else jnp.zeros(m.nv).at[1].set(SPEED))
    step = jax.jit(mjx.step)
    for _ in range(N_STEPS):
        dx = step(mx, dx)
    return cost, d.qpos[1:4:2], np.asarray(dx.qpos)[1:4:2], int(np.asarray(dx._impl.solver_niter).reshape(-1)[0])


def main() -> None:
    """Prints a row for each tilt, and one for the link whose contact is excluded."""
    impls = sys.argv[1:] or ["jax", "warp"]
    for impl in impls:
        print(f"{impl}: tilt of the axis, cost, box in C (y, z), box in MJX (y, z), iterations in the last step")
        for tilt, contact in (
            (0, ""),
            (1e-6, ""),
            (1e-4, ""),
            (1e-3, ""),
            (1e-2, ""),
            (1e-1, ""),
            (1, ""),
            (0, EXCLUDE),
        ):
            cost, c, x, niter = run(impl, tilt, contact)
            end = "  excluded" if contact else ""
            print(
                f"{tilt:8g} {cost:9.1e}   {c[0]:7.4f} {c[1]:7.4f}   {x[0]:7.4f} {x[1]:7.4f}   {niter}{end}", flush=True
            )


if __name__ == "__main__":
    main()

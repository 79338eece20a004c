"""A kitchen of one's own (kitchen.xml) in which everything varies by terms: `python docs/examples/kitchen.py`."""

import pathlib

import jax
import jax.numpy as jnp

import mjx_arenas as mja
from mjx_arenas import LogUniform, Uniform
from mjx_arenas.dr import Term

PICTURE = pathlib.Path(__file__).with_suffix(".png")
COLOURS = ("red", "green", "blue")
VARIED = {  # what varies, and how: "add" and "scale" are of the numbers in kitchen.xml
    # Where things stand. Whatever stands on the left counter moves with it: one draw for all of them.
    "left": (
        Term("body.pos", ["left", "mug", "box"]),
        Uniform([-0.06, -0.02, -0.1], [0.04, 0.02, 0.1], "add", tied=True),
    ),
    "right": (Term("body.pos", "right"), Uniform([-0.04, -0.02, -0.1], [0.06, 0.02, 0.1], "add")),
    "above": (Term("body.pos", ["shelf", "cupboard"]), Uniform([-0.1, 0, -0.1], [0.1, 0, 0.1], "add")),
    "handle": (Term("geom.pos", "mug_handle", axes="z"), Uniform(-0.01, 0.01, "add")),
    "boards": (Term("geom.size", ".*_board", axes=("first", "second")), Uniform(0.95, 1.1, "scale")),
    # How they move.
    "slippery": (Term("geom.friction", [".*_board", "drawer_bottom"], axes="sliding"), Uniform(0.3, 1.2)),
    "box_weight": (Term("body.mass", "box"), LogUniform(0.1, 1.5)),
    "fronts": (Term("body.mass", ["drawer", "door"]), Uniform(0.7, 1.4, "scale")),
    "damping": (Term("joint.damping", ["drawer", "door"]), LogUniform(0.5, 4.0, "scale")),
    "sticky": (Term("joint.frictionloss", ["drawer", "door"]), LogUniform(0.3, 3.0, "scale")),
    "opens": (Term("joint.range", ["drawer", "door"], axes="high"), Uniform(0.6, 1.0, "scale")),
    "gain": (Term("actuator.kp"), Uniform(0.6, 1.4, "scale")),
    # How they look.
    "paint": (Term("material.rgba", ["front", "mug", "card"], axes=COLOURS), Uniform(0.2, 0.9)),
    "wood": (Term("material.rgba", ["wood", "wall", "floor"], axes=COLOURS), Uniform(0.7, 1.0, "scale", tied="axes")),
    "gloss": (Term("material.specular"), Uniform(0.0, 1.0)),
    "lamp": (Term("light.pos"), Uniform(-0.4, 0.4, "add")),
    "daylight": (Term("light.diffuse"), Uniform(0.15, 0.55)),
    "eye": (Term("camera.pos"), Uniform(-0.15, 0.15, "add")),
    "gaze": (Term("camera.rpy"), Uniform(-0.04, 0.04)),
    "lens": (Term("camera.fovy"), Uniform(0.9, 1.15, "scale")),
}


def main(
    worlds: int = 16, steps: int = 150, picture: pathlib.Path | None = PICTURE
) -> tuple[mja.CheckReport, float, jax.Array]:
    """Checks, compares and steps worlds; gives the report, how far they are from recompiled ones, and `qpos`."""
    arena = mja.Arena.from_xml(PICTURE.with_suffix(".xml"))
    arena.vary(**{name: term for name, (term, _) in VARIED.items()})
    ranges = mja.ArenaRanges(terms={name: distribution for name, (_, distribution) in VARIED.items()})

    report = mja.check(arena, ranges, n_worlds=worlds, n_steps=steps)  # does anything explode, sink in, fall through?
    print(report)

    keys = mja.world_keys(0, range(worlds))  # those that were checked
    batch = arena.randomize(arena.put_model("warp"), keys, ranges)
    compiled = {i: arena.compile(batch.world(i)) for i in range(worlds)}
    off = mja.differences(batch.model, compiled)
    print(
        f"{worlds} worlds against MuJoCo's compiler: no number is off by more than {max(off.values()):.1e} of itself."
    )

    pull = jnp.tile(jnp.array([0.3, 1.9]), (steps, 1))  # drawer and door, open
    data = mja.rollout(batch, mja.make_data(batch, keys), steps, control=pull)
    if picture is not None:
        some = range(min(6, worlds))
        labels = [f"world {i}: counter {compiled[i].body('left').pos[2]:.2f} m" for i in some]
        shown = mja.take(batch.params, some), mja.take(data, some)
        sheet = arena.contact_sheet(*shown, labels, columns=3, camera="front", width=320, height=240)
        sheet.save(picture, optimize=True)
    return report, off, data.qpos


if __name__ == "__main__":
    main()

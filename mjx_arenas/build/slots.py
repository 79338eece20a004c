"""The variants of objects, each measured as MuJoCo compiles it alone (host)."""

from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas.sample.variants import Variants
from mjx_arenas.spec import objects, rigid
from mjx_arenas.spec.objects import Object, geom_name


def variants(spec: mujoco.MjSpec, objs: Sequence[Object], first: int) -> tuple[Variants, ...]:
    """What the variants of some objects of a spec are, of which the first has this index."""
    return tuple(_of(spec, obj, k) for k, obj in enumerate(objs, first) if obj.slots)


def _of(spec: mujoco.MjSpec, obj: Object, k: int) -> Variants:
    measures = [objects.measure(slot, k + i) for i, slot in enumerate(obj.slots)]
    inertials = [rigid.inertial(objects.alone(slot)[1]) for slot in obj.slots]
    geoms = [_geoms(spec, obj, slot) for slot in obj.slots]

    def colours(slot: Object, names: Sequence[str]) -> np.ndarray:
        own = [spec.geom(name).rgba if slot.type == "mjcf" else np.ones(4) for name in names]
        return np.array(own, float).reshape(-1, 4)

    ipos, iquat, inertia = (np.array(x, float) for x in zip(*inertials, strict=True))
    names = ("full_size", "center", "density", "friction", "rgba", "mass")
    return Variants(
        object=k,
        quantity=f"{obj.name}.variant",
        names=tuple(one.name for one in obj.variants or ()),
        geoms=tuple(geoms),
        colours=tuple(colours(slot, names) for slot, names in zip(obj.slots, geoms, strict=True)),
        kind=np.array([slot.type for slot in obj.slots], str),
        ipos=ipos,
        iquat=iquat,
        inertia=inertia,
        **{name: np.array([getattr(m, name) for m in measures], float) for name in names},
    )


def _geoms(spec: mujoco.MjSpec, obj: Object, slot: Object) -> tuple[str, ...]:
    """Names of the geoms of a variant, which stand on the body in the order of the variants."""
    if slot.type != "mjcf":
        return (geom_name(slot.name),)
    others = {geom_name(other.name) for other in obj.slots if other.type != "mjcf"}
    longer = [f"{other.name}_" for other in obj.slots if other.name.startswith(f"{slot.name}_")]
    names = [geom.name for geom in spec.body(obj.name).geoms]
    mine = [name for name in names if name.startswith(f"{slot.name}_") and name not in others]
    return tuple(name for name in mine if not any(name.startswith(prefix) for prefix in longer))

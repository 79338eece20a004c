"""What robots and parts of furniture can stand on (host)."""

from mjx_arenas.furniture import standing, surfaces
from mjx_arenas.keywords import letters, nearest
from mjx_arenas.problem import Problem, problem
from mjx_arenas.rules import validation
from mjx_arenas.terms.parts import Parts


def carrier(path: str, on: object, parts: Parts, stays: bool, frames: bool = False) -> int | str | Problem | None:
    """The index of a table, or the name of a surface or a part; None for the world; or why nothing can stand there.

    Args:
        path: of the argument.
        on: what it is.
        parts: of the arena.
        stays: whether what stands there cannot be absent.
        frames: whether names of parts are allowed, too.
    """
    table = validation.table_index(on, [t.body for t in parts.tables], [t.collision for t in parts.tables])
    if on is None or table is not None:
        return table
    furniture = parts.places.furniture
    part = next((one for one in furniture if frames and one.name == on), None)
    surface = ""
    if part is None and isinstance(on, str) and on in standing.surface_names(furniture):
        index, surface = standing.carrier(on, furniture)
        part = furniture[index]
    if part is None:
        tops = surfaces.names([t.body for t in parts.tables], furniture)
        names = dict.fromkeys([*tops, *((one.name for one in furniture) if frames else ())])
        close = nearest(on, names) if isinstance(on, str) else None
        near = close and letters(close) != letters(str(on))
        later = f": {close!r} may be meant" if near else ": furniture that carries it must be added first"
        told = {"later": later} if isinstance(on, str) else {}
        if not names:
            return problem(path, "no_carrier", None, on, told)
        return problem(path, "carrier", None, on, {"names": list(map(repr, names)), "optional": True, **told})
    pieces = {one.name: one.piece for one in part.nominal_surfaces}
    piece = pieces.get(surface, "")
    if piece in part.moving:
        return problem(path, "must", None, on, must="what does not move, or None")
    if stays and not part.stays:
        must = f"what is always there, as with {type(part).__name__}({part.name!r}, stays=True), or None"
        return problem(path, "must", None, on, must=must)
    return on  # type: ignore[return-value]

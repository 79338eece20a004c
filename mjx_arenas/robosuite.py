"""What robosuite's arenas have and these have not."""

from typing import TYPE_CHECKING, NoReturn

INSTEAD = {
    "set_camera": "add_camera(name, ...) for a new one, `spec.camera(name)` to change one",
    "set_origin": "give `table_offset` or `table_offsets`, or put the arena somewhere with one.merge(other, prefix, pos)",
    "get_xml": "`xml` is the nominal arena's MJCF, to_xml(params) a world's",
    "get_model": "`mj_model` is the nominal arena's, compile(params) a world's",
    "configure_location": "there is nothing to do, as places are parameters",
    "set_scale": "give `table_full_size` or `table_full_sizes`, or an object's `full_size`",
    "floor": 'it is `spec.geom("floor")`',
    "worldbody": "it is `spec.worldbody`",
    "save_model": "mja.save(arena, file) keeps an arena, export(params, folder) a world with its assets",
    "merge_assets": "`attach` and `merge` bring assets along",
}
"""What stands for methods of robosuite's arenas."""


class WithoutRobosuites:
    """Answers who calls a method of robosuite's by what stands for it."""

    if not TYPE_CHECKING:  # so that type checkers know what there is

        def __getattr__(self, name: str) -> NoReturn:
            if hasattr(type(self), name):  # a property, whose own AttributeError brought us here
                object.__getattribute__(self, name)
            instead = f": {INSTEAD[name]}" if name in INSTEAD else ""
            raise AttributeError(f"{type(self).__name__!r} has no {name!r}{instead}.", name=name, obj=self)

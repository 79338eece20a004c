"""An arena: configured and compiled once on the host, varied in thousands of worlds on the device."""

import dataclasses
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import jax
import mujoco
import numpy as np

from mjx_arenas import dr, textures
from mjx_arenas.build import assemble, attach, cameras, frozen, furnish, keyframes, materials, overlaps, scene, vary
from mjx_arenas.compiled import one_at_a_time
from mjx_arenas.furniture.part import Part
from mjx_arenas.keywords import made_by, with_known_methods
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import problem
from mjx_arenas.record import layout, proof, refusals
from mjx_arenas.robosuite import WithoutRobosuites
from mjx_arenas.rules import angle_rules, validation, validation_objects, validation_warnings, validation_worlds
from mjx_arenas.sample.placement import lies
from mjx_arenas.spec import calls, specs
from mjx_arenas.spec.follow import Follow
from mjx_arenas.spec.objects import Object
from mjx_arenas.terms.parts import Parts
from mjx_arenas.varied import Varied


@with_known_methods
class Arena(Varied, WithoutRobosuites):
    """A scene of tables, objects, furniture and robots, in a model whose topology never changes.

    Use `MultiTableArena`, `TableArena` or `Arena.from_xml`. You may `attach` robots and add other things to `spec` (sensors, cameras)
    until the model is first compiled, by `mj_model` or anything that needs it. An object of one geom may get sites, cameras and
    lights, but no geoms or bodies.
    """

    @made_by("TableArena(...), MultiTableArena(...), Arena.from_xml(...) or mja.load(...)")
    def __init__(self, spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> None:
        self.spec = spec
        self._lock = threading.RLock()
        self._parts = parts
        self._nominal = nominal = parts.completed(nominal)
        self._calls = calls.Made()
        model = _checked(spec, parts, nominal)
        overlaps.warn(overlaps.overlaps(model, "", self._passing, carriers=self._parts.carriers), "The arena")
        keyframes.warn_of_ranges(model, "The arena")
        validation_warnings.warn_of_overlaps(nominal, self.table_names)
        if not any(t.adopted for t in parts.tables):  # those of a scene stand as it says
            _warn_of_fixed(model, parts, nominal, [-1])
            validation_warnings.warn_of_long(nominal, self.table_names)
        angle_rules.warn_of_degrees("table_rots", nominal.table_rots)
        validation_warnings.warn_of_far(nominal, self.table_names)
        _warn_of_objects(parts, nominal, len(parts.objects))

    @classmethod
    def from_xml(
        cls,
        xml: str | os.PathLike | mujoco.MjSpec,
        tables: Sequence[str] = (),
        *,
        objects: Sequence[Object | str] = (),
        table_priority: int = 1,
        follow: Sequence[Follow] = (),
    ) -> "Arena":
        """Makes an arena from an MJCF scene, such as a kitchen, a quadruped or a hand.

        Bodies of the scene may become tables and objects. A table is a body that is fixed to the world and has a box on which things
        stand. This box is the slab: its size, friction and pose vary. Everything else on the body moves with the middle of the slab
        and keeps its shape; `follow` changes that. If several boxes belong to one body, or to the world, each becomes a body of its own
        with the geom's name. The looks of the slab move to a new geom, `{body}_visual`. The library adds no legs that are seen or collide.
        The slab's `condim` is raised to the largest of the `objects`'.

        Args:
            xml: path of the MJCF, MJCF text, or a spec, of which a copy is taken.
            tables: name of each table's body; if the body has several boxes that collide, the name of the slab's geom.
            objects: free bodies on the tables: new ones, and those of the scene by name, short for `Object(name, "scene")`. Those of
                the scene keep their names and poses, stand on the table below them, and follow it.
            table_priority: `priority` of the contacts of slabs and furniture, see `MultiTableArena`.
            follow: geoms that follow the edges of a slab, or reach from it to the floor.

        Raises:
            ValueError: all problems of the call.
        """
        objects = scene.asked(objects)
        arena = Arena(*scene.adopt(xml, tables, objects, table_priority, follow))
        arena._calls = calls.Made([calls.of(Arena.from_xml, locals())])
        return arena

    @one_at_a_time
    def attach(
        self,
        robot: str | os.PathLike | mujoco.MjSpec,
        prefix: str = "robot_",
        pos: Sequence[float] = (0, 0, 0),
        quat: Sequence[float] = (1, 0, 0, 0),
        on: int | str | None = None,
        options: Literal["all", "solver"] | None = None,
        under: bool = False,
        keyframe: str | None = None,
    ) -> None:
        """Puts a robot, or any other MJCF, into the arena, with its actuators, sensors, tendons, defaults and keyframes.

        Args:
            robot: path of an MJCF file, MJCF text, or a spec, of which a copy is taken.
            prefix: prefix of all its names.
            pos: (3,) place of its origin: in the world, or in the frame of what it is `on` [m].
            quat: (4,) its orientation there, (w, x, y, z), of any length but 0; MuJoCo normalizes it.
            on: what it stands on and follows in every world. None: the world. One of

                - a table, by index, body name or slab's name. `pos` is in the frame of its top, and the table cannot be absent.
                - a surface of a part of furniture that `stays`, by name. `pos` is in the frame of the surface.
                - a part of furniture that `stays`, by name. `pos` is in the part's frame: beside it, or below. The robot follows
                  that frame, and not the sides of the part. If the part grows to where the robot stands, the world is invalid.
            options: which of its `<option>`s are taken over, as far as the arena has MuJoCo's defaults. "solver": time step,
                integrator, cone, iterations, ... "all": also those that change everything else in the arena, which are contacts and
                gravity that are switched off, other gravity, density, viscosity, wind and magnetic field, and overridden contact
                parameters. None: all, with a warning of the latter. The log ("mjx_arenas") names the others at level INFO.
            under: whether it hangs from the underside of what it is `on`, and follows it: of a table, or of a box of a part, such as a
                board or a rail. `pos` is then in the frame of the top or the surface, moved down to the underside.
            keyframe: name of its keyframe in which it starts, the only one in which geoms must be apart. None: in all and at `qpos0`.

        Objects keep clear of the fixed geoms of a robot, such as its base. They may be placed where the arm is (see `place`).

        Raises:
            ValueError: the arena already has a name, `on` does not exist, or MuJoCo refuses the robot. The arena is then as before.
        """
        self._check_open("attach", "attach")
        validation.raise_all(self._parts.problems(self.spec), "`arena.spec`")
        child = specs.read(robot, "robot")
        below = attach.check(child, prefix, pos, quat, on, options, self._parts, under, keyframe)
        parts, merged, inside, model = self._parts, attach.Options([], [], []), [], None
        for spec in (self.spec.copy(), self.spec):  # the second only where the first compiles
            parts = attach.attach(spec, self._parts, child.copy(), prefix, pos, quat, below, under)
            merged = attach.merge_options(spec, child, options)
            assemble.set_params(spec, parts, self._nominal)
            if spec is not self.spec:
                refusals.check_rules(spec, parts)
                model = proof.check_compiles(spec)
                inside = overlaps.overlaps(model, prefix, self._passing, keyframe and prefix + keyframe)
        self._parts, self._checked = parts, None
        self._note(Arena.attach, locals())
        merged = merged if options is None else merged._replace(changed=[])
        tell = 'with options="solver" the arena keeps its own, with options="all" it takes these without a warning'
        attach.warn_of_options(merged, "robot", tell)
        overlaps.warn(inside, "`robot`", keyframe is None)
        assert model is not None
        overlaps.warn_of_gap(model, prefix, pos, parts.tables[below] if isinstance(below, int) else None)
        keyframes.warn_of_ranges(model, "`robot`", prefix)
        _warn_of_fixed(model, self._parts, self._nominal, range(len(parts.furniture)), prefix)

    @one_at_a_time
    def add_camera(
        self,
        name: str,
        pos: Sequence[float] = (0, 0, 0),
        look_at: Sequence[float] | str | None = None,
        quat: Sequence[float] | None = None,
        fovy: float = 45.0,
        on: str | None = None,
        resolution: tuple[int, int] | None = None,
    ) -> None:
        """Adds a camera: in the world, or on a body that carries it, such as a robot's hand.

        Args:
            name: a name that no camera has yet.
            pos: (3,) its place, in the world or in the frame of the body that it is `on` [m].
            look_at: (3,) the point in the same frame that it looks at, upright [m]; or the name of a body that it looks at in every state.
            quat: (4,) its orientation instead, (w, x, y, z): it looks along its -z, with y up in the picture. Without both it looks down.
            fovy: height of its field of view [degrees].
            on: name of a body; None: the world.
            resolution: width and height of its pictures [pixels]; None: as `renderer` has it.

        Raises:
            ValueError: all problems of the call. The arena is then as before.
        """
        self._check_open("add_camera", "add cameras")
        cameras.add(self.spec, name, pos, look_at, quat, fovy, on, resolution)
        self._note(Arena.add_camera, locals())

    @one_at_a_time
    def add_material(
        self,
        name: str,
        texture: textures.Texture | np.ndarray | jax.Array | None = None,
        rgba: Sequence[float] = (1, 1, 1, 1),
        texrepeat: Sequence[float] = (1, 1),
        texuniform: bool = False,
        specular: float = 0.5,
        shininess: float = 0.5,
    ) -> None:
        """Adds a material, for geoms of `spec` and for terms of `geom.material`. Names and defaults are MuJoCo's.

        `arena.spec.assets` holds its texture as a PNG. `export` writes the PNG beside the MJCF, and the MJCF of `to_xml` needs it as well.

        Args:
            name: a name that no material or texture has yet. The texture gets it as well.
            texture: one of `mjx_arenas.textures`, or (height, width, 3) uint8 pixels, which `mjx_arenas.save` cannot write. None: one
                colour, unless the MJCF's `<default>` gives materials a texture.
            rgba: (4,) colour and opacity, from 0 to 1; the texture is multiplied by it.
            texrepeat: (2,) how often the texture repeats along x and y: per geom, or per metre if `texuniform`.
            texuniform: whether `texrepeat` is per metre.
            specular: how strongly it reflects lights, from 0 to 1.
            shininess: how small the reflections of lights are, from 0 to 1.

        Raises:
            ValueError: all problems of the call. The arena is then as before.
            ImportError: there is a texture, and Pillow, of the extra `[viz]`, is not installed.
        """
        self._check_open("add_material", "add materials")
        materials.add(self.spec, name, texture, rgba, texrepeat, texuniform, specular, shininess)
        self._note(Arena.add_material, locals())

    @one_at_a_time
    def add_part(self, part: Part) -> None:
        """Adds a part of furniture. Its numbers become quantities of the arena, such as "rack.heights" of a `Shelf("rack")`.

        Args:
            part: a part of `mjx_arenas.furniture`, or of a class of your own.

        Raises:
            ValueError: all problems of the call. The arena is then as before.
        """
        self._check_open("add_part", "add parts")
        validation.raise_all(self._parts.problems(self.spec), "`arena.spec`")
        spec, parts, nominal = furnish.add(self.spec, self._parts, self._nominal, part)
        model = proof.check_compiles(spec)
        self.spec, self._parts, self._nominal, self._checked = spec, parts, nominal, None
        overlaps.warn(overlaps.overlaps(model, "", self._passing, carriers=self._parts.carriers), "The arena")
        validation_warnings.warn_of_part(nominal, parts.places.furniture, self.table_names)
        _warn_of_fixed(model, parts, nominal, [len(parts.furniture) - 1])
        self._note(Arena.add_part, locals())

    @one_at_a_time
    def add_object(self, obj: Object) -> None:
        """Adds a free body, on a table or on a part of furniture. What carries it gets the object's `condim`, if that is larger.

        Args:
            obj: the object; its `on` may be any of `surfaces`.

        Raises:
            ValueError: all problems of the call. The arena is then as before.
        """
        self._check_open("add_object", "add objects")
        validation.raise_all(self._parts.problems(self.spec), "`arena.spec`")
        if not isinstance(obj, Object):
            validation.raise_all([problem("obj", "must", None, obj, must="an mjx_arenas.Object")], "`add_object`")
        slabs = [t.collision for t in self._parts.tables]
        problems, on = validation_objects.object_problems(
            [obj], self._parts.surfaces, self.spec, slabs, before=self.objects
        )
        validation.raise_all(problems, "`add_object`")
        spec = self.spec.copy()
        parts, nominal = assemble.add_objects(spec, self._parts, self._nominal, [obj], on)
        assemble.raise_condim(spec, parts)
        _checked(spec, parts, nominal)
        self.spec, self._parts, self._nominal, self._checked = spec, parts, nominal, None
        _warn_of_objects(parts, nominal, 1)
        self._note(Arena.add_object, locals())

    @one_at_a_time
    def vary(self, **terms: dr.Term) -> None:
        """Turns attributes of MJCF elements into quantities of the arena, which vary like those of tables and objects.

        `params.terms[name]` then has the numbers of each world, (N, ...) for the N elements in the model's order. Nominally they are
        those of the MJCF. `ArenaRanges(terms={name: distribution})` draws them. The first compilation proves that MuJoCo compiles the
        same worlds.

        Args:
            terms: the terms, by the names that the quantities get.

        Raises:
            ValueError: all problems of the call. The arena is then as before.
        """
        self._check_open("vary", "vary")
        validation.raise_all(self._parts.problems(self.spec), "`arena.spec`")
        self.spec, self._parts, self._nominal = vary.vary(self.spec, self._parts, self._nominal, terms)
        self._checked = None
        self._note(Arena.vary, locals())

    def adopt_spec(self, spec: mujoco.MjSpec) -> None:
        """Takes the MJCF that `mja.save` wrote of this arena in the place of `spec`. Nothing in it counts as edited since `vary`."""
        self.spec, self._parts = spec, dataclasses.replace(self._parts, varied=frozen.as_held(spec, self._parts.varied))

    def merge(self, other: "Arena", prefix: str, pos: Sequence[float] = (0, 0, 0), rot: float = 0.0) -> "Arena":
        """Returns a new arena with everything from both arenas.

        Args:
            other: the arena to put beside this one.
            prefix: prefix of all names of the other arena. If both worlds have an element of the same name (the floor, lights, cameras),
                this arena's is kept.
            pos: (3,) place of the other's origin [m].
            rot: the other's yaw there [rad].

        Raises:
            ValueError: `other` has parts of furniture or quantities of `vary`. Merge first, then add these to the merged arena. This arena
                may have them.
        """
        validation.check_type("other", other, Arena, "an arena")
        if other._parts.furniture or other._parts.varied:
            raise validation.error([problem("other", "merged_quantities")])
        one, two = ((a.own_spec(), a._parts, a._nominal) for a in (self, other))
        merged = Arena(*attach.merge(one, two, prefix, pos, rot))
        if not other._parts.tables:  # of these it is said
            angle_rules.warn_of_degrees("rot", rot)
        if self._calls and other._calls:
            given = locals() | {"other": other._calls}
            merged._calls = calls.Made([*self._calls, calls.of(Arena.merge, given)])
        return merged

    def _check_open(self, name: str, do: str) -> None:
        """Refuses a call that comes after the arena was compiled."""
        if self.is_compiled:
            raise validation.error([problem(name, "compiled_already", do=do)])

    def _note(self, method: Callable, given: Mapping[str, Any]) -> None:
        """Adds a call of a method with these arguments (its `locals()`) to those that made the arena, where they are known."""
        if self._calls:
            self._calls = calls.Made([*self._calls, calls.of(method, given)])

    @property
    def _passing(self) -> list[str]:
        """Bodies of which it does not matter what they touch: objects, which are placed elsewhere, and what is absent."""
        presence = self._parts.presence
        return [o.name for o in self.objects] + presence.gone(presence.wanted(self._nominal))[0]


def _checked(spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams) -> mujoco.MjModel:
    """The compiled nominal arena, whose spec gets its parameters.

    Raises:
        ValueError: it cannot be.
    """
    names, places = tuple(o.name for o in parts.objects), parts.places
    wrong = validation_worlds.size_problems(nominal, names, places, [t.body for t in parts.tables])
    validation.raise_all(wrong, "`objects`")
    assemble.set_params(spec, parts, nominal)
    refusals.check_rules(spec, parts)
    return proof.check_compiles(spec)


def _warn_of_fixed(
    model: mujoco.MjModel, parts: Parts, nominal: ArenaParams, of_part: Sequence[int], prefix: str = ""
) -> None:
    """Warns of parts, or of tables (-1), that are nominally in what is fixed, of which the names have a prefix."""
    fixed, tables = layout.fixed_of(model, parts), [t.body for t in parts.tables]
    validation_warnings.warn_of_fixed(nominal, parts.places, fixed, parts.follows, tables, of_part, prefix)


def _warn_of_objects(parts: Parts, nominal: ArenaParams, new: int) -> None:
    """Warns of what objects hardly should be, of all together, and of the last `new` ones each."""
    names, places, tables = [o.name for o in parts.objects], parts.places, [t.body for t in parts.tables]
    validation_warnings.warn_of_crowds(nominal, places.ground, lies(places, nominal).full_size, places.drop, tables)
    validation_warnings.warn_of_places(nominal, places.ground, names, places.pos, tables)
    since = len(parts.objects) - new
    masses, sizes = nominal.object_masses[since:], nominal.object_full_sizes[since:]
    validation_warnings.warn_of_dense(parts.objects[since:], masses, sizes)
    for obj in parts.objects[since:]:
        angle_rules.warn_of_degrees("objects.rot", obj.rot, ("object", obj.name))

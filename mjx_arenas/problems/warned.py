"""What warnings say, by their rules, as `sentences` has the errors."""

WARNINGS = {
    "left_out_of_preset": "{at}: the preset leaves out {left}.",
    "fixed_left": "{at} varies table {table!r}, on which the fixed {which} of the scene {stay}: put {them} into the <body> of the table, "
    "with which its children move.",
    "free_left": "{at} varies table {table!r}, on which the free {which} of the scene {stay}: name {them} among the `objects` of "
    "from_xml, which follow their table.",
    "start_inside": "{first} and {second} start {depth:.3f} m inside each other at their nominal places; {free}.",
    "geoms_inside": "{where}: geoms are inside each other: {told}.{lost} Keep them apart, or leave out their contacts: "
    "`arena.spec.add_exclude(bodyname1={first!r}, bodyname2={second!r})`, or <exclude> in the MJCF.",
    "geoms_in_others": "{where}: geoms are inside each other: {told}.{lost} Put one of each pair elsewhere{or_else}.",
    "out_of_range": "{where}: joints start outside of their ranges: {told}.",
    "tables_overlap": "Tables {first!r} and {second!r} overlap by {across:.3g} m horizontally and {height:.3g} m vertically: "
    "moving them apart by either distance ends this.",
    "part_overlaps": "{first} and {second} overlap, {pair}by {across:.3g} m horizontally and {height:.3g} m vertically: this "
    "is taken to be intended in every world.",
    "fixed_overlaps": "{first} and {second} overlap by {depth:.3g} m: this is taken to be intended in every world.",
    "part_larger": "Part {name!r} is {size} m, seen from above, larger than {below}, on which it stands, and which is {top} m: this is "
    "taken to be intended in every world.",
    "sinks": "{what} {depth:.3g} m below the floor: this is taken to be intended in every world.",
    "crowd": "The {n} objects on {below} cover {covered:.3g} m^2, more than its top of {area:.3g} m^2, so they do not all fit "
    "side by side. Give some of them `active=False`, so that they are nominally absent, or let them fall onto each other: "
    "`place=Place(drop=True)`.",
    "off_table": "{at} {got} is off {below}, whose top reaches {x:g} m x {y:g} m from its middle: without a key it starts in "
    "the air.",
    "part_away": "Part {name!r} is {away:.3g} m away from {near} in the nominal arena, instead of {allowed} m.",
    "object_away": "Object {name!r} is {away:.3g} m away from {near} at its nominal place, instead of {allowed} m: `make_data` "
    "with keys draws places within.",
    "object_unreached": "Object {name!r} finds no free place in the nominal arena: on {below} it is {closest:.3g} to "
    "{farthest:.3g} m away from {near}, instead of {allowed} m.",
    "gone": "`{path}` leaves {label} in no world, as nothing on which it can stand is ever there: {names}.",
    "object_without_room": "Object {name!r} finds no free place in the nominal arena: its `region` and `margin` leave {left} of {below} "
    "for its outline of {size} m{turned}.",
    "judged_on_drawn": "The arenas are no new ones: {at} draws them once, and takes one of these in each of the {of} worlds. With "
    "{setting} set to 0 they are new.",
    "many_reported": "Something is reported of {n} of the {of} worlds, most often that {why} ({most}). The shares therefore say little "
    "about the policy; {do}.",
    "too_wide": "{at} {can} {size} m, seen from above, and the gripper takes at most {width:g} m: `invalid_arena` reports such episodes.",
    "restless": "{at} does not stay in its keyframe {got}: within a second {what}. A servo shakes a light joint if it is too stiff for the "
    "time step: give the servo a smaller `kp`, the joint more `armature`, or the spec the integrator implicitfast.",
    "fingers_far": "{at} sends {moved!r} to {target:g}, far beyond its range, {least:g} to {most:g}. A target slightly beyond contact is "
    "enough for the force of the grip.",
    "fingers_aside": "{at}: the fingers open along a line that is {away:.0f} degrees from the y axis of site {got}. They should open along "
    "that axis: turn the site by {turn:.0f} degrees about its z axis.",
    "slips": "{at} is a pyramid, with which a held object slips by millimetres a second: `arena.spec.option.cone, "
    "arena.spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10` before the task is made, or `options: {{cone: 1, impratio: 10}}` in "
    "the arena's file.",
    "never_reached": "{at}: {what} is out of the arm's reach {when}. It is on {surface}, which is {near:.2f} to "
    "{far:.2f} m from the arm's base, seen from above, and {height} the base. The tool goes to places {least:g} to {most:g} m away, and "
    "at some of these distances from {from_} to {to} the base.{lift} "
    "`invalid_arena` reports such episodes. `on` and `pos` say where the arm stands.",
    "covered": "{at}: {what} may be on {surfaces}. The hand of an arm whose tool points down hardly fits there, and "
    "`invalid_arena` does not count such episodes.",
    "front_unreached": "{at}: the arm does not reach behind the front of {drawer!r} {when}. That is {near:.2f} to {far:.2f} m from its "
    "base, seen from above, and {height} it. `invalid_arena` reports such episodes. `on` and `pos` say where the arm stands.",
    "tip_unreached": "{at}: {what} is out of the gripper's reach {when}. It is on {surface}, whose top is {up:.2f} m high. The tip goes "
    "to heights from {least:g} to {most:g} m, and {reach:g} m to each side of the middle of the floor along x and y. `invalid_arena` "
    "reports such episodes.",
    "front_blocked": "{at}: a table or a part of furniture stands in the way of the front of {drawer!r} {when}. `invalid_arena` reports "
    "such episodes.",
    "front_shut": "{at}: the gripper does not fit in behind the front of {drawer!r} {when}. The drawer starts {opening:.3f} m open, and "
    "the thinnest part of the gripper fits in from {least:.3f} m on. `invalid_arena` reports such episodes. `openings` says how far "
    "drawers are open.",
    "sinks_or_floats": "{at} lets {upper} {does}, on which it stands, as its place stays: vary its `{place}`, too, or make it an Object, "
    "which stands on what carries it.",
    "drawn_on_host": "{at} seems to draw with `np.random` or `random`: it is traced once, so that these numbers are the same in every "
    "world and episode. Draw with jax.random and its `key`, or `episode.key`.",
    "long_step": "{at} is {seconds:g} s: it is in seconds, not in milliseconds.",
    "policy_draws_on_host": "{at} seems to draw with `np.random` or `random`: it is traced once, so that it does the same in every step. "
    "Draw with jax.random and its `key`.",
    "no_range": "{at} varies nothing, as `ranges.terms` has no range {name!r}.",
    "falling": "{at}: episodes start before what is dropped (`place.drop`) has come to rest: {names}. With "
    "`config_overrides={{'settled': 1024}}` they start in worlds in which it has.",
    "one_for_all_pieces": "{at} gives all pieces one range, from {least:.3g} to {most:.3g}: most worlds will not be valid, as the numbers "
    "must be {must}. Give each its own range, or `relative='add'`.",
    "below_zero": "{at} adds one range, from {least:.3g} to {most:.3g} m, to x, y and z, which moves it below z = 0: give three "
    "numbers.",
    "degrees": "{at} has angles of up to {most:g} rad, more than a turn: angles are in radians (90 degrees are 1.571).",
    "radians": "{at} has angles of at most {most:.3g} degrees: these angles are in degrees ({most:.3g} rad are {degrees:.3g}).",
    "milliseconds": "{at} is up to {most:g} s: time steps are in seconds (2 ms are 0.002).",
    "millimetres": "{at} is up to {most:g} m away: lengths are in metres (200 mm are 0.2).",
    "place_in_mjcf": "{at} is around its place in the MJCF, {told}, which a <frame> or the middle of a mesh moves. In the compiled model "
    'it is at {compiled}: give a range around that, or one with `relative="add"`.',
    "long": "{at} is up to {most:g} m: lengths are in metres (30 cm are 0.3).",
    "grams": "{at} is up to {most:g} kg, {times:,.0f} times the nominal {nominal:.3g} kg: masses are in kilograms (50 g are 0.05).",
    "dense": "{at} is {mass:g} kg, and the density {density:,.0f} kg/m^3, more than that of any metal: masses are in kilograms "
    "(50 g are 0.05).",
    "centimetres": "{at} is up to {most:g} m, {times:,.0f} times the nominal {nominal:.3g} m: lengths are in metres (5 cm are 0.05).",
    "other_options": "{at} has other options than the arena. The arena's are used: {names}.",
    "changing_options": "{at} changes options of the whole arena: {names}; {tell}.",
    "options_since": "{at}: {names} changed since the last `put_model`. Existing templates and batches keep the old values, "
    "and newly compiled worlds have the new ones.",
    "idle_friction": "{at}: torsional and rolling friction have no effect with table_condim={condim}.",
    "idle_rolling": "{at}: rolling friction has no effect with table_condim={condim}.",
    "idle_spin": "{at}: {which} no effect, as contacts of these geoms have a `condim` of {condim} at most.",
    "idle_scale": "{at}: relative='scale' has no effect, as the nominal number is 0: use relative='add'.",
    "idle_objects": "{at} has no effect on {what}, whose own friction counts. With table_priority=0 the larger of the two would count. "
    "Between the fingers of a gripper that of objects with `priority=1` counts, if table_priority is 2.",
    "idle_priority": "{at} has no effect: everything that can touch these geoms has a higher `priority`, so only its friction counts.",
    "idle_sliding": "{at} has no effect: everything that can touch these geoms has a sliding friction of {least:g} or more, and the "
    "larger friction of two geoms counts; give these geoms a higher `priority`, and theirs counts.",
    "idle_below": "{at} varies from {lowest:g}, and has no effect below {least:g}: everything that can touch these geoms has a sliding "
    "friction of {least:g} or more, and the larger friction of two geoms counts; give these geoms a higher `priority`, and theirs "
    "counts.",
    "idle_on_objects": "{at} has no effect on objects, as they have a higher `priority`, so that their friction counts.",
    "idle_sizes": "{at} does not change {names}: meshes, MJCF bodies and variants have a fixed size.",
    "idle_legs": "{at} only affects pictures: it draws legs, which touch nothing, under {names}, in addition to what the scene "
    "has there.",
}
"""The sentences, by the rules' names."""

"""Every rule that a call can break, and how `messages` says it.

Fields: `at` the argument with what it is about, `owner` whose argument it is, `label` and `Label` what it is about, `got` what
came, `got_shape` its shape, `or_none` where it may be left out; of a quantity `must`, `finite`, `between` and `one`; and the
problem's own numbers by their names.
"""

SENTENCES = {
    "said": "{text}",
    "must": "{at} must be {must}, got {got}.",
    "of_type": "{at} must be {must}, got {kind}.",
    # One argument.
    "numbers": "{at} must be numbers in a regular array, got {got}.",
    "one_of": "{at} must be one of {names}, got {got}.",
    "truth": "{at} must be true or false, got {got}.",
    "integer": "{at} must be an integer, got {got}.",
    "share": "{at} must be between 0 and 1, got {got}.",
    "text": "{at} must be a non-empty string, got {got}.",
    "vector": "{at} must be {n} finite numbers{unit}, got {got}.",
    "number": "{at} must be a finite number{unit}, got {got}.",
    "not_negative": "{at} must be >= 0{unit}, got {got}.",
    "not_zero": "{at} must not be zero.",
    "radius": "{at} must have radii > 0{unit}, got {got}.",
    "condim": "{at} must be 1, 3, 4 or 6, got {got}.",
    "seed": "{at} must be a whole number from 0 to 2^32 - 1, got {got}.",
    "worlds": "{at} must be (W,) whole numbers from 0 to 2^32 - 1, got {got}.",
    "worlds_counted": "{at} must be (W,) numbers of worlds, got {got}: range({got}) names the first {got}.",
    "many_worlds": "{at} must be at most {most:,} numbers, got {n:,}.",
    # Terms.
    "unknown_attribute": "{at}: no attribute {got} can vary{nearest}",
    "fixed": "{at}: {got} cannot vary, as {why}: {instead}.",
    "names": "{at} must be a name, a regular expression or a list of them, got {got}.",
    "no_axes": "{at} must be None, as {attribute!r} is one number, got {got}.",
    "axes": "{at} must be some of {names}, the axes of {attribute!r}, got {got}.",
    "no_pattern": "{at}: no {kind} is called {got}, nor is it a valid regular expression: {why}.",
    "no_element": "{at}: no {kind} is called {got}, as a name or a regular expression{nearest}",
    "no_bodies": "{at} must be None for {attribute!r}, as only geoms, joints, sites, cameras and lights belong to a body, got "
    "{got}{instead}.",
    "nothing_on_bodies": "{at}: no {kind} belongs to {bodies}.",
    "no_joint": "{at}: no joint is called {got}{nearest}",
    "none_can_vary": "{at}: the arena has no {kind} whose {attribute!r} can vary{why}.",
    "cannot_vary": "{at}: {attribute!r} of {kind} {name!r} cannot vary, as {why}.",
    "low_below_high": "{at}: the first number must be below the second, got {got}.",
    "low_not_above_high": "{at}: the first number must not exceed the second, got {got}.",
    "no_length": "{at} must have a length, got {got}.",
    "triangle": "{at}: no moment of inertia may exceed the sum of the other two, got {got}.",
    "other_nominal": "{at} has another {what} than the arena. `ranges.terms.{name}` is relative to the arena's number: set the "
    "same number in the arena's MJCF.",
    "no_quantity": "{at} must be one of {names}, the quantities of `vary`, got {got}.",
    "no_quantities": "{at} must be a quantity of `vary`, of which the arena has none, got {got}.",
    "edited_since": "{at}: {what} was edited after `arena.vary({name}=...)` had read it: edit first, then call `vary`.",
    "unseen_on_jax": "impl='jax' of MJX cannot vary {attribute!r} of {kind} {name!r}, as {why}: use impl='warp'{or_else}.",
    "sized_on_field": "impl='jax' of MJX cannot vary the size of {geom} (`{named}`), as it tests height field {field} only as far as the "
    "size in the MJCF reaches: use impl='warp'.",
    "varied_option": "{at}: `{name}` varies this option, starting from the value that `arena.spec.option` had when `vary` was "
    "called: set it before `vary`.",
    "stale_inertial": "`{name}` varies the {what} of geom {geom!r}, which does not change the centre of mass and the inertia of body "
    "{body!r}, as `{other}` varies its {attribute!r}: if they should, vary 'geom.density' and not {attribute!r}.",
    "idle_in_keyframe": "{at}: {got} has a `{field}`, so that body {body!r} starts there in all worlds, and `{name}`, its {attribute!r}, "
    "has no effect: leave `{field}` out of the keyframe, or start without one.",
    "scale_of_nothing": "{at}: 'scale' has no effect, as the MJCF has 0: use 'add', or leave it out.",
    "coded_workspace": "{at} cannot be encoded, as it draws places until tables fit: give `table_offsets` a distribution "
    "instead.",
    "coded_count": "{at}: a Count cannot be encoded, as it also counts objects on absent tables: use Bernoulli.",
    "point": "{at} must be ({n},) numbers, one for each that `ranges` draws, got {shape}.",
    "no_robot": "{at}: the arena has nothing that can vary whose name begins with {got}.",
    "term": "{at} must be a dr.Term, got {got}.",
    "term_name": "{at} must be a valid Python name, as it is the name of a quantity.",
    "term_taken": "{at} is taken, as {owner}: give the term another name, such as `{free}`.",
    "terms_mapping": "{at} must be a dictionary of distributions by the names of quantities, got {got}.",
    "no_body": "{at} must be {must}: no body is called {got}{nearest}",
    "no_part": "{at}: there is no part {got} with boxes, which must be added before this one{nearest}",
    "no_camera": "{at}: no camera of the arena is called {got}{nearest}",
    "no_label": "{at}: nothing in a segmentation is called {got}{nearest}",
    "twice": "{at} must be different, got {got} twice.",
    "no_terms": "{at}: the arena has no {what}; it has no quantities at all: `arena.vary` and `arena.add_part` make "
    "them.",
    "unknown_term": "{at}: the arena has no quantity {got}{nearest}",
    "other_terms": "{at} must have all quantities of `arena.vary` and `arena.add_part`, and no others: {wrong}.",
    # Tables and objects.
    "offsets": "{at} must be one (x, y, z) per table, at least one table, got {got_shape}: {got}.",
    "item": "{at} must be {one}, got {got_shape}: {got}.",
    "items": "{at} must be {one}, or one for {n_tables}, got {got_shape}: {got}.",
    "allowed": "{at} must be finite{finite} {must}, got {got}.",
    "limits": "{at} must be {between}, got {got}.",
    "legs": "{at} puts the top at z = {height:g} m. A slab {thickness:g} m thick leaves no room for legs there: with "
    "`has_legs`, z must be > {least:g}.",
    "table": "{at} must be {tables}{or_none}, got {got}{later}.",
    "on_no_table": "{at} must be a table, and the arena has none: give from_xml its `tables`, got {got}{later}.",
    "no_carrier": "{at} must be None, as the arena has neither tables nor surfaces, got {got}{later}.",
    "carrier": "{at} must be the index of a table, or one of {names}{or_none}, got {got}{later}.",
    "objects": "{at} must be a list of mjx_arenas.Object, got {got}.",
    "one_object": "{at} must be a list of mjx_arenas.Object, got the single object {name!r}: put it into a list.",
    "object": "`{path}[{i}]` must be an mjx_arenas.Object, got {got}.",
    "object_name": "An object's `name` must be a non-empty string, got {got}.",
    "named_twice": "Two objects are named {name!r}: names must differ.",
    "taken": "{owner}: the arena already has an element of that name.",
    "extents": "{at} must be one number or 3 numbers, all > 0 [m], got {got}.",
    "sphere": "{at} of a sphere must have 3 equal extents, got {got}.",
    "capsule": "{at} of a capsule must be (length, diameter, diameter) with length > diameter, got {got}.",
    "cylinder": "{at} of a cylinder must be (diameter, diameter, height), got {got}.",
    "of_file": "{at} cannot be given for an MJCF body, as its file decides it, got {got}.",
    "density_of_file": "{at} cannot be given for an MJCF body, as its file decides it, got {got}: give `mass` instead.",
    "file_without_use": "{at} needs type 'mesh' or 'mjcf', got {got}.",
    "file": "{at} must be the path of its {kind}, got {got}.",
    "no_file": "{owner}: there is no file {got}.",
    "either": "{owner}: give `{first}` or `{second}`, not both.",
    "added": "{owner}: `arena.spec` adds {names} to its body. An object of one geom may only get sites, cameras and lights: "
    "use an Object of type 'mjcf'.",
    "added_to_variants": "{owner}: `arena.spec` adds {names} to its body. An object with variants may only get sites, cameras "
    "and lights.",
    "sensor_of_absent": "{at}: {name} belongs to body {got}, which is absent in some worlds (`body.active`). There it "
    "reads the place where the body is parked, 1000 m away, and the compiled world has no such sensor: mask what it reads.",
    "lost_varied": "{at}: {names} is gone, but `arena.vary({name}=...)` varies it: do not delete or rename it.",
    "lost": "{at}: {names} of a table, an object or a part is gone: do not delete or rename it (`table_active` and `active` of "
    "an object or a part make it absent).",
    "variants": "{at} must be a list of at least one mjx_arenas.Object, each a variant, got {got}.",
    "variant": "{at} must be an mjx_arenas.Object, got {got}.",
    "limits_of_variants": "{at}: {names} makes impl='jax' keep only the deepest contacts, and absent variants would take their "
    "places: leave it out, or use impl='warp'.",
    "no_variants": "{at}: no object {got} has variants; these have: {names}.",
    "no_variant": "{at} must be one of {names}, or an index from 0, got {got}.",
    "of_variants": "{at} belongs to each variant, got {got}: give it to the objects in `variants`.",
    "of_whole": "{at} is the same for all variants, got {got}: give it to the object that has the variants.",
    "variants_again": "{at} must be None, as a variant has no variants.",
    "variant_twice": "{at}: two variants are named {got}: names must differ.",
    "variant_moves": "{owner}: its file has {names}, but a variant must be one rigid body: remove them.",
    "carrier_top": "{at} must name something with a level top, a box or an upright cylinder; {got} {what}.",
    "carrier_dropped": "{at}: {got} is dropped (`place.drop`), so nothing can stand on it.",
    "carried": "{at}: an object can stand on a table, a surface or an object before it, got {got}, which is {on}.",
    "carried_later": "{at}: {got} must come before it in the list, as an object stands on objects before it alone.",
    "pose_moves": "{owner}: `pose` needs a rigid body, but its file has {n} joints: leave out `pose`.",
    "pose_round": "{owner}: its {kind} geom {geom!r} reaches out of the hull of its boxes and meshes, so its resting poses "
    "cannot be computed: use a mesh instead, or leave out `pose`.",
    "pose_of_variant": "{at} must be below {n}, as {of} has {n} {poses}, got {got}.",
    "no_poses": '{at}: no object {got} has `pose="resting"`; these have: {names}.',
    "ghost": "{owner}: none of the geoms in its file collides, so it cannot stand on a table.",
    "frictions": "{owner}: the geoms of its file differ in friction: give the object one `friction`.",
    "mass_rules": "{owner}: {names} in its file would change its mass, which parameters decide: switch it off.",
    # One world.
    "follow_short": "Geom {geom!r}, which follows table {table} (`follow`), would have a negative length: raise or enlarge the "
    "table.",
    "table_number": "{at} must be from 0 to {most}, got {got}.",
    "shape_sphere": "{at} must be 3 equal extents (a sphere), got {got}.",
    "shape_capsule": "{at} must be (length, diameter, diameter) with length > diameter (a capsule), got {got}.",
    "shape_cylinder": "{at} must be (diameter, diameter, height) (a cylinder), got {got}.",
    "of_variant": "{at} must be {wanted}, as of its variant {variant!r}, got {got}: `arena.with_variants(params, {name}={variant!r})` "
    "gives all of its numbers.",
    "as_in_file": "{at} must be {wanted}, as in its file, got {got}.",
    "light": "{at}, {mass:g} kg, is too light for its size: each moment of inertia must be >= {least:g} kg m^2.",
    "larger": "{owner} is {size} m, larger than {below}, which is {top} m.",
    "absent": "`params`: {label} is absent, but {why}.",
    "overlap": "{Label} overlap by {across:.3g} m horizontally and {height:.3g} m vertically: moving them apart by either "
    "distance ends this.",
    "parts_overlap": "{first} and {second} overlap, {pair}by {across:.3g} m horizontally and {height:.3g} m vertically: moving "
    "them apart by either distance ends this.",
    "fixed_overlap": "{first} and {second} overlap by {depth:.3g} m.",
    "out_of_reach": "Part {name!r} is {away:.3g} m away from {near}, instead of {allowed} m.",
    "below_floor": "Part {name!r} stands {depth:.3g} m below the floor.",
    "limits_meet": "The `margin` of {name} is more than half of its `range`: MJX holds only one of its limits at a time.",
    "no_table": "No table is present.",
    "outside": "{Label} is not inside the workspace, {low} to {high} m.",
    "gap": "{Label} are not apart by the workspace's gap of {gap} m.",
    "order": "`ranges` has a lower bound above its upper bound, or invalid probabilities.",
    "no_place": "Object {name!r} finds no free place, and starts above the other objects.",
    "none_valid": "{at} gives no valid world: none of the {n} that were drawn is. {why}.",
    "meant_relative": "{at} is between {least:.3g} and {most:.3g}, far from the nominal {nominal:.3g}: `relative={relative!r}` may "
    "be meant.",
    "far_from_table": "{at} leaves the robot {gap} m from {table}, on which it was put: {at} is in the frame of the middle of its top.",
    "one_for_all_axes": "{at} gives x, y and z {of}one range, from {least:.3g} to {most:.3g} {one}: give three numbers, `axes` of the "
    "term, or `relative='add'`.",
    "precision": "{at} are invalid once rounded to single precision.",
    # Arrays: parameters, keys, models.
    "params": "{at} must be an mjx_arenas.ArenaParams, got {kind}.",
    "params_of": "{at} must be an mjx_arenas.ArenaParams, got {kind}: give its `params`.",
    "params_called": "{at} must be an mjx_arenas.ArenaParams, got a {kind}: call it, as in arena.nominal_params().",
    "one_world": "{at} must be of one world, got {of}: {instead}.",
    "worlds_of": "{at} must be of the {n} worlds of {whose}, got {of}.",
    "of_many_worlds": "{at} must be of many worlds, (W, ...), got one: jax.tree.map(lambda x: x[None], params) adds the axis.",
    "same_worlds": "{at} must be (W, ...) of the same W worlds in every field, got {names}.",
    "no_world": "{at} must have at least one world, got none.",
    "shape": "{at} must have shape {want}, got {shape}.",
    "dtype_bool": "{at} must be true or false, got {dtype}.",
    "dtype_int": "{at} must be whole numbers, got {dtype}.",
    "dtype_float": "{at} must be numbers, got {dtype}.",
    "key": "{at} must be a key such as jax.random.key({seed}), got {got}.",
    "key_numbers": "{at} must be a key such as jax.random.key(0), got numbers of {got_shape}.",
    "key_impl": "{at} must be of JAX's {must}, with which worlds are independent of each other, got {kind}.",
    "one_key": "{at} must be one key, of one world, got shape {shape}: use jax.vmap, or randomize.",
    "keys": "{at} must be an array of keys such as jax.random.split(key, n_worlds), got {got}.",
    "one_each": "{at} must be one for each of the {n} {what}, got {came}.",
    "no_key": "{at} must be at least one key, of one world, got none.",
    "raw_keys": "{at} must be keys such as jax.random.split(key, n_worlds), or raw keys, uint32 of shape (W, 2), got {dtype} "
    "of shape (W, {n}).",
    "keys_shape": "{at} must be one key per world, shape (W,) or, of jax.random.PRNGKey, (W, 2), got shape {shape}.",
    "model": "{at} must be an mjx.Model, from put_model(), got {kind}.",
    "batched_model": "{at} must be of one world, got one with batched leaves: randomize and apply start from put_model().",
    "other_sizes": "{at} must come from this arena's put_model() ({wanted}), got the model of another arena ({kind}).",
    "other_names": "{at} must come from this arena's put_model(), got the model of another arena, which has {got} for "
    "{wanted!r}.",
    # Ranges.
    "distribution": "{at} must be a distribution such as Uniform(low, high), or None, got {got}.",
    "workspace": "{at} must be a Workspace(low, high, gap), or None, got {got}.",
    "no_objects": "{at}: the arena has no objects.",
    "no_tables": "{at}: the arena has no tables.",
    "boolean": "{at}: true and false need Bernoulli, Count, Choice or Fixed.",
    "boolean_relative": "{at}: true and false cannot be relative, got relative={got}.",
    "not_boolean": "{at}: {dist} draws true or false; only {names}, and terms such as `body.active`, can use it.",
    "indices": "{at}: indices need Choice or Fixed, which cannot be relative.",
    "relative": "{at} must be 'add' or 'scale'{or_none}, got {got}.",
    "tied": "{at} must be true, false, a tuple with one of them for each axis, or 'axes' if there are several axes, got {got}.",
    "are_numbers": "{at} must be numbers, got {got}.",
    "are_indices": "{at} must be {what}, got {got}.",
    "finite": "{at} must be finite, got {got}.",
    "whole_numbers": "{at} must be whole numbers, got {got}.",
    "broadcast": "{at} must be {allowed}, got {got_shape}.",
    "ordered": "{at} must be <= `high`, got {low} and {high}.",
    "positive": "{at} must be > 0, got {got}.",
    "at_least_0": "{at} must be >= 0, got {got}.",
    "values": "{at} must be (N,) or (N, 3), got {got_shape}.",
    "empty": "{at} must have at least one value, got none.",
    "probabilities": "{at} must be {n} probabilities that add up to 1, got {got}.",
    "counts": "{at} and `high` must be whole numbers >= 0, got {low} and {high}.",
    "count_high": "{at} must be at most {most}, got {got}.",
    "corners": "{at} and `high` must be (x, y) with low < high, got {low} and {high}.",
    "workspace_gap": "{at} must be one number >= 0 [m], got {got}.",
    "reach_allowed": "{at} can reach {got}: it must stay {must}.",
    "reach_limits": "{at} can reach {got}: it must stay {between}.",
    "reach_legs": "{owner} can put the top of {label} at z = {height:g} m. A slab {thickness:g} m thick leaves no room for "
    "legs there: keep z > thickness / 2, or give `has_legs` a distribution that is always false.",
    "reach_no_table": "{at} leaves no table in any world.",
    "reach_table": "{at} must be indices from 0 to {most}, got {low} to {high}.",
    "reach_capsule": "{at} can reach a length of {length:g} m and a diameter of {diameter:g} m: a capsule must be longer than "
    "it is thick.",
    "can_be_absent": "`{path}`: {label} can be absent, but {why}.",
    # Robots, other arenas, scenes, tiles.
    "free_joint": "{at}: {body} has a free joint and would not follow the table: make it an Object of type 'mjcf', or attach "
    "it to the world.",
    "shared_name": "{at}: {who} refers to {what}. Both arenas have an element of that name, and this arena's is kept: remove "
    "the reference, or rename the {kind}.",
    "options": "{at} must be {known} or None, got {got}.",
    "no_robot_known": "{at}: no known robot is called {got}{nearest}",
    "no_package": "{at}: {got} comes with the package {package}, which is not installed: {install}.",
    "no_robot_file": "{at}: {got} needs {file} of the package {package}, but the installed version lacks it: {install}.",
    "no_option": "{at}: MuJoCo has no option {got}{nearest}",
    "collision": "{at} must be one of {names}, or a dictionary of these by names or regular expressions, got {got}.",
    "adopted": "{at} must be a list of names of bodies or geoms, at least one, got {got}.",
    "adopted_twice": "{at}: {which} name the same slab, that of {name!r}, which can be only one table.",
    "adopted_inside": "{at}: {name!r} is attached to body {body!r}, which belongs to the table {other!r} and would move it: "
    "leave out one of the two.",
    "adopted_again": "{at}: {name} is listed {times}.",
    "adopted_unknown": "{at}: {name!r} is neither a body nor a geom of the scene{nearest}",
    "adopted_boxes": "{at}: {name!r} has {what}, and exactly one must be its slab: give that geom's name. Its geoms: {known}.",
    "adopted_kind": "{at}: {name!r} is a {kind}, and the slab of a table must be a box.",
    "adopted_masks": "{at}: the slab of {name!r} has contype {contype} and conaffinity {conaffinity}, so objects would fall "
    "through it: one of the two needs the bit 1.",
    "adopted_moves": "{at}: table {name!r} must be fixed to the world, but {body} moves it.",
    "adopted_tilted": "{at}: the slab {name!r} is tilted; one of its sides must point up.",
    "follow": "{at} must be a sequence of mjx_arenas.Follow, got {got}.",
    "follow_unknown": "{at}: the scene has no geom {name!r}; on the bodies of tables are: {known}.",
    "follow_again": "{at}: geom {name!r} is listed twice.",
    "follow_slab": "{at}: geom {name!r} is the slab of a table itself.",
    "follow_kind": "{at}: geom {name!r} is a {kind}, which has no ends.",
    "follow_moves": "{at}: geom {name!r} must be fixed to the world to follow a table, but {body} moves it.",
    "follow_table": "{at}: geom {name!r} is on no table's body: give the `table` that it follows, one of {known}.",
    "follow_nothing": "{at}: geom {name!r} already moves with table {table!r}: give the `x`, `y` or `z` along which it should "
    "follow an edge.",
    "follow_turned": "{at}: geom {name!r}, a {kind}, cannot grow along the slab's {axis} axis: {why}.",
    "scene_unknown": "{owner}: the scene has no body of that name; its free bodies: {known}.",
    "scene_other": "{owner} is a body of another arena's scene: give its name to the `from_xml` of a scene that has it.",
    "scene_fixed": "{owner}: the body has no free joint, which an object must have; the free bodies of the scene: {known}.",
    "scene_pose": "{at} must be 'upright', as a body of the scene keeps the pose it has there: only objects that the arena "
    "adds have resting poses.",
    "scene_variants": "{at} must be None, as a body of the scene is the same in every world: only objects that the arena adds have them.",
    "as_in_scene": "{at} cannot be given for a body of the scene, as the scene decides it, got {got}.",
    "scene_ghost": "{owner}: none of its geoms collides, so it cannot stand on a table.",
    "scene_frictions": "{owner}: its geoms differ in friction: give Object({name!r}, 'scene', friction=...) one for all.",
    "scene_no_table": "{owner} stands on none of `tables`: below the middle of its lowest side, at ({place}), is {why}.",
    "scene_table": "{at} must be {name!r}, on which it stands in the scene, or left out, got {got}.",
    "scene_through": "{owner} would fall through table {name!r}, as none of its geoms collides with the slab: change their "
    "`contype` and `conaffinity`.",
    "table_moves": "{at}: body {name!r} must be a fixed child of the world, without a frame, to serve as a table.",
    "table_part": "{at}: {name!r} must belong to body {body!r} to be a part of that table.",
    "tilted_plane": "Geom {name!r} is an endless plane that is not level and would cut through all tiles: make it a box.",
    "shared_plane": "`arena.spec`: {who} refers to plane {name!r}, but all tiles share one such plane: make it a box.",
    "mjcf": "{at} must be a path, MJCF text or a mujoco.MjSpec, got {got}.",
    "spec_and_more": "{at} must be one mujoco.MjSpec, got a tuple that begins with one: `simplify` gives a spec and a report, as in "
    "`spec, report = simplify(...)`.",
    "no_mjcf": "{at}: there is no file {got}.",
    "named_robot": "{at}: there is no file {got}. `mja.robots.load` finds robots of installed packages by their names.",
    "no_root": "{at}: the text is not MJCF, as its root is not <mujoco>.",
    "unread": "{at}: MuJoCo cannot read {what}: {text}",
    "uncompiled": "{at}: MuJoCo cannot compile it: {text}",
    "unattached": "{at}: MuJoCo cannot attach it: {text}",
    "clash": "{at}: the arena already has {names}: give another `prefix`.",
    # Scores of tasks.
    "score_reward": "{at} must give one number as reward, got {got_shape}.",
    "score_end": "{at} must return one bool that says whether the episode ends, got {kind}.",
    "score_metrics": "{at} must give metrics as a dict of numbers by name, got {kind}.",
    "score_success": "{at} must have 'success', 0 or 1, among its metrics, got {known}.",
    "score_metric": "{at} must give one number as metric {name!r}, got {got_shape}.",
    "score_reserved": "{at} must not give a metric {name!r}: the environment has one of that name.",
    # Calls at the wrong time.
    "compiled_already": "{at}: the arena is compiled already: {do} before the first use of the model.",
    # Warnings.
    "left_out_of_preset": "{at}: the preset leaves out {left}.",
    "left": "{at} varies table {table!r}, on which the free {which} of the scene {stay}: name {them} among the `objects` of "
    "from_xml, which follow their table.",
    "start_inside": "{first} and {second} start {depth:.3f} m inside each other at their nominal places; {free}.",
    "geoms_inside": "{where}: geoms are inside each other: {told}.{lost} Keep them apart, or leave out their contacts: "
    "`arena.spec.add_exclude(bodyname1={first!r}, bodyname2={second!r})`, or <exclude> in the MJCF.",
    "out_of_range": "{where}: joints start outside of their ranges: {told}.",
    "tables_overlap": "Tables {first!r} and {second!r} overlap by {across:.3g} m horizontally and {height:.3g} m vertically: "
    "moving them apart by either distance ends this.",
    "part_overlaps": "{first} and {second} overlap, {pair}by {across:.3g} m horizontally and {height:.3g} m vertically: this "
    "is taken to be intended in every world.",
    "fixed_overlaps": "{first} and {second} overlap by {depth:.3g} m: this is taken to be intended in every world.",
    "part_larger": "Part {name!r} is {size} m, seen from above, larger than {below}, on which it stands, and which is {top} m: this is "
    "taken to be intended in every world.",
    "sinks": "Part {name!r} stands {depth:.3g} m below the floor: this is taken to be intended in every world.",
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
    "for its outline of {size} m.",
    "many_reported": "Something is reported of {n} of the {of} worlds, most often that {why} ({most}). The shares therefore say little "
    "about the policy; {do}.",
    "too_wide": "{at} {can} {size} m, seen from above, and the gripper takes at most {width:g} m: `invalid_arena` reports such episodes.",
    "slips": "{at} is a pyramid, with which a held object slips by millimetres a second: `arena.spec.option.cone, "
    "arena.spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10` before the task is made, or `options: {{cone: 1, impratio: 10}}` in "
    "the arena's file.",
    "never_reached": "{at}: {what} is out of the arm's reach {when}. It is on {surface}, which is {near:.2f} to "
    "{far:.2f} m from the arm's base, seen from above, and {height} the base. The tool goes to places {least:g} to {most:g} m away, from "
    "{from_} to {to} the base.{lift} `invalid_arena` reports such episodes. `on` and `pos` say where the arm stands.",
    "front_unreached": "{at}: the arm does not reach behind the front of {drawer!r} {when}. That is {near:.2f} to {far:.2f} m from its "
    "base, seen from above, and {height} it. `invalid_arena` reports such episodes. `on` and `pos` say where the arm stands.",
    "sinks_or_floats": "{at} lets {upper} {does}, on which it stands, as its place stays: vary its `{place}`, too, or make it an Object, "
    "which stands on what carries it.",
    "no_range": "{at} varies nothing, as `ranges.terms` has no range {name!r}.",
    "falling": "{at}: episodes start before what is dropped (`place.drop`) has come to rest: {names}. With "
    "`config_overrides={{'settled': 1024}}` they start in worlds in which it has.",
    "degrees": "{at} has angles of up to {most:g} rad, more than a turn: angles are in radians (90 degrees are 1.571).",
    "radians": "{at} has angles of at most {most:.3g} degrees: these angles are in degrees ({most:.3g} rad are {degrees:.3g}).",
    "milliseconds": "{at} is up to {most:g} s: time steps are in seconds (2 ms are 0.002).",
    "centimetres": "{at} is up to {most:g} m, {times:,.0f} times the nominal {nominal:.3g} m: lengths are in metres (5 cm are 0.05).",
    "other_options": "{at} has other options than the arena. The arena's are used: {names}.",
    "changing_options": "{at} changes options of the whole arena: {names}; {tell}.",
    "options_since": "{at}: {names} changed since the last `put_model`. Existing templates and batches keep the old values, "
    "and newly compiled worlds have the new ones.",
    "idle_friction": "{at}: torsional and rolling friction have no effect with table_condim={condim}.",
    "idle_rolling": "{at}: rolling friction has no effect with table_condim={condim}.",
    "idle_scale": "{at}: relative='scale' has no effect, as the nominal number is 0: use relative='add'.",
    "idle_objects": "{at} has no effect on tables, as the table's friction counts: table_priority=0 takes the larger of the "
    "two.",
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
    # Files.
    "empty_file": "it is empty, and it must have `arena` and `ranges`, by name.",
    "no_parts": "it must have `arena` and `ranges`, by name.",
    "part_missing": "{at} is missing.",
    "node_twice": "{at} is given twice.",
    "node_name": "{at} must be {what} of the arena or its number, got {got}{nearest}",
    "node_unknown": "{at} is not {what}{nearest}",
    "node_of_terms": "{at} must stand under `ranges.terms`, as all quantities of furniture do.",
    "node_in_name": "{at} must be the arguments of {name} by name, without `{name}:` before them.",
    "node_in_argument": "{at} must be {{{name}: {{{kind}: ...}}}}, got {json}.",
    "node_lacks": "{at} lacks `{name}`.",
    "no_type": "{at} has no `type`{nearest}",
    "type_unknown": "{at}: {got} is unknown{nearest}",
    "call_list": "{at} must be a list of {names}, got {json}.",
    "options_by_name": "{at} must be MuJoCo's options, by name, got {json}.",
    "quantities": "{at} must be quantities, by name, got {json}.",
    "call_values": "{at} must be {form}, got {json}.",
    "null": "{at} is null: give it a value.",
    "null_optional": "{at} is null: give it a value, or leave it out.",
    "value": "{at} must be a value or a list of values, got {json}.",
    "list": "{at} must be a list, got {json}.",
    "named_call": "{at} must be a {kind} such as {{{example}: ...}}, got {json}.",
    "other_kind": "{at} is not a {kind}: write one as {{{example}: ...}}.",
    "unwritable": "{at} is a {kind}, which cannot be written to a file: give numbers, or the path of a file.",
    "unwritable_pixels": "{at} has pixels of its own, which cannot be written to a file: give one of mjx_arenas.textures.",
}
"""The sentences, by the rules' names."""

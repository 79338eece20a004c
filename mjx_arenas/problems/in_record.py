"""What the rules say that only `record` and `terms` have: why an arena cannot be compiled; `sentences` explains the fields."""

IN_RECORD = {
    # What the compiler, or MJX, would do behind the parameters' back.
    "pixels_in_data": "{at}: texture {got} has its pixels in `data`, which MJCF cannot hold: write them into a file, and give the texture "
    "this `file`.",
    "compiler_removes": "{at}: fusestatic and discardvisual would remove bodies and geoms that worlds may need: switch them off.",
    "compiler_weighs": "{at}: {names} would change the masses of objects, which parameters decide: switch them off, and give an <inertial> "
    "to each body of the MJCF that needs them.",
    "compiler_weighs_all": "{at}: {names} would make the masses of all bodies follow from `{varied}`: switch them off.",
    "bounds_of_masses": "{at}: body {body!r} has {bounds} from the <compiler> of its MJCF, which would change masses that `{name}` "
    "decides: set it to 0 there.",
    "texture_files": "{at}: texture {got} would have another file in other worlds, which share the pixels of all textures: leave its "
    "`file`, `cubefiles` and `data` alone, and vary `material.texture`.",
    "tied_armature": "{at}: the armature of {got}, which ends where a table or an object stands, would make inverse weights stale in other "
    "worlds: leave it at 0.",
    "many_outputs": "{at}: {got} has several controls or outputs, whose accelerations at rest would be stale in other worlds: take an "
    "actuator for each.",
    "geom_of_variant": "{at}: {what} needs geom {got}, which is of a variant and not there in all worlds: take a site or the body.",
    "carrier_moved": "{at}: {got}, on which table {table!r} hangs, was moved since `from_xml`: move it in the scene before.",
    "tied_body": "{at}: body {got} cannot come and go (`body.active`), as {name} ties it.",
    "wrapped_aside": "{at}: in other worlds {got} would pass {geom} elsewhere, and MJX computes the side of its `sidesite` differently "
    "from MuJoCo: wrap a sphere, or leave out the `sidesite`.",
    # The proof.
    "decided": "{at}: {names} of a table{part} or object was edited, which parameters decide: give it as an argument of {maker}{of_part} "
    "or of Object.",
    "stale": "{at}: {element} would be stale in other worlds: it follows from {quantities}{of}, and {why}.",
    "stale_left": "{at}: {field} of what is present would differ where other tables or objects are absent, because the compiler derives it "
    "from them: give it explicit numbers.",
    "stale_statistic": "{at}: stat.{name} would be stale where something is absent, and {why}.",
    "term_writes": "Term {got} writes another number to {where} than its `edit` gives.",
    "terms_both": "Terms {got} and {other!r} both decide {where}: leave it to one of them.",
    "term_of_arena": "Term {got} must leave out {where}, which is of the arena's {whose}: they vary by ArenaRanges({begins}=...).",
    "inertia_of_object": "Term {got} must leave out {where}, which is of the arena's objects: it follows from their masses and sizes "
    "(object_masses, object_full_sizes), and cannot vary alone.",
    "place_of_object": "Term {got} must leave out {where}, which is of the arena's objects: `make_data` places them by keys, "
    "as their `place` says.",
    "term_boxes": "The `boxes` of term {got} give {where} another extent than the compiler.",
    "record_pickled": "What an arena was compiled to cannot be pickled, because MJCF keeps only six digits: mjx_arenas.save keeps the "
    "arena, and arena.batch(model, params) makes a batch again of its `params`.",
}
"""The sentences, by the rules' names."""

"""What the rules say that only `checks`, `preflight` and `files` have; `sentences` explains the fields."""

IN_CHECKS = {
    # Checks of worlds, and bundles of those that fail.
    "contacts_of_engine": "{at} must be None with engine={engine!r}, which drops none, got {got}.",
    "n_worlds_or_worlds": "Give `n_worlds` or `worlds`, not both.",
    "world_fails": "{at} must be one that fails, got {got}, in which nothing is wrong.",
    "no_picture": "There is no picture of this world: MuJoCo does not compile it.",
    "no_bundle_here": "{got} is there already and is no bundle: choose another folder.",
    "no_bundle": "{got} {what}: give a folder that `check` or `save_bundle` wrote.",
    "bundle_lacks": "Folder {got} is no bundle of a failed world: {file} is missing{inside}.",
    "damaged": "{file!r} is not what `check` wrote: {why}.",
    # Randomized models.
    "model_swapped": "{at} must be the model that the randomizer returned, got {got}: is it swapped with `in_axes`?",
    "no_such_world": "{at}: world {got} is none of {count}, 0 to {most}.",
    "compiled_by_number": "{at} must be a dict by the numbers of worlds: `model` has {n}; got {got}.",
    "compiled_has": "{at}{of} has {element}, which `model` lacks: it is another arena's.",
    "compiled_lacks": "{at}{of} lacks {element}, which is there in `model`.",
    # Files.
    "not_made": "{at} was not made by MultiTableArena, TableArena or Arena.from_xml: its spec cannot be written.",
    "edited_past_mjcf": "{at} is not what its arguments make, since `arena.spec` was edited or one of its files has changed, and MJCF does "
    "not hold the edit: make it in an MJCF file, and give that as `xml` or to `attach`.",
    "edited_past_calls": "{at}: `arena.spec` was edited before a term read the same numbers, which the calls in the file would read "
    "without the edit: make it in an MJCF file or a spec, and give that as `xml` or to `attach`.",
    "file_is_folder": "{got} is a folder: give a {suffixes} file.",
    "file_suffix": "{got} must end in {suffixes}.",
    "file_is_mjcf": "{got} must end in {suffixes}: a file shows an MJCF as `arena: {{type: Arena.from_xml, xml: {name}}}`.",
}
"""The sentences, by the rules' names."""

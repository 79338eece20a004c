"""What the rules say that only `sim`, `twin` and `write` have, and the four modules of `Arena`; `sentences` explains the fields."""

IN_SIM = {
    # Worlds and their data.
    "known_index": "{at} must be known numbers, got {got}: inside of jax.jit, index each array, as in "
    "jax.tree.map(lambda x: x[i], batch.params).",
    "many": "{at} must be of many worlds, (W, ...) with the same W in all arrays.",
    "many_not_batch": "{at} must be of many worlds, (W, ...) with the same W in all arrays, got {got}: take its `world(i)`.",
    "where_stepped": "{at} must be made with make_data(batch) where it is stepped, on {n_shards} device(s), got data of worlds on {got}: "
    "Warp keeps the contacts of each device's worlds together (within jax.jit, the mesh must have explicit axes to be seen).",
    "wide": "{at} must be {wanted}, as `jax_enable_x64` says now, got {got}: make the model, the batch and the data anew.",
    "batch_and_data": "`batch` and `data` must be an ArenaBatch and its mjx.Data, got {got}.",
    "impl_of_model": "{at} must have the model's impl={wanted!r}, got impl={got}.",
    "devices_of_batch": "{at} must be on the batch's devices {wanted}, as from make_data(batch), got data on {got}.",
    "control_shape": "{at} must have shape (n_steps, W, nu), here {each}, or (n_steps, nu), here {same}, got {got}.",
    "control_given": "{at} must give the ctrl of all worlds, (W, nu), here {wanted}, got {got}.",
    "key_with_data": "{at} must be None with `data`, in which the objects have their places.",
    "keyframe_with_data": "{at} must be None with `data`, which has a state.",
    "place_static_one": "`place_static` takes one world: jax.vmap(mja.place_static, in_axes=(batch.in_axes, 0))(batch.model, data).",
    "traced_for_one": "make_world_data was traced for one world before jax.vmap came to it, and so has no room for the contacts of all "
    "worlds on impl='warp'. Write jax.jit(jax.vmap(make_world_data)), not jax.vmap(jax.jit(make_world_data)), or pass `n_worlds`.",
    # What MJX can simulate.
    "no_warp": "impl='warp' needs warp-lang: pip install 'mjx_arenas[warp]'.",
    "sleeping": "{at}: bodies can sleep in compiled worlds alone, not in many at once: clear the bit mjENBL_SLEEP, or leave `sleep` "
    "out of the MJCF's <flag>.",
    "no_collision_function": "impl='jax' has no collision function for geoms {both}: use impl='warp', other shapes, or "
    "contype/conaffinity.",
    "field_contacts": "impl='jax' of MJX loses contacts of geom {geom} ({kind}) with height field {field}: use impl='warp', spheres and "
    "capsules, or contype/conaffinity.",
    "otherwise": "impl={got} of MJX {does}.",
    "not_simulated": "impl={got} of MJX does not simulate what is in the arena, {what}: {flag}use {warp}C MuJoCo (`c_world`, `c_batch`).",
    "no_freedom": "MJX cannot step a model without a degree of freedom: give the arena `objects=`, or add a joint to `arena.spec`.",
    # What follows from a model.
    "set_const_impl": "`set_const` needs a model of impl 'jax' or 'warp', got {got}.",
    "set_const_one": "`set_const` takes one world, got {got} of many: jax.vmap(mja.set_const, in_axes=(batch.in_axes,))(batch.model).",
    "set_const_flexes": "`set_const` does not derive the fields of flexes; the model has {got}.",
    "set_const_fluid": "`set_const` cannot derive `geom_fluid` of ellipsoids, which worlds share.",
    "set_const_kind": "`set_const` does not know {field} {got}.",
    "roots": "{at} must be first moving bodies on the static world, {known}; got {got}.",
    # Arenas.
    "starts_left": "{at}: start states vary ({left}), and a randomization_fn makes models alone, so they have no effect. Draw them in the "
    "`reset` of the environment. For other zeros of joints, such as of encoders, vary 'joint.ref'.",
    "nothing_varies": "{at} gives no quantity a distribution: there is nothing to randomize.",
    "stale_model": "{at} must have the nominal parameters where `ranges` varies nothing, as from put_model(), got other {got}: give "
    "them to the arena, or as Fixed ranges.",
    "other_model": "{at} has another {got} than put_model() gave, from which statistics and cameras are derived in closed form: change "
    "it in the randomized model, and call mja.set_const.",
    "arena_pickled": "An arena cannot be pickled, because MJCF keeps only six digits: mjx_arenas.save writes how it was made to a file.",
    "spec_changed": "{at} changed after the arena was compiled: make all additions before the first use of the model.",
    "mj_model_changed": "{at}: {names} changed after the arena was compiled, without effect on its worlds: edit `arena.spec` before the "
    "first use of the model (options, `mj_model.opt`, may change).",
    "merged_quantities": "{at} has quantities of `add_part` or `vary`, which cannot be merged: merge first, then vary, and add the parts "
    "to the merged arena, at their places there.",
    "second_arena": "{at}: this world already has an arena, and holds one only: add its tables to the first.",
}
"""The sentences, by the rules' names."""

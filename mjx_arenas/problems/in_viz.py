"""What the rules say that only `viz` and `pixels` have; `sentences` explains the fields."""

IN_VIZ = {
    # Pictures and films with C MuJoCo.
    "film_steps": "{at} varies, and a film needs steps of one length, got {least:g} to {most:g} s: film one world at a time, or give it a "
    "Fixed range.",
    "mp4": "{at} must end in '.mp4', got {got}.",
    "no_screen": "MuJoCo's viewer needs a screen, and {which}; arena.render draws pictures without one.",
    "no_gl": "Pictures cannot be drawn: {why}.",
    "names_of_kind": '{at} go with kind="segmentation", got kind={got}.',
    "one_camera": '{at} must be of one camera, got {got}: give pictures["{camera}"].',
    "picture_without": "{at} has no {got}: its renderer gives it with arena.renderer(..., {got}=True).",
    "outside_jit": "{at} is traced: call this outside jax.jit, vmap and scan.",
    "pixels": "{at} must be {must}, got {dtype} of shape {got}{instead}.",
    "megapixels": "{at} must be of at most {most:g} million pixels side by side, got {got}: give fewer worlds.",
    "circles": "{at} must be one radius, or ((x, y), radius) for each circle [m], got {got}.",
    # Pictures on the device.
    "renderer_flexes": "The renderer does not draw flexes, of which the arena has {got}.",
    "draws_nothing": "`rgb`, `depth` and `segmentation` are all false: the renderer would give nothing.",
    "draws_nothing_of": "`rgb`, `depth` and `segmentation` leave out camera {got}, which would give nothing: leave it out of `cameras`.",
    "renderer_warp": "Pictures on the device need MuJoCo Warp: pip install 'mjx_arenas[warp]'.",
    "a_camera": "{at} must name one camera at least, of {known}.",
    "shadows_vary": "{at} is false, but {name!r} varies which lights cast them: set it true.",
    "textures_vary": "{at} is false, but {name!r} varies textures: set it true.",
    "cube_texture": "Material {material!r} has the cube texture {texture!r}, which the renderer draws wrong: give the texture "
    'type="2d", or the renderer textures=False.',
    "cube_texture_varies": '{name!r} may choose the cube texture {texture!r}, which the renderer draws wrong: give the texture type="2d", '
    "or the renderer textures=False.",
    "one_device": "{at} must be on one device: draw in a process for each device (docs/scaling.md).",
    "batch_of_renderer": "{at} is of another arena than the renderer.",
    "world_of_renderer": "`model`, `params` and `data` must be an mjx.Model, ArenaParams and mjx.Data, got {got}.",
    "no_gradient": "Pictures have no gradient, but what is drawn depends on what is differentiated: draw `jax.lax.stop_gradient` of the "
    "batch and of the data.",
    "room_for_pictures": "Pictures of {n:,} worlds need {need:.3g} GB, and the device has {has:.3g} GB: draw fewer worlds, cameras or "
    "pixels at a time.",
    "room_for_rays": "The ray caster needs {need:.3g} GB for {n:,} worlds, and the GPU has {has:.3g} GB beside what JAX holds: draw fewer "
    "worlds or pixels at a time, or set a smaller XLA_PYTHON_CLIENT_MEM_FRACTION before JAX starts.",
}
"""The sentences, by the rules' names."""

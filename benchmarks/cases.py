"""The cases: what is measured, at which sizes, against what, and what it should be."""

from benchmarks.case import SIZES, Case

ONE_OF_EACH = {"jax": 4, "warp": 4}
GPU = {"warp": 8192, "jax": 8192}
ROOMS = ("workshop", "warehouse", "living_room", "benchmark")
CPU = {"jax": 256, "warp": 64}

_KINDS = ("primitives", "meshes")
_FAST = ("as_it_is", "fast")
_ALL_ARMS = {
    "names": ("panda", "ur5e", "ur5e_2f85", "yam", "xarm7"),
    "hows": ("as_it_is", "hull", "primitive", "fast"),
    "on_device": _FAST,
    "impl": "warp",
}

# Most important first, but `most_worlds` before all: its children need the memory that the others take and keep.
CASES = (
    Case(
        "most_worlds",
        "memory:most_worlds",
        "worlds that fit on one GPU: made, placed and stepped",
        {
            "tiny": {"impl": "jax", "start": 2, "limit": 4, "bisections": 1, "seconds": 60},
            "gpu": {"impl": "warp", "start": 262144, "limit": 2**21, "bisections": 2, "seconds": 200},
        },
        by=("impl",),
    ),
    Case(
        "randomize",
        "writing:randomize",
        "sampling and writing the batched leaves of the model, 3 tables",
        {
            "tiny": {"impl": "jax", "worlds": (4,)},
            "cpu": {"impl": "jax", "worlds": (1024, 8192, 32768, 131072)},
            "gpu": {"impl": "warp", "worlds": (1024, 8192, 32768, 131072, 1048576)},
        },
        against="a plain device copy of the same bytes (share = copy / randomize)",
        by=("worlds",),
        targets={"131072.share": (">=", 0.4), "1048576.share": (">=", 0.7)},
    ),
    Case(
        "recompile",
        "rivals:recompile",
        "arenas a second at the best batch size",
        {
            "tiny": {"impl": "jax", "worlds": (4,), "recompiled": 3},
            "cpu": {"impl": "jax", "worlds": (1024, 8192, 32768), "recompiled": 300},
            "gpu": {"impl": "warp", "worlds": (131072, 1048576), "recompiled": 300},
        },
        against="a fresh MjSpec and MuJoCo's compiler, one core",
        targets={"times_recompiling": (">=", 5e5)},
    ),
    Case(
        "terms",
        "terms:terms",
        "sampling and writing thirty quantities of an arm and its arena",
        {
            "tiny": {"impl": "jax", "worlds": 4, "light_worlds": 4, "n_steps": 2},
            "cpu": {"impl": "jax", "worlds": 64, "light_worlds": 1024, "n_steps": 5},
            "gpu": {"impl": "warp", "worlds": 8192, "light_worlds": 131072, "n_steps": 100},
        },
        against="a step of the same worlds (in_steps); of what leaves weights alone a device copy of the same bytes (light_share)",
        by=("worlds",),
        targets={"*.in_steps": ("<=", 3.0), "*.light_share": (">=", 0.5)},
    ),
    Case(
        "terms_kernels",
        "terms:kernels",
        "time on the GPU of what leaves weights alone, with parts left out",
        {
            "tiny": {"impl": "jax", "worlds": 4},
            "gpu": {"impl": "warp", "worlds": 131072},
        },
        against="a device copy of the same bytes (share)",
        by=("without",),
    ),
    Case(
        "terms_episodes",
        "when_needed:of_terms",
        "steps of an environment whose episodes each draw thirty quantities of an arm, against one that never draws (speed_share)",
        {
            "tiny": {"impl": "warp", "worlds": 4, "length": 4, "substeps": 1},
            "cpu": {"impl": "warp", "worlds": 64, "length": 20, "substeps": 5},
            "gpu": {"impl": "warp", "worlds": 8192, "length": 100, "substeps": 5},
        },
        by=("ends",),
        targets={"*.speed_share": (">=", 0.98)},
    ),
    Case(
        "kitchen",
        "kitchen:kitchen",
        "drawing and stepping a kitchen of forty boxes and eight objects",
        {
            "tiny": {"impl": "jax", "worlds": 4, "n_steps": 2, "agree_steps": 2, "recompiled": 2},
            "cpu": {"impl": "warp", "worlds": 64, "n_steps": 10, "agree_steps": 5, "recompiled": 50},
            "gpu": {"impl": "warp", "worlds": 8192, "n_steps": 100, "agree_steps": 20, "recompiled": 200},
        },
        against="a step of these worlds (in_steps), mujoco_warp alone (ours_over_alone), MuJoCo's compiler, one core (times_recompiling)",
        by=("impl", "worlds"),
        targets={"*.in_steps": ("<=", 3.0), "*.ours_over_alone": (">=", 0.95)},
    ),
    Case(
        "kitchen_episodes",
        "kitchen:transfer",
        "steps of Transfer between the surfaces of that kitchen, a new one in every episode, against kitchens that stay (speed_share)",
        {
            "tiny": {"impl": "warp", "worlds": 4, "length": 4},
            "cpu": {"impl": "warp", "worlds": 64, "length": 20},
            "gpu": {"impl": "warp", "worlds": 8192, "length": 100},
        },
        by=("ends",),
        targets={"spread.speed_share": (">=", 0.95)},
    ),
    Case(
        "task_episodes",
        "when_needed:of_tasks",
        "steps of tasks of arms, a new arena in every episode, against arenas that stay (speed_share)",
        {
            "tiny": {"names": ("Reach",), "worlds": 4, "length": 4},
            "cpu": {"worlds": 64, "length": 20},
            "gpu": {"worlds": 8192, "length": 100},
        },
        by=("task", "ends"),
        targets={"*.spread.speed_share": (">=", 0.95)},
    ),
    Case(
        "dropped",
        "dropped:dropped",
        "objects of furnished rooms that are dropped by 3 mm in C MuJoCo: not finite, through what carries them, above it, or moved",
        {
            "tiny": {"worlds": {"kitchen": 4, "benchmark": 2}, "n_steps": 5},
            "cpu": {"worlds": {"kitchen": 10000} | dict.fromkeys(ROOMS, 1000), "n_steps": 250},
        },
        by=("example", "worlds"),
        targets={f"*.{what}": ("<=", 0) for what in ("not_finite", "through", "above", "moved")},
    ),
    Case(
        "variants",
        "variants:variants",
        "drawing and stepping four objects that are each one of few or of many variants",
        {
            "tiny": {"impl": "jax", "worlds": 4, "n_steps": 2, "counts": (1, 3), "kinds": ("primitives",)},
            "cpu": {"impl": "warp", "worlds": 64, "n_steps": 20, "counts": (1, 3, 10), "kinds": _KINDS},
            "gpu": {"impl": "warp", "worlds": 8192, "n_steps": 100, "counts": (1, 3, 10, 30), "kinds": _KINDS},
        },
        against="the fewest variants (steps_over_fewest, randomize_over_fewest)",
        by=("impl", "kind", "variants", "chosen", "worlds"),
        targets={"*.10.*.steps_over_fewest": ("<=", 1.15)},
    ),
    Case(
        "variants_jax",
        "variants:variants",
        'the same with impl="jax", which computes all pairs of geoms in every step',
        {
            "tiny": {"impl": "jax", "worlds": 4, "n_steps": 2, "counts": (1, 2), "kinds": ("primitives",)},
            "cpu": {"impl": "jax", "worlds": 64, "n_steps": 20, "counts": (1, 3), "kinds": ("primitives",)},
            "gpu": {"impl": "jax", "worlds": 8192, "n_steps": 100, "counts": (1, 3), "kinds": ("primitives",)},
        },
        against="the fewest variants (steps_over_fewest, randomize_over_fewest)",
        by=("impl", "kind", "variants", "chosen", "worlds"),
    ),
    Case(
        "robots",
        "robots:robots",
        "arms of other packages as they are and simplified: pairs, change of shape, steps in C MuJoCo and on the device",
        {
            "tiny": {**_ALL_ARMS, "names": ("ur5e",), "hows": _FAST, "worlds": 2, "n_steps": 2, "seconds": 0.01},
            "cpu": {**_ALL_ARMS, "worlds": 16, "n_steps": 10, "seconds": 0.5},
            "gpu": {**_ALL_ARMS, "worlds": 1024, "n_steps": 100, "seconds": 0.02},
        },
        against="the arm as it is (c_times_as_it_is, times_as_it_is)",
        by=("robot", "how"),
    ),
    Case(
        "kinds",
        "stepping:kinds",
        "steps of random worlds, and of batched leaves with equal values",
        {
            "tiny": {"worlds": ONE_OF_EACH, "n_steps": 3},
            "cpu": {"worlds": CPU, "n_steps": 20},
            "gpu": {"worlds": GPU, "n_steps": 100},
        },
        against="a plain, unrandomized MJX step of one shared model",
        by=("impl", "worlds"),
        targets={"*.same_over_shared": (">=", 0.97)},
    ),
    Case(
        "warp_alone",
        "rivals:warp_alone",
        "rollout with impl='warp'",
        {
            "tiny": {"worlds": (4,), "n_steps": 3, "agree_steps": 3},
            "cpu": {"worlds": (16, 64), "n_steps": 20, "agree_steps": 10},
            "gpu": {"worlds": (8192, 32768, 131072), "n_steps": 100, "agree_steps": 20},
        },
        against="mujoco_warp with the same batched fields and capacities (a CUDA graph of one step on a GPU)",
        by=("worlds",),
        targets={"*.ours_over_alone": (">=", 0.95)},
    ),
    Case(
        "rollout_length",
        "rivals:rollout_length",
        "short and long rollouts with impl='warp': what a call costs beside its steps",
        {
            "tiny": {"worlds": 4, "n_steps": (1, 2)},
            "cpu": {"worlds": 16, "n_steps": (5, 20)},
            "gpu": {"worlds": 8192, "n_steps": (25, 100, 400)},
        },
        against="the same with mujoco_warp",
        by=("worlds", "n_steps"),
    ),
    Case(
        "lines",
        "lines:lines",
        "lines that Warp prints in a rollout of an arm whose solver has five iterations, and worlds in which the data notes it",
        {
            "tiny": {"worlds": 4, "n_steps": 2},
            "cpu": {"worlds": 256, "n_steps": 100},
            "gpu": {"worlds": 8192, "n_steps": 100},
        },
        against="a plain loop of mjx.step (plain_lines)",
        by=("worlds",),
        targets={"*.lines": ("<=", 0)},
    ),
    Case(
        "tables_warp",
        "stepping:tables",
        "steps with more and more tables, 3 cubes on the first; impl='warp'",
        {
            "cpu": {"worlds": {"warp": 16}, "counts": (1, 2, 4, 8, 16), "n_steps": 10},
            "gpu": {"worlds": {"warp": 8192}, "counts": (1, 2, 4, 8, 16), "n_steps": 100},
        },
        by=("impl", "tables"),
        targets={"warp.16.time_over_fewest": ("<=", 1.1)},
    ),
    Case(
        "reset",
        "stepping:reset",
        "new worlds with absent tables and cubes, placed, data made; in units of one step",
        {
            "tiny": {"worlds": ONE_OF_EACH, "n_steps": 3},
            "cpu": {"worlds": CPU, "n_steps": 20},
            "gpu": {"worlds": GPU, "n_steps": 100},
        },
        by=("impl", "worlds"),
        targets={"*.reset_in_steps": ("<", 20)},
    ),
    Case(
        "tables_jax",
        "stepping:tables",
        "steps with more and more tables, 3 cubes on the first; impl='jax'",
        {
            "cpu": {"worlds": {"jax": 256}, "counts": (1, 4, 16), "n_steps": 20},
            "gpu": {"worlds": {"jax": 8192}, "counts": (1, 16), "n_steps": 100},
        },
        by=("impl", "tables"),
        targets={"jax.16.time_over_fewest": ("<=", 1.3)},
    ),
    Case(
        "pixels",
        "pixels:speed",
        "pictures of all worlds of pick_and_place, by size, cameras, shadows, textures, meshes and worlds; and with steps",
        {
            "tiny": {
                "worlds": (4,),
                "resolutions": (8,),
                "n_cameras": (2,),
                "triangles": (1,),
                "together": ({},),
                "n_steps": 2,
            },
            "cpu": {
                "worlds": (64, 16),
                "resolutions": (32, 64),
                "n_cameras": (1, 2),
                "triangles": (3,),
                "together": ({},),
                "n_steps": 5,
            },
            "gpu": {
                "worlds": (8192, 1024, 4096, 32768),
                "resolutions": (32, 64, 128),
                "n_cameras": (1, 2, 3),
                "triangles": (3, 4),
                "together": ({}, {"textures": True, "shadows": True}, {"worlds": 1024}, {"pixels": 128}),
                "n_steps": 20,
            },
        },
        against="mujoco_warp with the same fields and context, a step and its pictures as one CUDA graph (rows with a step)",
        by=("with", "worlds", "pixels", "cameras", "shadows", "textures", "depth", "segmentation", "triangles"),
        targets={"step.*.64.1.False.False.*.frames_per_second": (">=", 1e6), "*.ours_over_alone": (">=", 0.97)},
    ),
    Case(
        "bytes_per_world",
        "memory:bytes_per_world",
        "bytes of a world by cause, from shapes and types",
        {size: {"impls": ("jax", "warp"), "worlds": 64} for size in SIZES},
        by=("impl",),
    ),
    Case(
        "c_mujoco",
        "rivals:c_mujoco",
        "steps a second of C MuJoCo on all cores and of MJX on the same machine",
        {
            "tiny": {"c_worlds": 4, "mjx_worlds": {}, "n_steps": 3},
            "cpu": {"c_worlds": 256, "mjx_worlds": CPU, "n_steps": 20},
            "gpu": {"c_worlds": 256, "mjx_worlds": GPU, "n_steps": 100},
        },
        against="mujoco.rollout with recompiled models, mujoco.batch through c_batch and with one shared model",
        by=("with", "worlds"),
    ),
    Case(
        "startup",
        "startup:startup",
        "import, compile, trace, load kernels, until the first step; fresh processes, cold and warm caches",
        {
            "tiny": {"runs": (("tables", "jax"),), "worlds": 4},
            "cpu": {"runs": (("tables", "jax"), ("tables", "warp"), ("arm", "warp")), "worlds": 64},
            "gpu": {"runs": (("tables", "warp"), ("arm", "warp"), ("tables", "jax")), "worlds": 8192},
        },
        by=("scene", "impl", "caches"),
    ),
    Case(
        "compiling",
        "compiling:compiling",
        "an arena's first compile with its proof, against MuJoCo's alone; a second, equal arena made, randomized and stepped",
        {
            "tiny": {"examples": ("arm",), "worlds": 2},
            "cpu": {"examples": ("shelf", "pick_and_place", "clutter", "kitchen", "arm"), "worlds": 64},
            "gpu": {"examples": ("shelf", "pick_and_place", "clutter", "kitchen", "arm"), "worlds": 8192},
        },
        by=("example",),
        targets={"*.second_arena_seconds": ("<", 1.0), "*.second_arena_compiles": ("<=", 0)},
    ),
    Case("proofs", "compiling:proofs", "an arm's first compile and its proof", {"cpu": {}}, by=("robot", "terms")),
    Case(
        "throughput",
        "stepping:throughput",
        "steps of random worlds against their number",
        {
            "cpu": {"worlds": {"jax": (16, 256, 1024), "warp": (16, 64, 256)}, "n_steps": 20},
            "gpu": {"worlds": {"warp": (2048, 8192, 32768, 131072), "jax": (8192,)}, "n_steps": 100},
        },
        against="a plain device copy of all bytes that a step touches once (floor)",
        by=("impl", "worlds"),
    ),
    Case(
        "placement",
        "writing:placement",
        "worlds in which every box finds a place on one table",
        {
            "tiny": {"crowded": (5,), "crowded_worlds": 4, "worlds": 4},
            "cpu": {"crowded": (5, 10, 15, 20, 25, 30), "crowded_worlds": 2000, "worlds": 8192},
            "gpu": {"crowded": (5, 10, 15, 20, 25, 30), "crowded_worlds": 2000, "worlds": 8192},
        },
        by=("objects", "full_size", "worlds"),
    ),
    Case(
        "robosuite",
        "rivals:robosuite",
        "arenas a second at the best batch size",
        {
            "tiny": {"impl": "jax", "worlds": (4,), "rebuilt": 2},
            "cpu": {"impl": "jax", "worlds": (1024, 8192, 32768), "rebuilt": 100},
            "gpu": {"impl": "warp", "worlds": (131072, 1048576), "rebuilt": 100},
        },
        against="robosuite's rebuild, textures included, one core",
    ),
    Case(
        "mjlab",
        "rivals:mjlab",
        "seconds to randomize tables in all worlds",
        {
            "tiny": {"impl": "jax", "worlds": (4,)},
            "cpu": {"impl": "jax", "worlds": (1024, 8192)},
            "gpu": {"impl": "warp", "worlds": (8192, 131072)},
        },
        against="mjlab's dr.body_pos, body_quat, geom_size and geom_friction",
        by=("worlds",),
    ),
    Case(
        "mjlab_terms",
        "rivals:mjlab_terms",
        "seconds to randomize masses, joints, gains, colours, a site and a camera of an arm, with what follows from them",
        {
            "tiny": {"impl": "jax", "worlds": (4,)},
            "cpu": {"impl": "jax", "worlds": (1024, 8192)},
            "gpu": {"impl": "warp", "worlds": (8192,)},
        },
        against="the same functions of mjlab's dr, and its recompute_constants",
        by=("worlds",),
        targets={"*.times_mjlab": (">=", 10)},
    ),
)

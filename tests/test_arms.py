"""Arms reach, lift, and pick and place, by a script, in random worlds; what they see is what C MuJoCo says."""

import dataclasses
import functools
import pathlib
import types

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from test_reach import arm_of

import mjx_arenas as mja
from mjx_arenas.envs import Lift, OpenDrawer, PickAndPlace, Reach, arms
from mjx_arenas.envs.tasks import manipulation

FEW, MANY = 2, 6  # random worlds
CRUISE = 0.18  # [m] of the tool above what carries the arm, above all that is in the way
NOTHING = jnp.zeros(3)


def action(move, yaw, grip):
    """That moves the tool by (3,) [m] and turns it [rad]."""
    steps = 0.6 * move / manipulation.STEP, jnp.atleast_1d(0.5 * yaw / manipulation.TURN), jnp.atleast_1d(grip)
    return jnp.clip(jnp.concatenate(steps), -1, 1)


def seen(env, obs):
    """Tool (3,), yaw from it to a box, which looks the same from four sides, way to the object and what follows in the state."""
    rest = obs[3 * len(env.arm_joints) + 2 * len(env.finger_joints) :]
    tool, heading, to, axis = rest[:3], rest[3:5], rest[5:8], rest[8:11]
    turned = jnp.arctan2(axis[1], axis[0]) - jnp.arctan2(heading[1], heading[0])
    return tool, jnp.mod(turned + jnp.pi / 4, jnp.pi / 2) - jnp.pi / 4, to, rest[14:]


def lifting(env, obs, phase, waited):
    """Above, down, close, up."""
    _, yaw, to, _ = seen(env, obs)
    above, up = to + jnp.array([0, 0, 0.1]), jnp.array([0, 0, 0.04])
    done = [(jnp.abs(above) < 0.006).all() & (jnp.abs(yaw) < 0.05), (jnp.abs(to) < 0.006).all(), waited > 8, False]
    move = jnp.stack([above, to, NOTHING, up])[phase]
    return action(move, jnp.where(phase < 2, yaw, 0.0), jnp.where(phase < 2, 1.0, -1.0)), jnp.stack(done)[phase]


def carrying(env, obs, phase, waited):
    """Above, down, close, up, across, down, open, away."""
    tool, yaw, to, goal = seen(env, obs)
    above, up = to + jnp.array([0, 0, 0.1]), jnp.array([0, 0, CRUISE - env.arm.rise - tool[2]])
    across, down = jnp.append(goal[:2], up[2]), goal + jnp.array([0, 0, 0.03])
    move = jnp.stack([above, to, NOTHING, up, across, down, NOTHING, up])[phase]
    done = [(jnp.abs(above) < 0.006).all() & (jnp.abs(yaw) < 0.05), (jnp.abs(to) < 0.006).all(), waited > 8]
    done += [jnp.abs(up[2]) < 0.02, (jnp.abs(across) < 0.02).all(), down[2] > -0.008, waited > 8, False]
    grip = jnp.where((phase >= 2) & (phase < 6), -1.0, 1.0)
    return action(move, jnp.where(phase < 2, yaw, 0.0), grip), jnp.stack(done)[phase]


def reaching(env, obs, phase, waited):
    """Straight to the point, which is the end of the state."""
    return action(obs[-3:], 0.0, 1.0), jnp.zeros((), bool)


def opening(env, obs, phase, waited):
    """Above the drawer's front, down behind it, out until it is open far enough."""
    rest = obs[3 * len(env.arm_joints) + 2 * len(env.finger_joints) :]
    heading, to, out, further = rest[3:5], rest[5:8], jnp.append(rest[8:10], 0.0), rest[11]
    yaw = jnp.arctan2(out[1], out[0]) - jnp.arctan2(heading[1], heading[0])
    yaw = jnp.mod(yaw + jnp.pi / 2, jnp.pi) - jnp.pi / 2
    above, pull = to + jnp.array([0, 0, 0.07]), to + out * (jnp.clip(0.15 * further, 0.0, 0.012) - to @ out)
    move = jnp.stack([above, to, pull])[phase]
    done = [(jnp.abs(above) < 0.006).all() & (jnp.abs(yaw) < 0.05), (jnp.abs(to) < 0.006).all(), False]
    return action(move, yaw, -1.0), jnp.stack(done)[phase]


SCRIPTS = {OpenDrawer: (opening, 75), Reach: (reaching, 50), Lift: (lifting, 80), PickAndPlace: (carrying, 130)}


def rollout(kind, arm="small", n=FEW):
    return _rollout(kind, arm, n)


@functools.cache
def _rollout(kind, arm, n):
    """Environment, first states, and metrics, rewards and ends (steps, n + 1) of scripted worlds, the last of which is idle."""
    env = kind(config_overrides={"impl": "warp"}, arm=arm_of(arm))
    script, length = SCRIPTS[kind]
    idle = jnp.arange(n + 1) == n

    def act(obs, phase, waited):
        chosen, done = script(env, obs, phase, waited)
        return chosen, phase + done, jnp.where(done, 0, waited + 1)

    @jax.jit
    def run(keys):
        def step(carry, _):
            state, phase, waited = carry
            actions, phase, waited = jax.vmap(act)(state.obs["state"], phase, waited)
            state = jax.vmap(env.step)(state, jnp.where(idle[:, None], 0.0, actions))
            return (state, phase, waited), {"phase": phase, "reward": state.reward, "done": state.done, **state.metrics}

        zero = jnp.zeros(len(idle), int)
        first = jax.vmap(env.reset)(keys)
        (last, *_), log = jax.lax.scan(step, (first, zero, zero), length=length)
        return first, last, log

    return env, *jax.device_get(run(jax.random.split(jax.random.key(0), len(idle))))


@pytest.mark.slow
@pytest.mark.parametrize("n", [FEW, pytest.param(MANY, marks=pytest.mark.xslow)])
@pytest.mark.parametrize("kind", SCRIPTS)
def test_a_script_succeeds(kind, n):
    """In each of the random worlds but the idle one, and it is rewarded for it."""
    _, _, _, log = rollout(kind, n=n)
    assert log["success"][-1].tolist() == [1.0] * n + [0.0]
    assert (log["reward"][-1, :n] > log["reward"][-1, n] + 0.5).all()
    for name in ("done", "nan_action", "nan_state", "invalid_arena", "dropped_contacts"):
        assert not log[name].any(), name
    assert (log["reward"][-1] > log["reward"][0])[:n].all()


@pytest.mark.slow
def test_lift_pays_for_a_grip_around_the_object():
    """By the formula of its docstring; a closed grip on top of the object, or an open one, gets nothing for it."""
    env, first, _, log = rollout(Lift)
    one = mja.take(first, 0)
    pos = env.arena.layout.object_qpos[0, :3]
    tool = np.asarray(env.hand(one.data).tool.pos)
    at = env.mj_model.body("arm_base").id
    base, mat = one.data.xpos[at], one.data.xmat[at]
    for off, grip in ((0.0, -1.0), (0.007, -1.0), (0.013, 0.2), (0.021, -1.0), (0.0, 1.0)):
        qpos = one.data.qpos.copy()
        qpos[pos] = base + mat @ (tool + np.array([0, 0, off]))
        told = np.array([0.0, 0.0, 0.0, 0.0, grip])
        episode = one.info["episode"]
        stood = episode.task._replace(height=qpos[pos[2]])  # not lifted
        reward, _, _ = env.score(one.data.replace(qpos=qpos), episode._replace(task=stood), told)
        plain = 0.4 * (1 - np.tanh(6 * off)) + 0.3 * max(1 - off / 0.02, 0) * (1 - grip) / 2 - 0.005 * grip**2
        np.testing.assert_allclose(reward, plain, atol=3e-5)  # 17 a metre, and distances are 1e-6 m too long
    phase, reward = log["phase"][:, :FEW], log["reward"][:, :FEW]
    means = [reward[phase == i].mean() for i in range(4)]
    assert means == sorted(means)  # above, down, close, up: none of them has to be given up for the next


def test_what_lies_still_at_first_is_not_a_million_deviations_off_when_it_moves():
    """Brax's statistics of the first observations have no variance where boxes are upright; then one is tipped."""
    from brax.training.acme import running_statistics, specs

    from mjx_arenas import settings

    eps = settings.read(settings.find("lift"))["ppo"]["normalize_observations_std_eps"]
    upright = jnp.zeros((1000, 1)) + jnp.linspace(-1e-7, 1e-7, 1000)[:, None]
    largest = {}
    for value in (0.0, eps):
        state = running_statistics.init_state(specs.Array((1,), jnp.dtype("float32")), std_eps=value)
        state = running_statistics.update(state, upright)
        largest[value] = float(running_statistics.normalize(jnp.ones(1), state)[0])
    assert largest[0.0] > 1e5
    np.testing.assert_allclose(largest[eps], eps**-0.5, rtol=1e-3)
    assert largest[eps] <= 100.1


@pytest.mark.xslow
@pytest.mark.parametrize(
    ("kind", "arm"), [(Lift, "yam"), (PickAndPlace, "yam"), (Reach, "panda"), (Lift, "panda"), (OpenDrawer, "panda")]
)
def test_arms_of_packages_do_too(kind, arm):
    """As the small arm does, in each of the random worlds."""
    *_, log = rollout(kind, arm, MANY)
    assert log["success"][-1].tolist() == [1.0] * MANY + [0.0]


@pytest.mark.slow
@pytest.mark.parametrize("kind", SCRIPTS)
def test_what_is_seen(kind):
    """In the recompiled world in C, with the state of the last step: tool and object in the frame of the base, wherever its table is."""
    env, _, last, _ = rollout(kind)
    for w in range(3):
        one = mja.take(last, w)
        model, data = env.arena.c_world(jax.tree.map(np.asarray, one.info["episode"].params))
        names = [model.joint(j).name for j in range(model.njnt)]
        assert names == [env.mj_model.joint(j).name for j in range(env.mj_model.njnt)]
        data.qpos[:] = one.data.qpos
        mujoco.mj_forward(model, data)
        base = data.body("arm_base")
        tool = base.xmat.reshape(3, 3).T @ (data.site("arm_tool").xpos - base.xpos)
        at = 3 * len(env.arm_joints) + 2 * len(env.finger_joints)
        np.testing.assert_allclose(one.obs["state"][at : at + 3], tool, atol=1e-5)
        if kind is OpenDrawer:
            front = model.geom("unit_drawer2_front")
            edge = data.geom(front.id).xpos + data.geom(front.id).xmat.reshape(3, 3) @ (front.size * [1, 0, 1])
            inside = data.geom(front.id).xmat.reshape(3, 3) @ [0.025, 0, -0.02]
            hook = base.xmat.reshape(3, 3).T @ (edge + inside - base.xpos)
            np.testing.assert_allclose(one.obs["state"][at + 5 : at + 8], hook - tool, atol=1e-5)
        elif kind is not Reach:
            thing = base.xmat.reshape(3, 3).T @ (data.body("box").xpos - base.xpos)
            np.testing.assert_allclose(one.obs["state"][at + 5 : at + 8], thing - tool, atol=1e-5)


@pytest.mark.slow
def test_goals_are_within_reach():
    """And on the other table; the object starts within reach on the first."""
    env = PickAndPlace(config_overrides={"impl": "warp"})
    first = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(3), 64))
    params, task = first.info["episode"].params, first.info["episode"].task
    stand = np.asarray(params.table_offsets)[:, 2]
    for spot in (np.asarray(task.pos), np.asarray(first.data.qpos)[:, env.arena.layout.object_qpos[0, :3]]):
        distance = np.linalg.norm((spot - stand)[:, :2], axis=1)
        assert (distance > env.arm.reach[0] - 1e-5).all()
        assert (distance < env.arm.reach[1] + 1e-5).all()
    assert first.info["episode"].valid.all()
    np.testing.assert_allclose(task.pos[:, 2], params.table_offsets[:, 1, 2], atol=1e-6)
    assert np.ptp(np.asarray(task.pos), axis=0).min() > 0.1


@pytest.mark.xslow
@pytest.mark.slow
def test_goals_out_of_reach_are_told():
    """Of surfaces that come and go from the arm, those with no goal within its reach make an episode invalid."""
    offsets = mja.Uniform([[0, 0, 0]] * 3, [[0, 0, 0], [0.6, 0, 0], [0, 0, 0]], relative="add")
    env = PickAndPlace(ranges=mja.ArenaRanges(table_offsets=offsets))
    first = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(3), 64))
    episode = first.info["episode"]
    distance = np.linalg.norm((episode.task.pos - episode.params.table_offsets[:, 2])[:, :2], axis=1)
    np.testing.assert_array_equal(episode.valid, distance <= env.arm.reach[1] + 1e-6)
    assert 10 < episode.valid.sum() < 54


@pytest.mark.slow
def test_documented():
    """The code of docs/arms.md."""
    text = (pathlib.Path(__file__).parent.parent / "docs" / "arms.md").read_text()
    names = {}
    first, own, varied = (part.split("```")[0] for part in text.split("```python\n")[1:])
    exec(first, names)
    assert names["state"].obs["state"].shape == (36,)
    assert names["env"].action_size == 5
    exec(own, names)  # a warning would say what is out of reach
    assert names["opens"].action_size == names["carries"].action_size == 5
    exec(varied, names)
    assert {"torque", "arm_kp", "arm_mass", "arm_start"} <= {*names["varied"].ranges.terms}


@pytest.mark.xslow
@pytest.mark.slow
def test_joint_steps():
    """With actions of joints the targets of its servos move, and never far ahead of it."""
    env = Reach(config_overrides={"impl": "jax", "action": "joint"})
    assert env.action_size == 6
    state = jax.jit(env.reset)(jax.random.key(0))
    episode, data = state.info["episode"], state.data
    target = env.drive(data, episode, jnp.array([1.0, -1, 0, 0, 0.5, -1]))
    start = env.mj_model.key("arm_home").qpos[:5] + state.info["episode"].params.terms["arm_start"]
    assert np.ptp(start - env.mj_model.key("arm_home").ctrl[:5]) > 0.1  # the first targets are where the arm starts
    np.testing.assert_allclose(target[:5], start + 0.08 * np.array([1, -1, 0, 0, 0.5]), atol=1e-6)
    np.testing.assert_allclose(target[5:], [-0.045, -0.045], atol=1e-7)
    data = data.replace(time=env.dt, ctrl=target)
    later = env.drive(data, episode, jnp.array([1.0, -1, 0, 0, 0.5, -1]))
    np.testing.assert_allclose(later[:5] - target[:5], target[:5] - start, atol=1e-6)
    for _ in range(12):
        data = data.replace(ctrl=env.drive(data, episode, jnp.ones(6)))
    assert (data.ctrl[:5] - data.qpos[:5] < 0.4 + 1e-6).all()
    assert (data.ctrl[:5] - data.qpos[:5] > 0.35).all()


def test_a_gripper_with_a_tendon():
    """As that of a 2F-85: a servo with controls from 0 to 255 closes both fingers. Policies see it as C MuJoCo's servo does."""
    arm = arms.small()
    for name in ("left", "right"):
        arm.spec.delete(arm.spec.actuator(name))
    split = arm.spec.add_tendon(name="split")
    split.wrap_joint("left", 0.25)
    split.wrap_joint("right", 0.75)
    servo = arm.spec.add_actuator(name="grip", target="split", trntype=mujoco.mjtTrn.mjTRN_TENDON, gear=[2, *5 * [0]])
    servo.set_to_position(kp=1000)
    servo.gainprm[0] = -1000 * 2 * 0.045 / 255  # -9 cm of twice the length at 255
    arm.spec.delete(arm.spec.key("home"))
    arms.ready(arm.spec, {"elbow": 0.2}, {"grip": (255.0, 0.0)})
    env = Reach(arm=dataclasses.replace(arm, fingers={"grip": (255.0, 0.0)}))
    assert env.finger_joints == ("arm_split",)
    model, data = env.mj_model, mujoco.MjData(env.mj_model)
    for name, at in {"arm_left": -0.04, "arm_right": -0.01}.items():
        data.joint(name).qpos = at
    data.actuator("arm_grip").ctrl = 100
    mujoco.mj_forward(model, data)
    seen = env.proprioception(
        types.SimpleNamespace(qpos=jnp.array(data.qpos), qvel=jnp.array(data.qvel), ctrl=jnp.array(data.ctrl))
    )
    grip, ahead = seen[10], seen[16]  # after five joints and their velocities, and then five servos
    stroke = 0.045  # [m] of the tendon, from -0.045 to 0
    np.testing.assert_allclose(grip, 1 + data.tendon("arm_split").length[0] / stroke, rtol=1e-6)
    np.testing.assert_allclose(ahead * stroke * 1000 * 2, data.actuator("arm_grip").force[0], rtol=1e-5)
    ctrl = env.drive(
        types.SimpleNamespace(**{x: jnp.array(getattr(data, x)) for x in ("qpos", "ctrl", "time")}),
        None,
        jnp.array([0.0, 0, 0, 0, -1]),
    )
    assert ctrl[model.actuator("arm_grip").id] == 255


@pytest.mark.parametrize("limited", [True, False])
def test_a_gripper_with_motors(limited):
    """Policies see how far its fingers are open, of their ranges, and what they are told, of their controls."""
    arm = arms.small()
    for name in ("left", "right"):
        arm.spec.actuator(name).set_to_motor()
        arm.spec.actuator(name).ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE
        arm.spec.joint(name).limited = limited
    env = Reach(arm=dataclasses.replace(arm, fingers={"left": (-20.0, 20.0), "right": (-20.0, 20.0)}))
    qpos, ctrl = np.array(env.mj_model.key("arm_home").qpos), np.zeros(env.mj_model.nu)
    qpos[[env.mj_model.joint(name).qposadr[0] for name in env.finger_joints]] = [-0.045, -0.009]
    ctrl[[env.mj_model.actuator(f"arm_{name}").id for name in ("left", "right")]] = [10, -20]
    seen = env.proprioception(
        types.SimpleNamespace(qpos=jnp.array(qpos), qvel=jnp.zeros(env.mj_model.nv), ctrl=jnp.array(ctrl))
    )
    is_open = np.array([0, 0.8]) if limited else np.array([-0.045, -0.009])
    np.testing.assert_allclose(seen[10:12], is_open, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(seen[17:19], np.array([0.75, 0]) - is_open, rtol=1e-5, atol=1e-6)


@pytest.mark.slow
def test_wrong():
    """A servo that is missing, other actions, nothing to lift and no such goal."""
    arm = arms.small()
    arm.spec.actuator("elbow").target = "shoulder"
    with pytest.raises(ValueError, match="elbow") as raised:
        Reach(arm=arm)
    assert (
        str(raised.value) == "`arm.spec` must have a position actuator for each joint up to its tool: elbow has none."
    )
    arm = arms.small()
    both = arm.spec.add_tendon(name="both")
    for body in ("left", "right"):
        arm.spec.body(body).add_site(name=body)
        both.wrap_site(body)
    arm.spec.actuator("left").trntype, arm.spec.actuator("left").target = mujoco.mjtTrn.mjTRN_TENDON, "both"
    with pytest.raises(
        ValueError, match=r"`arm.fingers` must name actuators of joints or fixed tendons, got 'left': give a j"
    ):
        Reach(arm=arm)
    with pytest.raises(ValueError, match=r"`config.action` must be 'cartesian' or 'joint', got 'torque'."):
        Reach(config_overrides={"action": "torque"})
    with pytest.raises(ValueError, match="`arena` must have an object to lift"):
        Lift(arena=mja.TableArena())
    with pytest.raises(ValueError, match=r"`unit` must be the name of drawers of the arena, unit, got 'desk'."):
        OpenDrawer(unit="desk")
    fewer = mja.ArenaRanges(terms={"unit.pieces_active": mja.Count(1, 3)})
    with pytest.raises(
        ValueError, match=r"`ranges.terms` must not have 'unit.pieces_active': the drawer that is to be"
    ):
        OpenDrawer(ranges=fewer)
    with pytest.raises(ValueError, match=r"`config\.keyframe` must be"):
        Reach(config_overrides={"keyframe": "rest"})
    with pytest.raises(ValueError, match="`goals` must be one or more of 'table0', 'table1', 'table2', got"):
        PickAndPlace(goals=["shelf"])


def straight(obs, key):
    """A policy for `Reach` without memory."""
    return jax.vmap(lambda one: reaching(None, one, 0, 0)[0])(obs["state"]), {}


@pytest.mark.slow
def test_in_c():
    """A policy does in recompiled worlds in C what it does on MJX; an idle one fails in both; what C cannot do is refused."""
    env = Reach(config_overrides={"impl": "warp", "episode_length": 25})
    found = [mja.evaluate(straight, env, 6, seed=1, engine=engine) for engine in (None, "c")]
    assert found[0] == found[1]
    assert found[0]["success"] > 0.9
    idle = mja.evaluate(lambda obs, key: (jnp.zeros((len(obs["state"]), 5)), {}), env, 6, seed=1, engine="c")
    assert idle["success"] == 0
    with pytest.raises(ValueError, match=r"`engine` must be None \(that of the environment\) or 'c', got 'bullet'."):
        mja.evaluate(straight, env, 6, engine="bullet")
    with pytest.raises(ValueError, match="`n_worlds` must be"):
        mja.evaluate(straight, env, 0)


@pytest.mark.xslow
@pytest.mark.slow
def test_delays_and_noise_in_c():
    """Actions and observations are as late and noisy as on MJX: what a policy does last in C is what it does there."""
    flaws = {"action_delay": (0, 3), "observation_delay": (1, 3), "action_noise": 0.1, "observation_noise": 0.01}
    for given in ({}, flaws):
        env = Reach(config_overrides={"impl": "warp", "episode_length": 12, **given})
        seen = {None: [], "c": []}
        for engine, log in seen.items():

            def policy(obs, key, log=log):
                jax.debug.callback(lambda x: log.append(np.array(x)), obs["state"], ordered=True)
                return straight(obs, key)

            mja.evaluate(policy, env, 4, seed=1, engine=engine)
            jax.effects_barrier()
        on_mjx, in_c = np.array(seen[None]), np.array(seen["c"])
        assert on_mjx.shape == in_c.shape
        assert np.ptp(on_mjx, axis=0).max() > 0.05
        np.testing.assert_allclose(in_c, on_mjx, atol=2e-3)


@pytest.mark.parametrize("angle", ["", '<compiler angle="degree"/>', '<compiler angle="radian"/>'])
@pytest.mark.parametrize("kind", ["hinge", "slide"])
def test_servo_of_an_mjcf_in_degrees(angle, kind):
    """Its controls are what the compiled joint's range is."""
    joint = f'<joint name="j" type="{kind}" range="-1.5 80"/>'
    spec = mujoco.MjSpec.from_string(
        f'<mujoco>{angle}<worldbody><body>{joint}<geom size=".1"/></body></worldbody></mujoco>'
    )
    arms.servo(spec, "j", 1, 4, 10)
    model = spec.compile()
    np.testing.assert_allclose(model.actuator_ctrlrange, model.jnt_range, rtol=1e-12)
    assert model.jnt_range[0, 1] == pytest.approx(np.deg2rad(80) if kind == "hinge" and "radian" not in angle else 80)

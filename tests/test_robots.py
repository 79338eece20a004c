"""What robots bring along: files, sizes, options, and geoms inside each other."""


import mjx_arenas as mja

CUBE = mja.Object("cube", pos=(0.3, 0.3))


def with_robot(xml, prefix="r_", objects=(CUBE,), **kwargs):
    arena = mja.TableArena(objects=objects)
    arena.attach(xml, prefix, **kwargs)
    return arena


def test_sizes_are_shared(capfd):
    """Sizes of both are large enough for both, and MuJoCo says nothing of them."""
    sizes = '<size memory="1M" nuserdata="3" nuser_geom="2" nkey="2"/>'
    robot = f"""<mujoco>{sizes}<worldbody><body name="b"><joint/><geom name="g" size=".05" pos="0 0 3" user="1 2"/></body></worldbody>
      <keyframe><key name="home"/></keyframe></mujoco>"""
    arena = with_robot(robot)
    arena.attach(robot.replace('nuserdata="3"', 'nuserdata="2"'), "s_", pos=(1, 0, 0))
    merged = mja.TableArena(objects=[CUBE]).merge(arena, "m_", pos=(0, 3, 0))
    assert merged.mj_model.nuserdata == 3
    assert merged.mj_model.geom("m_s_g").user.tolist() == [1, 2]
    assert merged.mj_model.nkey == 4
    merged.to_xml(merged.nominal_params())
    assert capfd.readouterr() == ("", "")

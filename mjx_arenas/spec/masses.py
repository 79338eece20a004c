"""Rules of MuJoCo's compiler by which masses are other than those of bodies and geoms alone (host)."""

import mujoco
import numpy as np

BOUNDS = ("boundmass", "boundinertia")
"""Rules of the compiler by which masses and inertias are at least as large. They hold for each body by the MJCF that it comes from."""


def mass_rules(spec: mujoco.MjSpec) -> list[str]:
    """Rules of the compiler by which masses would not be those of the bodies and geoms alone."""
    compiler, (low, high) = spec.compiler, spec.compiler.inertiagrouprange
    found = [name for name in (*BOUNDS, "settotalmass") if getattr(compiler, name) > 0]
    never = compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    found += ["inertiafromgeom"] * never + ["inertiagrouprange"] * (not low <= 0 <= high)
    return found


def weighs(geom: mujoco.MjsGeom) -> bool:
    """Whether a geom is in the groups of which the compiler makes the inertial of its body."""
    low, high = geom.parent.compiler.inertiagrouprange
    return low <= geom.group <= high


def makes_inertial(geom: mujoco.MjsGeom) -> bool:
    """Whether a geom weighs something where the compiler makes the inertial of its body of geoms."""
    if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
        return False
    return weighs(geom) and (geom.density if np.isnan(geom.mass) else geom.mass) != 0


def weigh_groups(spec: mujoco.MjSpec) -> None:
    """Takes the mass from the geoms that the compiler's `inertiagrouprange` leaves out, and has it leave out none.

    Bodies are as they were, and geoms that are added weigh what they should. What was attached has a range of its own.
    """
    low, high = spec.compiler.inertiagrouprange
    for geom in [g for g in spec.geoms if not low <= g.group <= high]:
        if geom.compiler == spec.compiler:
            geom.mass = 0
    spec.compiler.inertiagrouprange = mujoco.MjSpec().compiler.inertiagrouprange


def inferred(body: mujoco.MjsBody) -> bool:
    """Whether the compiler makes a body's inertial of its geoms."""
    rule, rules = body.compiler.inertiafromgeom, mujoco.mjtInertiaFromGeom
    if rule == rules.mjINERTIAFROMGEOM_AUTO:
        return not body.explicitinertial
    return rule == rules.mjINERTIAFROMGEOM_TRUE


def allow_inertials(spec: mujoco.MjSpec) -> None:
    """Lets bodies have inertials of their own where the compiler makes all of geoms (`inertiafromgeom="true"`); none is another."""
    rules = mujoco.mjtInertiaFromGeom
    ruled = [body for body in spec.bodies if body.compiler.inertiafromgeom == rules.mjINERTIAFROMGEOM_TRUE]
    for body in ruled:
        if any(map(makes_inertial, body.geoms)):  # else the compiler keeps what the body has
            body.explicitinertial, body.ipos = False, [np.nan] * 3
    for body in ruled:
        body.compiler.inertiafromgeom = rules.mjINERTIAFROMGEOM_AUTO


def aligned(body: mujoco.MjsBody) -> bool:
    """Whether the compiler moves a body's frame to its centre of mass, along the principal axes."""
    joints = body.joints
    if len(joints) != 1 or joints[0].type != mujoco.mjtJoint.mjJNT_FREE or body.bodies:
        return False
    align, rules = joints[0].align, mujoco.mjtAlignFree
    return bool(align == rules.mjALIGNFREE_TRUE or (align == rules.mjALIGNFREE_AUTO and body.compiler.alignfree))

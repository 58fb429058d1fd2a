"""Open chains of many links: some with equal links, some with differences from link to link."""

from __future__ import annotations


def pendulums_in_a_row(links: int, *, joint: str = "revolute", stiffnesses: bool = False, masses: bool = False) -> str:
    """A hanging chain; ``masses`` differ from link to link, and so do ``stiffnesses``, tunable parameters of springs across its pins."""
    axis = ", axis: [0, 1, 0]" if joint == "revolute" else ""
    weights = [1.0 + 0.125 * (i % 5) if masses else 1.0 for i in range(links)]
    bodies = "".join(
        f"  link_{i}: {{mass: {weights[i]}, centre_of_mass: [0, 0, {-0.5 - i}], inertia: [0.1, 0.1, 0.02]}}\n" for i in range(links)
    )
    names = ["ground", *(f"link_{i}" for i in range(links))]
    joints = "".join(
        f"  pin_{i}: {{kind: {joint}, bodies: [{names[i]}, {names[i + 1]}], at: [0, 0, {-i}]{axis}}}\n" for i in range(links)
    )
    parameters = "".join(f"  k_{i}: {{value: {5 + i}, unit: N*m/rad, binding: param}}\n" for i in range(links)) if stiffnesses else ""
    springs = "".join(f"  spring_{i}: {{kind: joint_force, joint: pin_{i}, law: -k_{i}*position}}\n" for i in range(links))
    return (
        "cutjoint: 1\nname: row\ngravity: [0, 0, -9.81]\n"
        + (f"parameters:\n{parameters}" if stiffnesses else "")
        + f"bodies:\n{bodies}joints:\n{joints}"
        + (f"forces:\n{springs}" if stiffnesses else "")
        + "scenes:\n  swing: {end: 1, output_step: 10 ms, numerics: {dt: 1 ms}}\n"
    )

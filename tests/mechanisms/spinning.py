"""A crank, a rod and a top on balls: a loop that leaves three turns of one ball free and none or some of another's."""

SPINNING = """
cutjoint: 1
name: spinning
gravity: [0, 0, -9.81]
parameters: { pull: {value: 0, unit: N*m, binding: input} }
bodies:
  crank: {mass: 1, centre_of_mass: [0, 0.15, 0], inertia: [0.01, 0.002, 0.01]}
  rod: {mass: 0.5, centre_of_mass: [0.5, 0.3, 0.1], inertia: [0.01, 0.04, 0.04]}
  top: {mass: 2, centre_of_mass: [1, 0, 0.2], inertia: [0.03, 0.02, 0.04]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [1, 0, 0]}
  near: {kind: spherical, bodies: [crank, rod], at: [0, 0.3, 0]}
  pivot: {kind: spherical, bodies: [ground, top], at: [1, 0, 0]}
  far: {kind: spherical, bodies: [rod, top], at: [1, 0.3, 0.2], cut: true}
forces:
  motor: {kind: joint_force, joint: pin, law: "pull - 0.1*rate"}
outputs: [top.x, top.y, top.z, rod.z, pin.angle, pin.angle_rate, top.az]
scenes:
  spin: {end: 1, output_step: 20 ms, rates: {pivot.wz: 8, pivot.wx: 3, near.wx: 2}, numerics: {dt: 1 ms}}
"""

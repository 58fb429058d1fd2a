"""Mechanisms that move in a plane though their joints would let them leave it."""

from __future__ import annotations

#: A crank, a rod between balls, and a rocker in another plane; a plate on springs that swings from the rocker; a slider.  y is up.
SWING = """\
cutjoint: 1
name: swing
gravity: [0, -9.81, 0]
points: {A: [0, 0, 0], B: [0.3, 0.4, 0], C: [1.2, 0.6, 0], D: [1, 0, 0], E: [1.5, 0.2, 0], F: [2, 0, 0.25], G: [1.8, 0.5, 0]}
bodies:
  crank: {mass: 1, centre_of_mass: [0.15, 0.2, 0.1], inertia: {principal: [0.01, 0.02, 0.03], x: [1, 1, 0], y: [0, 0, 1]}}
  rod: {mass: 0.7, centre_of_mass: [0.75, 0.5, 0], inertia: [0.003, 0.05, 0.05, -0.006, 0, 0]}
  rocker: {mass: 1.4, centre_of_mass: [1.1, 0.3, -0.2], inertia: [0.04, 0.02, 0.05, 0.001, 0.002, 0.003]}
  plate: {mass: 2, centre_of_mass: [1.5, 0.2, 0], inertia: [0.02, 0.05, 0.06, 0.004, 0, 0]}
  bob: {mass: 0.5, centre_of_mass: [1.8, 0.4, 0], inertia: [0.01, 0.02, 0.025, 0.001, 0, 0]}
joints:
  crank_pin: {kind: revolute, bodies: [ground, crank], at: A, axis: [0, 0, 1]}
  rocker_pin: {kind: revolute, bodies: [ground, rocker], at: D, axis: [0, 0, -1]}
  rod_start: {kind: spherical, bodies: [crank, rod], at: B}
  rod_end: {kind: spherical, bodies: [rod, rocker], at: C, cut: true}
  plate_free: {kind: free, bodies: [ground, plate], at: E}
  bob_slide: {kind: cylindrical, bodies: [plate, bob], at: G, axis: [0, 1, 0]}
forces:
  left:
    {kind: point_spring, bodies: [rocker, plate], from: [1.3, 0.3, 0.4], to: [1.4, 0.2, 0.1],
     law: {stiffness: 90, free_length: 0.3, damping: 1}}
  right:
    {kind: point_spring, bodies: [rocker, plate], from: [1.3, 0.3, -0.4], to: [1.4, 0.2, -0.1],
     law: {stiffness: 90, free_length: 0.3, damping: 1}}
  hold: {kind: point_spring, bodies: [ground, plate], from: [1.5, 1.2, 0], to: E, law: {stiffness: 60, free_length: 0.6}}
  stop: {kind: joint_force, joint: bob_slide, coordinate: displacement, law: "-200*position - 3*rate"}
  screwing: {kind: joint_force, joint: bob_slide, coordinate: angle, law: "-2*position - 0.1*rate"}
  push: {kind: load, body: rocker, at: C, force: ["5*sin(3*t)", 2, 40]}
outputs: [rod.x, rod.y, rod.z, rod.yaw, rod.wx, crank_pin.angle, rocker_pin.angle, rocker_pin.angle_rate, plate.x, plate.y, plate.z,
          plate.yaw, plate.roll, plate_free.x, plate_free.vy, plate_free.wz, bob.y, bob_slide.displacement, bob_slide.angle,
          bob_slide.displacement_rate, left.force, right.length, hold.force, stop.force, push.Fz]
scenes:
  fall:
    end: 0.5
    output_step: 0.01
    rates: {plate_free.wz: 0.5, plate_free.vx: 0.2, bob_slide.displacement_rate: 0.1}
    positions: {plate_free.x: 0.01}
    numerics: {dt: 0.0005, penalty: 1.0e+5, tolerance: 1.0e-8}
"""

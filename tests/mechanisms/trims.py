"""Models whose starts are trimmed: a motor, a hydraulic lift, a preloaded spring, a sled with drag, a five-bar."""



MOTOR = """
cutjoint: 1
name: motor
gravity: [0, 0, -9.81]
parameters:
  voltage: {value: 0, unit: V, binding: input}
  length: {value: 0.5, unit: m, binding: param}
bodies:
  bob: {mass: 3, centre_of_mass: [length, 0, 0], inertia: [0.1, 0.1, 0.1, 0, 0, 0]}
joints:
  hinge: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}
states:
  current: {start: 0 A, rate: "(voltage - 0.5*current - 5*hinge.angle_rate)/0.01"}
forces:
  motor: {kind: joint_force, joint: hinge, law: 5*current}
scenes:
  held: {end: 1, positions: {hinge.angle: 30 deg}, trim: {find: [voltage, current]}, outputs: [hinge.angle, current.value]}
"""

OIL = """
cutjoint: 1
name: lift
gravity: [0, 0, -9.81]
parameters:
  area: {value: 12, unit: cm^2, binding: param}
  load: {value: 500, unit: kg, binding: param}
bodies:
  load: {mass: load, centre_of_mass: [0, 0, 0.8]}
joints:
  rod: {kind: prismatic, bodies: [ground, load], at: [0, 0, 0.8], axis: z}
forces:
  piston: {kind: joint_force, joint: rod, law: area*(below - above) - 2e4*rate}
states:
  below: {start: 0 bar, rate: "-1.4e9*rod.displacement_rate/(0.1 + rod.displacement)", nominal: 50 bar}
  above: {start: 0 bar, rate: "1.4e9*rod.displacement_rate/(0.5 - rod.displacement)", nominal: 50 bar}
outputs: [rod.displacement, below.value]
scenes:
  held: {end: 1, positions: {rod.displacement: 0.1}, states: {above: 1 bar}, trim: {find: [below]}}
"""

SPRING = """
cutjoint: 1
name: preloaded
gravity: [0, 0, -9.81]
parameters:
  preload: {value: 0, unit: N, binding: param}
bodies:
  mass: {mass: 40, centre_of_mass: [0, 0, 0.5]}
joints:
  way: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0.5], axis: z}
forces:
  spring:
    {kind: point_spring, bodies: [ground, mass], from: [0, 0, 0], to: [0, 0, 0.5], law: {stiffness: 2000, damping: 5, preload: preload}}
scenes:
  held: {end: 1, positions: {way.displacement: 50 mm}, trim: {find: [preload]}, outputs: [way.displacement, spring.force]}
"""

SLED = """
cutjoint: 1
name: sled
gravity: [0, 0, -9.81]
parameters:
  throttle: {value: 0, binding: input}
  target: {value: 20, unit: m/s, binding: param}
bodies:
  sled: {mass: 300, centre_of_mass: [0, 0, 0]}
joints:
  way: {kind: prismatic, bodies: [ground, sled], at: [0, 0, 0], axis: x}
forces:
  engine: {kind: joint_force, joint: way, law: 900*throttle - 0.7*rate*abs(rate)}
states:
  far: {start: 0 m, rate: way.displacement_rate}
outputs: [way.displacement, way.displacement_rate]
scenes:
  steady:
    end: 1
    trim: {find: [throttle], hold: {way.displacement_rate: target}, unsteady: [far], bounds: {throttle: [0, 1]}}
"""

FIVE_BAR = """
cutjoint: 1
name: five_bar
gravity: [0, 0, -9.81]
parameters:
  preload: {value: 0, unit: N, binding: param}
  moment: {value: 0, unit: N*m, binding: input}
points: {A: [0, 0, 0], B: [-0.2, 0, 0.4], C: [0.3, 0, 0.7], D: [0.8, 0, 0.4], E: [0.6, 0, 0], F: [0.3, 0, 0]}
bodies:
  ab: {mass: 2, centre_of_mass: {midpoint: [A, B]}, inertia: [0.02, 0.02, 0.02, 0, 0, 0]}
  bc: {mass: 3, centre_of_mass: {midpoint: [B, C]}, inertia: [0.03, 0.03, 0.03, 0, 0, 0]}
  cd: {mass: 3, centre_of_mass: {midpoint: [C, D]}, inertia: [0.03, 0.03, 0.03, 0, 0, 0]}
  de: {mass: 2, centre_of_mass: {midpoint: [D, E]}, inertia: [0.02, 0.02, 0.02, 0, 0, 0]}
joints:
  a: {kind: revolute, bodies: [ground, ab], at: A, axis: y}
  b: {kind: revolute, bodies: [ab, bc], at: B, axis: y}
  c: {kind: revolute, bodies: [bc, cd], at: C, axis: y}
  d: {kind: revolute, bodies: [cd, de], at: D, axis: y}
  e: {kind: revolute, bodies: [de, ground], at: E, axis: y}
forces:
  spring: {kind: point_spring, bodies: [ground, bc], from: F, to: C, law: {stiffness: 300, preload: preload}}
  motor: {kind: joint_force, joint: a, law: moment - rate}
scenes:
  held: {end: 1, trim: {find: [preload, moment], hold: {a.angle: 5 deg, spring.length: 0.69 m}}, outputs: [a.angle, b.angle, spring.length]}
"""

"""Machines in steady motion: coordinates that the equations do not contain run on, at constant speed."""

CONICAL = """
cutjoint: 1
name: conical
gravity: [0, 0, -9.81]
bodies:
  hub: {massless: true, centre_of_mass: [0, 0, 0]}
  bob: {mass: 2, centre_of_mass: [0, 0, -0.8]}
joints:
  bearing: {kind: revolute, bodies: [ground, hub], at: [0, 0, 0], axis: z}
  hinge: {kind: revolute, bodies: [hub, bob], at: [0, 0, 0], axis: -y}
outputs: [hinge.angle, bearing.angle_rate, bob.z]
scenes:
  circles: {end: 0.5, positions: {bearing.angle: 0, hinge.angle: 40 deg}, near: [hinge.angle], rates: {bearing.angle_rate: 5}, trim: {}}
"""

HOOP = """
cutjoint: 1
name: hoop
gravity: [0, 0, -9.81]
parameters: {speed: {value: 6, unit: rad/s, binding: param}}
bodies:
  hoop: {massless: true, centre_of_mass: [0, 0, 0]}
  bead: {mass: 0.3, centre_of_mass: [0, 0, -0.5]}
joints:
  bearing: {kind: revolute, bodies: [ground, hoop], at: [0, 0, 0], axis: z, guide: speed*t}
  way: {kind: revolute, bodies: [hoop, bead], at: [0, 0, 0], axis: -y}
forces: {rubs: {kind: joint_force, joint: way, law: -0.02*rate}}
outputs: [way.angle, bead.z]
scenes:
  turns: {end: 0.5, positions: {way.angle: 50 deg}, near: [way.angle], trim: {}}
"""

GOVERNOR = """
cutjoint: 1
name: governor
gravity: [0, 0, -9.81]
points: {O: [0, 0, 1], P: [0.15, 0, 0.8], Q: [-0.15, 0, 0.8], S: [0, 0, 0.6]}
bodies:
  shaft: {mass: 1, centre_of_mass: O, inertia: [0.02, 0.02, 0.02]}
  ball: {mass: 1.5, centre_of_mass: P}
  other: {mass: 1.5, centre_of_mass: Q}
  link: {massless: true, centre_of_mass: P}
  other_link: {massless: true, centre_of_mass: Q}
  sleeve: {mass: 4, centre_of_mass: S}
joints:
  bearing: {kind: revolute, bodies: [ground, shaft], at: O, axis: z}
  top: {kind: revolute, bodies: [shaft, ball], at: O, axis: -y}
  other_top: {kind: revolute, bodies: [shaft, other], at: O, axis: y}
  slide: {kind: prismatic, bodies: [shaft, sleeve], at: S, axis: z}
  knee: {kind: revolute, bodies: [ball, link], at: P, axis: y}
  other_knee: {kind: revolute, bodies: [other, other_link], at: Q, axis: y}
  foot: {kind: revolute, bodies: [link, sleeve], at: S, axis: y, cut: true}
  other_foot: {kind: revolute, bodies: [other_link, sleeve], at: S, axis: y, cut: true}
outputs: [sleeve.z, bearing.angle_rate, ball.z]
scenes:
  governs: {end: 0.5, positions: {bearing.angle: 0}, rates: {bearing.angle_rate: 15}, trim: {}}
"""

TOP = """
cutjoint: 1
name: top
gravity: [0, 0, -9.81]
bodies:
  outer: {massless: true, centre_of_mass: [0, 0, 0]}
  inner: {massless: true, centre_of_mass: [0, 0, 0]}
  top: {mass: 0.5, centre_of_mass: [0, 0, 0.06], inertia: [4e-4, 4e-4, 6e-4]}
joints:
  precession: {kind: revolute, bodies: [ground, outer], at: [0, 0, 0], axis: z}
  nutation: {kind: revolute, bodies: [outer, inner], at: [0, 0, 0], axis: y}
  spin: {kind: revolute, bodies: [inner, top], at: [0, 0, 0], axis: z}
outputs: [nutation.angle, precession.angle_rate, spin.angle_rate]
scenes:
  precesses:
    end: 0.5
    positions: {precession.angle: 0, nutation.angle: 30 deg, spin.angle: 0}
    rates: {precession.angle_rate: 4}
    trim: {find: [spin.angle_rate]}
"""

ROTOR = """
cutjoint: 1
name: rotor
gravity: [0, 0, 0]
bodies:
  fork: {massless: true, centre_of_mass: [0, 0, 0]}
  stub: {massless: true, centre_of_mass: [0, 0, 0]}
  disc: {mass: 3, centre_of_mass: [0, 0, 0], inertia: [0.02, 0.02, 0.035]}
joints:
  tilt: {kind: revolute, bodies: [ground, fork], at: [0, 0, 0], axis: x, spring: {stiffness: 500, damping: 0.3}}
  nod: {kind: revolute, bodies: [fork, stub], at: [0, 0, 0], axis: y, spring: {stiffness: 500, damping: 0.3}}
  spin: {kind: revolute, bodies: [stub, disc], at: [0, 0, 0], axis: z}
outputs: [tilt.angle, nod.angle, spin.angle_rate]
scenes:
  spins: {end: 0.2, positions: {spin.angle: 0}, rates: {spin.angle_rate: 300}, trim: {}}
"""

SHAFT = """
cutjoint: 1
name: jeffcott
gravity: [0, 0, 0]
parameters: {speed: {value: 80, unit: rad/s, binding: param}}
bodies:
  shaft: {massless: true, centre_of_mass: [0, 0, 0]}
  slider: {massless: true, centre_of_mass: [0, 0, 0]}
  disc: {mass: 4, centre_of_mass: [0.002, 0, 0], inertia: [0.1, 0.1, 0.2]}
joints:
  bearing: {kind: revolute, bodies: [ground, shaft], at: [0, 0, 0], axis: z, guide: speed*t}
  along: {kind: prismatic, bodies: [shaft, slider], at: [0, 0, 0], axis: x, spring: {stiffness: 1e4, damping: 20}}
  across: {kind: prismatic, bodies: [slider, disc], at: [0, 0, 0], axis: y, spring: {stiffness: 1e4, damping: 20}}
forces:
  air: {kind: load, body: disc, at: [0, 0, 0], force: [-30*vx, -30*vy, 0]}
outputs: [along.displacement, across.displacement]
scenes:
  whirls: {end: 0.2, trim: {}}
"""

CONVEYOR = """
cutjoint: 1
name: conveyor
gravity: [0, 0, -9.81]
parameters: {torque: {value: 0, unit: N*m, binding: input}}
bodies:
  drum: {mass: 20, centre_of_mass: [0, 0, 0], inertia: [0.3, 0.5, 0.3]}
  parcel: {mass: 6, centre_of_mass: [0, 0, 0.3]}
joints:
  bearing: {kind: revolute, bodies: [ground, drum], at: [0, 0, 0], axis: y}
  held: {kind: prismatic, bodies: [ground, parcel], at: [0, 0, 0.3], axis: x, spring: {stiffness: 800, damping: 5}}
forces:
  belt: {kind: joint_force, joint: held, law: rubs}
  back: {kind: joint_force, joint: bearing, law: torque - 0.2*rubs - 0.4*rate}
signals:
  rubs: "0.4*6*9.81*max(-1, min(1, (0.2*bearing.angle_rate - held.displacement_rate)/0.05))"
outputs: [held.displacement, bearing.angle_rate]
scenes:
  runs: {end: 0.5, positions: {bearing.angle: 0}, rates: {bearing.angle_rate: 7}, trim: {find: [torque]}}
"""

FAN = """
cutjoint: 1
name: fan
gravity: [0, 0, -9.81]
parameters: {voltage: {value: 24, unit: V, binding: input}}
bodies:
  rotor: {mass: 0.4, centre_of_mass: [0, 0, 0], inertia: [1e-3, 1e-3, 2e-3]}
joints:
  bearing: {kind: revolute, bodies: [ground, rotor], at: [0, 0, 0], axis: z}
states:
  current: {start: 0 A, rate: "(voltage - 0.8*current - 0.1*bearing.angle_rate)/0.002"}
forces:
  motor: {kind: joint_force, joint: bearing, law: "0.1*current - 2e-5*rate*abs(rate)"}
outputs: [bearing.angle_rate, current.value]
scenes:
  blows: {end: 0.5, positions: {bearing.angle: 0}, trim: {find: [bearing.angle_rate]}}
"""

HELICOPTER = """
cutjoint: 1
name: helicopter
gravity: [0, 0, -9.81]
parameters:
  thrust: {value: 20, unit: kN, binding: input}
  cyclic: {value: 0, unit: N*m, binding: input}
  speed: {value: 30, unit: m/s, binding: param}
bodies:
  hull: {mass: 2000, centre_of_mass: [0, 0, 0], inertia: [1500, 6000, 5000]}
  rope: {massless: true, centre_of_mass: [0.2, 0, -1]}
  load: {mass: 400, centre_of_mass: [0.2, 0, -13]}
joints:
  moves: {kind: free, bodies: [ground, hull], at: [0, 0, 0]}
  hook: {kind: universal, bodies: [hull, rope], at: [0.2, 0, -1], axis: x, axis_2: y}
  hoist: {kind: prismatic, bodies: [rope, load], at: [0.2, 0, -13], axis: -z, guide: 0}
forces:
  rotor: {kind: load, body: hull, at: [0, 0, 0], axes: body, force: [0, 0, thrust]}
  stick: {kind: load, body: hull, axes: body, torque: [0, cyclic, 0]}
  drag: {kind: load, body: hull, at: [0, 0, 0], force: ["-1.2*vx*abs(vx)", 0, 0]}
  load_drag: {kind: load, body: load, at: [0.2, 0, -13], force: ["-0.9*vx*abs(vx)", 0, 0]}
outputs: [hull.pitch, hull.vx, load.x, load.z, hull.x]
scenes:
  cruises:
    end: 0.5
    positions: {moves.x: 0, moves.y: 0, moves.z: 0}
    rates: {moves.vx: speed}
    trim: {find: [thrust, cyclic], hold: {hull.yaw: 0}}
"""

#: A motorcycle of four bodies on two wheels whose forces its file has: slip, slip angle, camber, deflection.
SIMPLE_MOTORCYCLE = """
cutjoint: 1
name: motorcycle
gravity: [0, 0, -9.81]
parameters:
  drive: {value: 0, unit: N*m, binding: input}
  bars: {value: 0, unit: N*m, binding: input}
  lateral: {value: 4, unit: m/s^2, binding: param}
points: {R: [-0.6, 0, 0.3], F: [0.8, 0, 0.3], S: [0.5, 0, 0.9], T: [0.72, 0, 0.32]}
bodies:
  frame: {mass: 240, centre_of_mass: [0, 0, 0.6], inertia: [15, 30, 25]}
  fork: {mass: 12, centre_of_mass: [0.65, 0, 0.5], inertia: [0.5, 0.5, 0.2]}
  rear: {mass: 12, centre_of_mass: R, inertia: [0.3, 0.6, 0.3]}
  front: {mass: 10, centre_of_mass: F, inertia: [0.25, 0.5, 0.25]}
joints:
  moves: {kind: free, bodies: [ground, frame], at: [0, 0, 0.6]}
  head: {kind: revolute, bodies: [frame, fork], at: S, axis: {from: T, to: S}}
  rear_axle: {kind: revolute, bodies: [frame, rear], at: R, axis: y}
  front_axle: {kind: revolute, bodies: [fork, front], at: F, axis: y}
forces:
  bar_torque: {kind: joint_force, joint: head, law: bars - 2*rate}
  chain: {kind: joint_force, joint: rear_axle, law: drive}
  rear_tyre: &tyre
    kind: wheel
    body: rear
    centre: R
    axis: y
    radius: 0.3
    force: [40000*(0.3*spin - vx)/vx, -20000*vy/vx - 1500*camber, 1.5e5*deflection + 300*deflection_rate]
    moment: [0, 0, 400*vy/vx]
  front_tyre: {<<: *tyre, body: front, centre: F}
outputs: [frame.roll, frame.pitch, frame.yaw, frame.wz, frame.z, head.angle]
scenes:
  leans:
    end: 0.5
    positions: {moves.x: 0, moves.y: 0, rear_axle.angle: 0, front_axle.angle: 0}
    rates: {moves.vx: 15, rear_axle.angle_rate: 50, front_axle.angle_rate: 50}
    trim: {find: [drive, bars, moves.wz, rear_axle.angle_rate, front_axle.angle_rate], hold: {frame.ay: lateral,
          frame.wz*15: lateral}, unsteady: [moves.vy]}
"""

#: A hovercraft-like body, carried by springs at its corners, whose side forces follow from velocities in its own axes.
PLANAR_CAR = """
cutjoint: 1
name: planar
gravity: [0, 0, -9.81]
parameters:
  drive: {value: 0, unit: N, binding: input}
  steer: {value: 0, binding: input}
points: {F: [1.1, 0, 0], R: [-1.4, 0, 0], A: [1, 1, 0], B: [1, -1, 0], C: [-1, 1, 0], D: [-1, -1, 0]}
bodies:
  car: {mass: 1200, centre_of_mass: [0, 0, 0], inertia: [400, 1600, 1750]}
joints:
  moves: {kind: free, bodies: [ground, car], at: [0, 0, 0]}
forces:
  front: {kind: load, body: car, at: F, axes: body, force: [0, "-80000*(vy/15 - steer)", 0]}
  rear: {kind: load, body: car, at: R, axes: body, force: ["drive - 50*vx", "-90000*vy/15", 0]}
  a: &corner {kind: load, body: car, at: A, force: [0, 0, 1200*9.81/4 - 5e4*z - 2e3*vz]}
  b: {<<: *corner, at: B}
  c: {<<: *corner, at: C}
  d: {<<: *corner, at: D}
outputs: [car.yaw, car.wz]
scenes:
  turns:
    end: 0.5
    positions: {moves.x: 0, moves.y: 0}
    rates: {moves.vx: 15, moves.vy: 0}
    trim: {find: [drive, steer, moves.wz], hold: {car.ay: 5 m/s^2, car.wz*15: 5 m/s^2}, unsteady: [moves.vy]}
"""

#: A car of the library on a circle at 20 m/s: LATERAL in m/s^2, with guesses of the steering wheel's angle and of the yaw rate.
LIBRARY_CAR = """
cutjoint: 1
name: my_car
gravity: [0, 0, -9.81]
parameters:
  drive: {value: 0, unit: N*m, binding: input}
  wheel_angle: {value: 0, unit: rad, binding: input}
  lateral: {value: LATERAL, unit: m/s^2, binding: param}
bodies:
  chassis: {mass: 1100, centre_of_mass: [0, 0, 0.55], inertia: [400, 1500, 1650]}
joints:
  moves: {kind: free, bodies: [ground, chassis], at: [0, 0, 0.55]}
submodels:
  strut: {include: library/macpherson}
  links: {include: library/five_link}
  wheel: {include: library/wheel_mf62}
  steering: {include: library/rack_steering}
  bar: {include: library/anti_roll_bar}
  brakes: {include: library/brakes}
  air: {include: library/aero}
  shaft: {include: library/shaft}
  front:
    connectors: [chassis, rack]
    parameters: [brake]
    instances:
      strut: {use: strut, connect: {chassis: chassis, steering: rack}, with: {x: 1.2, y: 0.72, z: 0.3}}
      wheel: {use: wheel, connect: {carrier: strut.carrier}, with: {x: 1.2, y: 0.72, z: 0.3, brake: brake},
              properties: library/road_tyre.tir}
  rear:
    connectors: [chassis]
    parameters: [brake, drive]
    instances:
      links: {use: links, connect: {chassis: chassis, steering: chassis}, with: {x: -1.2, y: 0.72, z: 0.3}}
      wheel: {use: wheel, connect: {carrier: links.carrier}, with: {x: -1.2, y: 0.72, z: 0.3, brake: brake, drive: drive},
              properties: library/road_tyre.tir}
      shaft: {use: shaft, connect: {base: chassis, carrier: links.carrier}, with: {torque: drive}}
instances:
  fl: &front {use: front, connect: {chassis: chassis, rack: steering.rack}, with: {brake: brakes.front}}
  fr: {<<: *front, mirror: y}
  rl: {use: rear, connect: {chassis: chassis}, with: {brake: brakes.rear, drive: drive}}
  rr: {use: rear, connect: {chassis: chassis}, with: {brake: brakes.rear, drive: drive}, mirror: y}
  steering: {use: steering, connect: {chassis: chassis}, with: {angle: wheel_angle},
             points: {middle: [1.07, 0, 0.24]}}
  bar:
    {use: bar, connect: {chassis: chassis, left: fl.strut.arm, right: fr.strut.arm},
     points: {left_end: [1.2, 0.52, 0.234], left_foot: [1.2, 0.52, 0.194],
              right_end: [1.2, -0.52, 0.234], right_foot: [1.2, -0.52, 0.194]}}
  brakes: {use: brakes, with: {pedal: 0}}
  air: {use: air, connect: {chassis: chassis}}
outputs: [chassis.wz, chassis.roll, chassis.z]
scenes:
  circle:
    end: 0.5
    output_step: 0.1
    rates: {moves.vx: 20, moves.wz: RATE}
    inputs: {wheel_angle: WHEEL}
    positions: {moves.x: 0, moves.y: 0}
    trim:
      find: [drive, wheel_angle, moves.wz, fl.wheel.rolling.bearing.angle_rate, fr.wheel.rolling.bearing.angle_rate,
             rl.wheel.rolling.bearing.angle_rate, rr.wheel.rolling.bearing.angle_rate]
      hold: {chassis.ay: lateral, chassis.wz*chassis.vx: lateral}
      unsteady: [moves.vy]
"""

"""Machines as their users write them, with scenes whose starts are trimmed."""

LOADER = """
cutjoint: 1
name: loader
gravity: [0, 0, -9.81]
parameters:
  bore: {value: 50, unit: cm^2, binding: param}
  annulus: {value: 30, unit: cm^2, binding: param}
  bulk: {value: 1.4e9, unit: Pa}
  payload: {value: 1500, unit: kg, binding: param}
  spool: {value: 0, binding: input}
points: {A: [0, 0, 1.8], B: [2.8, 0, 1.2], C: [0.3, 0, 0.8], D: [1.4, 0, 1.3]}
bodies:
  boom: {mass: 700, centre_of_mass: {midpoint: [A, B]}, inertia: [40, 600, 600]}
  bucket: {mass: payload, centre_of_mass: B}
  tube: {mass: 40, centre_of_mass: C, inertia: [4, 4, 1]}
  rod: {mass: 30, centre_of_mass: D, inertia: [4, 4, 1]}
joints:
  foot: {kind: revolute, bodies: [ground, boom], at: A, axis: -y}
  hang: {kind: fixed, bodies: [boom, bucket], at: B}
  base: {kind: revolute, bodies: [ground, tube], at: C, axis: -y}
  slide: {kind: prismatic, bodies: [tube, rod], at: C, axis: {from: C, to: D}}
  eye: {kind: revolute, bodies: [rod, boom], at: D, axis: -y}
forces:
  oil: {kind: joint_force, joint: slide, law: bore*head - annulus*rod_side - 5000*rate}
states:
  head: {start: 0 bar, rate: "bulk*(flow_in - bore*slide.displacement_rate)/(bore*(0.2 + slide.displacement))", nominal: 100 bar}
  rod_side: {start: 0 bar, rate: "bulk*(-flow_out + annulus*slide.displacement_rate)/(annulus*(0.9 - slide.displacement))",
        nominal: 100 bar}
signals:
  flow_in: 1e-10*spool*(200e5 - head) - 3e-13*(head - rod_side)
  flow_out: 1e-10*spool*rod_side - 3e-13*(head - rod_side)
outputs: [foot.angle, head.value, rod_side.value, oil.force]
scenes:
  hold: {end: 0.5, positions: {foot.angle: 20 deg}, trim: {find: [head]}}
  fed: {end: 0.5, positions: {foot.angle: 20 deg}, states: {rod_side: 20 bar}, trim: {find: [head], unsteady: [head, rod_side]}}
"""

CRANE = """
cutjoint: 1
name: crane
gravity: [0, 0, -9.81]
parameters:
  slewing: {value: 0, unit: rad, binding: input}
  luffing: {value: 0, unit: N*m, binding: input}
  length: {value: 5, unit: m, binding: input}
points: {foot: [0, 0, 3], tip: [8, 0, 9], hook: [8, 0, 4]}
bodies:
  tower: {mass: 3000, centre_of_mass: [0, 0, 1.5], inertia: [2000, 2000, 800]}
  boom: {shapes: [{rod: {from: foot, to: tip}, mass: 900}]}
  rope: {massless: true, centre_of_mass: tip}
  load: {mass: 1500, centre_of_mass: hook}
joints:
  slew: {kind: revolute, bodies: [ground, tower], at: [0, 0, 0], axis: z, guide: slewing}
  luff: {kind: revolute, bodies: [tower, boom], at: foot, axis: -y}
  swing: {kind: universal, bodies: [boom, rope], at: tip, axis: x, axis_2: y}
  hoist: {kind: prismatic, bodies: [rope, load], at: hook, axis: -z, guide: length - 5}
forces:
  luffer: {kind: joint_force, joint: luff, law: luffing - 1000*rate}
reactions:
  tension: {joint: hoist, axes_of: rope}
outputs: [slew.angle, luff.angle, load.x, load.y, load.z, tension.Fz]
scenes:
  rest: {end: 0.5, trim: {find: [luffing], hold: {load.z: 5 m}}}
  slewing: {end: 0.5, positions: {luff.angle: 10 deg}, inputs: {slewing: 0.5*t}, trim: {find: [luffing]}}
"""

PRESS_BRAKE = """
cutjoint: 1
name: press_brake
gravity: [0, 0, -9.81]
parameters:
  push: {value: 0, unit: kN, binding: input}
  stiffness: {value: 2e8, unit: N/m, binding: param}
points: {O: [0, 0, 2], K: [0.1, 0, 1.5], R: [0, 0, 1.0], W: [0.8, 0, 1.5], T: [0, 0, 0.5]}
bodies:
  upper: {mass: 80, centre_of_mass: {midpoint: [O, K]}, inertia: [2, 2, 0.2]}
  lower: {mass: 80, centre_of_mass: {midpoint: [K, R]}, inertia: [2, 2, 0.2]}
  ram: {mass: 600, centre_of_mass: R}
joints:
  top: {kind: revolute, bodies: [ground, upper], at: O, axis: y}
  knee: {kind: revolute, bodies: [upper, lower], at: K, axis: y}
  wrist: {kind: revolute, bodies: [lower, ram], at: R, axis: y}
  guide: {kind: prismatic, bodies: [ground, ram], at: R, axis: -z}
forces:
  cylinder: {kind: point_spring, bodies: [ground, upper], from: W, to: K, law: "-push - 2000*rate"}
  work: {kind: joint_force, joint: guide, law: {stop: {at: 4 mm, side: above, stiffness: 2e8, damping: 1e4}}}
outputs: [guide.displacement, top.angle, work.force, cylinder.force]
scenes:
  bend: {end: 0.2, trim: {find: [push], hold: {work.force: -400 kN}}}
"""

CLOCK = """
cutjoint: 1
name: clock
gravity: [0, 0, -9.81]
parameters: {bob_at: {value: 0.9, unit: m, binding: param}, tension: {value: 0, unit: N*m, binding: param}}
bodies:
  rod: {mass: 0.2, centre_of_mass: [0, 0, -0.5], inertia: [0.02, 0.02, 0.0001]}
  bob: {mass: 3, centre_of_mass: [0, 0, -0.9], inertia: [0.01, 0.01, 0.01]}
  wheel: {mass: 0.3, centre_of_mass: [0, 0.1, 0.1], inertia: [1e-4, 2e-4, 1e-4]}
joints:
  pivot: {kind: revolute, bodies: [ground, rod], at: [0, 0, 0], axis: y}
  nut: {kind: prismatic, bodies: [rod, bob], at: [0, 0, -0.9], axis: -z, guide: bob_at - 0.9}
  arbor: {kind: revolute, bodies: [ground, wheel], at: [0, 0.1, 0.1], axis: y}
forces:
  pallet: {kind: joint_force, joint: pivot, law: "2*max(0, arbor.angle - pivot.angle)"}
  drive: {kind: joint_force, joint: arbor, law: "tension - 2*max(0, arbor.angle - pivot.angle) - 0.01*rate"}
outputs: [pivot.angle, arbor.angle, pivot.angle_rate]
scenes:
  stopped: {end: 0.5, positions: {pivot.angle: 3 deg}, trim: {find: [tension]}}
"""

QUARTER_CAR = """
cutjoint: 1
name: quarter
gravity: [0, 0, -9.81]
parameters: {preload: {value: 0, unit: N, binding: param}}
bodies:
  wheel: {mass: 40, centre_of_mass: [0, 0, 0.3]}
  body: {mass: 350, centre_of_mass: [0, 0, 0.8]}
joints:
  hub: {kind: prismatic, bodies: [ground, wheel], at: [0, 0, 0.3], axis: z}
  strut: {kind: prismatic, bodies: [wheel, body], at: [0, 0, 0.8], axis: z}
forces:
  spring: {kind: joint_force, joint: strut, law: {stiffness: 20 kN/m, damping: 1500, preload: preload}}
  tyre: {kind: contact, bodies: [ground, wheel], at: [0, 0, 0], normal: z, centre: [0, 0, 0.3], radius: 0.3, force: [0, 0,
        "2e5*deflection"]}
outputs: [hub.displacement, strut.displacement, spring.force, tyre.Fz, body.z]
scenes:
  ride: {end: 0.5, trim: {find: [preload], hold: {body.z: 0.8 m}}}
"""

CAR = """
cutjoint: 1
name: skid
gravity: [0, 0, -9.81]
parameters:
  drive: {value: 0, unit: N*m, binding: input}
  steer: {value: 0, unit: rad, binding: input}
  lateral: {value: 4, unit: m/s^2, binding: param}
  speed: {value: 20, unit: m/s, binding: param}
bodies:
  chassis: {mass: 1200, centre_of_mass: [0, 0, 0.5], inertia: [400, 1600, 1750]}
joints:
  moves: {kind: free, bodies: [ground, chassis], at: [0, 0, 0.5]}
submodels:
  wheel: {include: library/wheel_brush}
  corner:
    connectors: [chassis]
    parameters: [x, y, drive, angle, c]
    points: {C: [x, y, 0.3]}
    bodies:
      slider: {mass: 15, centre_of_mass: C, inertia: [0.3, 0.3, 0.3]}
      knuckle: {mass: 15, centre_of_mass: C, inertia: [0.3, 0.3, 0.3]}
    joints:
      travel: {kind: prismatic, bodies: [chassis, slider], at: C, axis: z}
      turn: {kind: revolute, bodies: [slider, knuckle], at: C, axis: z, guide: angle}
    forces:
      spring: {kind: joint_force, joint: travel, law: -3000 - 30000*position - 2500*rate}
    instances:
      w: {use: wheel, connect: {carrier: knuckle}, with: {x: x, y: y, z: 0.3, drive: drive, radius: 0.3, mass: 15, spin_inertia: 1,
            cross_inertia: 0.6,
          stiffness: 2e5, slip_stiffness: 60000, cornering_stiffness: c, linear: 1, half_length: 0}}
instances:
  fl: {use: corner, connect: {chassis: chassis}, with: {x: 1.1, y: 0.7, drive: 0, angle: steer, c: 40000}}
  fr: {use: corner, connect: {chassis: chassis}, with: {x: 1.1, y: -0.7, drive: 0, angle: steer, c: 40000}}
  rl: {use: corner, connect: {chassis: chassis}, with: {x: -1.4, y: 0.7, drive: drive, angle: 0, c: 45000}}
  rr: {use: corner, connect: {chassis: chassis}, with: {x: -1.4, y: -0.7, drive: drive, angle: 0, c: 45000}}
outputs: [chassis.x, chassis.y, chassis.vx, chassis.ay, chassis.wz, chassis.yaw, chassis.roll, fl.w.rolling.contact.Fy,
      fl.w.rolling.contact.Fz, fr.w.rolling.contact.Fz]
scenes:
  turn:
    end: 0.5
    positions: {moves.x: 0, moves.y: 0}
    rates: {moves.vx: speed, fl.w.rolling.bearing.angle_rate: speed/0.3, fr.w.rolling.bearing.angle_rate: speed/0.3,
          rl.w.rolling.bearing.angle_rate: speed/0.3, rr.w.rolling.bearing.angle_rate: speed/0.3}
    states: {fl.w.rolling.rolled: 1, fr.w.rolling.rolled: 1, rl.w.rolling.rolled: 1, rr.w.rolling.rolled: 1}
    trim: {find: [drive, steer, moves.wz, fl.w.rolling.bearing.angle_rate, fr.w.rolling.bearing.angle_rate,
          rl.w.rolling.bearing.angle_rate, rr.w.rolling.bearing.angle_rate], hold: {chassis.ay: lateral, chassis.wz*speed: lateral},
          unsteady: [moves.vy]}
  stands: {end: 0.5, trim: {}}
"""

MOTORCYCLE = """
cutjoint: 1
name: motorcycle
gravity: [0, 0, -9.81]
parameters:
  drive: {value: 0, unit: N*m, binding: input}
  bars: {value: 0, unit: N*m, binding: input}
  speed: {value: 15, unit: m/s, binding: param}
  lateral: {value: 4, unit: m/s^2, binding: param}
points: {R: [-0.6, 0, 0.3], F: [0.8, 0, 0.3], S: [0.5, 0, 0.9], T: [0.72, 0, 0.32]}
bodies:
  frame: {mass: 240, centre_of_mass: [0, 0, 0.6], inertia: [15, 30, 25]}
  fork: {mass: 12, centre_of_mass: [0.65, 0, 0.5], inertia: [0.5, 0.5, 0.2]}
joints:
  moves: {kind: free, bodies: [ground, frame], at: [0, 0, 0.6]}
  head: {kind: revolute, bodies: [frame, fork], at: S, axis: {from: T, to: S}}
forces:
  bar_torque: {kind: joint_force, joint: head, law: bars - 2*rate}
submodels:
  wheel: {include: library/wheel_brush}
instances:
  rear: {use: wheel, connect: {carrier: frame}, with: {x: -0.6, y: 0, z: 0.3, drive: drive, radius: 0.3, mass: 12, spin_inertia: 0.6,
        cross_inertia: 0.3,
     stiffness: 1.5e5, damping: 300, slip_stiffness: 40000, cornering_stiffness: 20000, linear: 1}}
  front: {use: wheel, connect: {carrier: fork}, with: {x: 0.8, y: 0, z: 0.3, radius: 0.3, mass: 10, spin_inertia: 0.5,
        cross_inertia: 0.25,
     stiffness: 1.5e5, damping: 300, slip_stiffness: 40000, cornering_stiffness: 20000, linear: 1}}
outputs: [frame.x, frame.y, frame.roll, frame.yaw, frame.pitch, frame.ay, frame.wz, head.angle, rear.rolling.contact.Fz,
      front.rolling.contact.Fz]
scenes:
  leans: &leans
    end: 0.5
    positions: {moves.x: 0, moves.y: 0}
    rates: {moves.vx: speed}
    trim: {find: [drive, bars, moves.wz, rear.rolling.bearing.angle_rate, front.rolling.bearing.angle_rate], hold: {frame.ay: lateral,
          frame.wz*speed: lateral}, unsteady: [moves.vy]}
  by_angle:
    <<: *leans
    trim: {find: [drive, bars, moves.wz, rear.rolling.bearing.angle_rate, front.rolling.bearing.angle_rate], hold: {frame.roll: 20 deg,
          frame.ay - frame.wz*speed: 0}, unsteady: [moves.vy]}
"""

TRUCK = """
cutjoint: 1
name: truck
gravity: [0, 0, -9.81]
parameters:
  drive: {value: 0, unit: N*m, binding: input}
  speed: {value: 20, unit: m/s, binding: param}
bodies:
  tractor: {mass: 7000, centre_of_mass: [1.5, 0, 1.0], inertia: [6000, 30000, 30000]}
  trailer: {mass: 20000, centre_of_mass: [-5, 0, 1.8], inertia: [30000, 250000, 250000]}
joints:
  moves: {kind: free, bodies: [ground, tractor], at: [1.5, 0, 1.0]}
  fifth_wheel: {kind: spherical, bodies: [tractor, trailer], at: [0, 0, 1.2]}
forces:
  drag: {kind: load, body: tractor, at: [2, 0, 1.5], force: ["-3*vx*abs(vx)", 0, 0]}
  drag_2: {kind: load, body: trailer, at: [-5, 0, 2], force: ["-2*vx*abs(vx)", 0, 0]}
submodels:
  wheel: {include: library/wheel_brush}
  axle:
    connectors: [chassis]
    parameters: [x, drive, load]
    points: {C: [x, 0, 0.5]}
    bodies:
      heave: {massless: true, centre_of_mass: C}
      beam: {mass: 500, centre_of_mass: C, inertia: [300, 20, 300]}
    joints:
      travel: {kind: prismatic, bodies: [chassis, heave], at: C, axis: z}
      roll: {kind: revolute, bodies: [heave, beam], at: C, axis: x}
    forces:
      spring: {kind: joint_force, joint: travel, law: -load - 6e5*position - 4e4*rate}
      roll_spring: {kind: joint_force, joint: roll, law: -5e5*position - 2e4*rate}
    instances:
      l: {use: wheel, connect: {carrier: beam}, with: {x: x, y: 0.95, z: 0.5, drive: drive, radius: 0.5, mass: 80, spin_inertia: 10,
            cross_inertia: 6,
          stiffness: 1e6, slip_stiffness: 400000, cornering_stiffness: 200000, resistance: 0.006, damping: 2000}}
      r: {use: wheel, connect: {carrier: beam}, with: {x: x, y: -0.95, z: 0.5, drive: drive, radius: 0.5, mass: 80, spin_inertia: 10,
            cross_inertia: 6,
          stiffness: 1e6, slip_stiffness: 400000, cornering_stiffness: 200000, resistance: 0.006, damping: 2000}}
instances:
  front: {use: axle, connect: {chassis: tractor}, with: {x: 3, drive: 0, load: 50000}}
  rear: {use: axle, connect: {chassis: tractor}, with: {x: -0.6, drive: drive, load: 100000}}
  t1: {use: axle, connect: {chassis: trailer}, with: {x: -7, drive: 0, load: 45000}}
  t2: {use: axle, connect: {chassis: trailer}, with: {x: -8.3, drive: 0, load: 45000}}
  t3: {use: axle, connect: {chassis: trailer}, with: {x: -9.6, drive: 0, load: 45000}}
outputs: [tractor.x, tractor.vx, tractor.z, trailer.z, tractor.pitch, front.l.rolling.contact.Fz, rear.l.rolling.contact.Fz]
scenes:
  cruise:
    end: 0.1
    positions: {moves.x: 0, moves.y: 0}
    rates: {moves.vx: speed, front.l.rolling.bearing.angle_rate: speed/0.5, front.r.rolling.bearing.angle_rate: speed/0.5,
          rear.l.rolling.bearing.angle_rate: speed/0.5, rear.r.rolling.bearing.angle_rate: speed/0.5,
          t1.l.rolling.bearing.angle_rate: speed/0.5, t1.r.rolling.bearing.angle_rate: speed/0.5,
          t2.l.rolling.bearing.angle_rate: speed/0.5, t2.r.rolling.bearing.angle_rate: speed/0.5,
          t3.l.rolling.bearing.angle_rate: speed/0.5, t3.r.rolling.bearing.angle_rate: speed/0.5}
    states: {front.l.rolling.rolled: 1, front.r.rolling.rolled: 1, rear.l.rolling.rolled: 1, rear.r.rolling.rolled: 1,
          t1.l.rolling.rolled: 1, t1.r.rolling.rolled: 1, t2.l.rolling.rolled: 1, t2.r.rolling.rolled: 1, t3.l.rolling.rolled: 1,
          t3.r.rolling.rolled: 1}
    trim: {find: [drive, front.l.rolling.bearing.angle_rate, front.r.rolling.bearing.angle_rate, rear.l.rolling.bearing.angle_rate,
          rear.r.rolling.bearing.angle_rate, t1.l.rolling.bearing.angle_rate, t1.r.rolling.bearing.angle_rate,
          t2.l.rolling.bearing.angle_rate, t2.r.rolling.bearing.angle_rate, t3.l.rolling.bearing.angle_rate,
          t3.r.rolling.bearing.angle_rate]}
"""

TABLE = """
cutjoint: 1
name: table
gravity: [0, 0, -9.81]
parameters: {k: {value: 1e7, binding: param}, gap: {value: 0, unit: m}}
bodies: {top: {mass: 20, centre_of_mass: [0.05, 0.02, 0.7], inertia: [2, 2, 3]}}
joints: {moves: {kind: free, bodies: [ground, top], at: [0, 0, 0.7]}}
submodels:
  contact_law: {include: library/contact_law}
  leg:
    connectors: [top]
    parameters: [x, y]
    points: {P: [x, y, gap]}
    forces: {sole: {kind: contact, bodies: [ground, top], at: [0, 0, 0], normal: z, centre: P, force: [grip.Fx, grip.Fy, grip.Fz]}}
    instances:
      grip:
        use: contact_law
        with: {deflection: sole.deflection, deflection_rate: sole.deflection_rate, vx: sole.vx, vy: sole.vy,
          stiffness: k, exponent: 1.5, damping: 0.5, friction: 0.6}
instances:
  a: {use: leg, connect: {top: top}, with: {x: 0.5, y: 0.3}}
  b: {use: leg, connect: {top: top}, with: {x: 0.5, y: -0.3}}
  c: {use: leg, connect: {top: top}, with: {x: -0.5, y: 0.3}}
  d: {use: leg, connect: {top: top}, with: {x: -0.5, y: -0.3}}
outputs: [top.x, top.y, top.z, top.yaw, top.roll, top.pitch]
scenes:
  rest: {end: 0.5, trim: {}}
"""

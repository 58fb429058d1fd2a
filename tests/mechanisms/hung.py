"""A mechanism whose bodies stand in all attitudes, and are outputs."""

_QUANTITIES = ("x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "wx", "wy", "wz")

_OUTPUTS = {**dict.fromkeys(("carriage", "top", "bar"), _QUANTITIES), "tip": ("x", "y", "z", "vx", "vy", "vz")}

#: A carriage that an input guides along a slope, a top that hangs on it by a ball, a bar of parametric reach that hinges on the top.
HUNG = f"""
cutjoint: 1
name: hung
gravity: [0, 0, -9.81]
parameters:
  place: {{value: 0, unit: m, binding: input}}
  reach: {{value: 0.3, unit: m, binding: param}}
bodies:
  carriage: {{mass: 1, centre_of_mass: [0, 0, 0.1]}}
  top: {{mass: 2, centre_of_mass: [0.1, 0.05, -0.4], inertia: [0.02, 0.03, 0.01]}}
  bar: {{mass: 1, centre_of_mass: [0.1 + reach, 0, -0.5], inertia: [0.001, 0.02, 0.02]}}
joints:
  rail: {{kind: prismatic, bodies: [ground, carriage], at: [0, 0, 0], axis: [1, 0, 0.5], guide: place}}
  ball: {{kind: spherical, bodies: [carriage, top], at: [0, 0, 0]}}
  pin: {{kind: revolute, bodies: [top, bar], at: [0.1, 0, -0.5], axis: [0, 1, 0.2]}}
markers:
  tip: {{body: bar, at: [0.5, 0, -0.5]}}
outputs: [{", ".join(f"{name}.{q}" for name, known in _OUTPUTS.items() for q in known)}]
scenes:
  swing: {{inputs: {{place: 0.2*sin(3*t)}}, rates: {{ball.wz: 2, pin.angle_rate: 3}}, end: 1}}
"""

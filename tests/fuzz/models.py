"""Model files: valid ones with random subsets of all features, and mutations of these."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from typing import Any

from cutjoint.elements.joints import JOINTS

from .odd import ODD_NAMES

Node = dict[str, Any]

#: A value for each field that kinds of joints have of their own, two for those that must be perpendicular.
FIELDS = {"axis": [1, 0, 0], "axis_2": [0, 1, 0], "to": [5, 5, 5]}
KINDS = tuple(map(str, JOINTS))
SINGLE = tuple(str(kind) for kind, joint in JOINTS.items() if joint.can_be_guided and len(joint.coordinates) == 1)
COORDINATES = {str(kind): joint.coordinates for kind, joint in JOINTS.items()}

#: Quantities of forces.
_REPORTS = {
    "point_spring": ("force", "length", "rate"), "axial_force": ("travel", "force"), "load": ("Fx",), "bushing": ("dx", "My"),
    "joint_force": ("force", "stiffness"), "tyre": ("Fz", "slip"),
    "wheel": ("Fx", "spin"), "joint_friction": ("force", "load"), "contact": ("Fz", "vx"),
}  # fmt: skip


class Maker:
    """Makes the document of one valid model."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        self.names: set[str] = set()
        self.bodies: list[str] = []
        self.joints: dict[str, Node] = {}

    def chance(self, p: float = 0.5) -> bool:
        return self.rng.random() < p

    def name(self, stem: str) -> str:
        """A name that is not taken, now and then an odd one."""
        free = [n for n in ODD_NAMES if n not in self.names]
        name = self.rng.choice(free) if self.chance(0.15) else f"{stem}_{len(self.names)}"
        self.names.add(name)
        return name

    def number(self, low: float = -1.0, high: float = 1.0) -> Any:
        """A number, or an expression over the parameters that scale it."""
        x = round(self.rng.uniform(low, high), self.rng.choice((1, 3, 15))) or 0.25
        return self.rng.choice((x, x, x, f"{x!r}*size", f"{x!r}*ratio", f"{x!r}*half", f"max({x!r}, {x!r}*size)" if x > 0 else x))

    def triple(self) -> list[Any]:
        return [self.number() for _ in range(3)]

    def axis(self) -> list[float]:
        return self.rng.choice(([1, 0, 0], [0, 1, 0], [0, 0, -1], [1, 2, 3], [0.3, -0.4, 0.5]))

    def point(self) -> Any:
        along, multiple = {"along": self.axis(), "by": "half"}, {"from": "origin", "to": "tip", "times": self.number()}
        way = self.rng.choice((self.triple(), along, multiple))
        return self.rng.choice(("origin", "tip", self.triple(), {"midpoint": ["origin", "tip"]}, {"sum": ["tip", way]}))

    def body(self) -> str:
        name = self.name("body")
        self.bodies.append(name)
        return name

    def body_part(self) -> Node:
        mass = self.rng.choice((2, "weight", "3 kg", "load"))
        kind = self.rng.randrange(7)
        if kind == 0:
            return {"shapes": [{"box": [0.4, "0.2*size", 0.1], "density": 500, "at": self.point()}, {"point": self.point(), "mass": mass}]}
        centre = {"mass": mass, "centre_of_mass": self.point()}
        if kind == 1:
            return {**centre, "inertia": {"principal": [0.3, 0.4, 0.5], "x": [1, 2, 0], "y": [-2, 1, 0]}}
        if kind == 2:
            return {
                **centre,
                "inertia": [0.3, 0.4, 0.5, 0.01, -0.02, 0.03],
                **({"about": centre["centre_of_mass"]} if self.chance() else {}),
            }
        if kind == 3:
            return {"massless": True, "inertia": {"axial": "0.3*size", "axis": self.axis()}}
        if kind == 4:
            return {**centre, "inertia": {"principal": ["0.3*size", 0.4, 0.4], "x": self.axis(), "z": "any"}}
        return {**centre, "inertia": ["0.3*size", "0.4*size", "0.5*size"]}

    def joint(self, kind: str, base: str, follower: str, **more: Any) -> str:
        name, part = self.name("joint"), {"kind": kind, "bodies": [base, follower], "at": self.triple(), **more}
        if self.chance(0.4):
            part["bodies"].reverse()
        fields = [field.name for field in JOINTS[kind].fields]
        part |= {name: FIELDS[name] for name in fields if name in FIELDS}
        if "axis" in fields and "axis_2" not in fields:
            part["axis"] = self.axis()
        if "pitch" in fields:
            part["pitch"] = self.rng.choice((0.1, "0.05 m"))
        self.joints[name] = part
        return name

    def tree(self, count: int) -> None:
        for _ in range(count):
            base = self.rng.choice(["ground", *self.bodies])
            kind = self.rng.choice(KINDS)
            joint = self.joint(kind, base, self.body())
            if kind in SINGLE and self.chance(0.15):
                self.joints[joint]["guide"] = self.rng.choice(("drive", "0.1*sin(t)", "drive*t + size*t**2", "abs(t - 1)*drive"))
            elif COORDINATES[kind] and self.chance(0.2):
                coordinate = self.rng.choice(COORDINATES[kind])
                self.joints[joint]["spring"] = {"stiffness": 40, "damping": "2*size", "coordinate": coordinate}

    def loop(self) -> None:
        if len(self.bodies) > 2:
            one, other = self.rng.sample(self.bodies, 2)
            self.joint(self.rng.choice([k for k in KINDS if k != "free"]), one, other, **({"cut": True} if self.chance(0.7) else {}))

    def law(self, variable: str) -> Any:
        """A law of any form over a variable and its rate."""
        x = variable
        return self.rng.choice(
            (
                12.5,
                f"-30*{x} - 2*rate",
                f"-weight*{x}**3 + drive",
                f"where({x} < 0.1, -{x}, min(0, rate, size))",
                f"abs({x})*rate/(1 + {x}**2)",
                f"sign(rate)*tanh({x})*cos(t)",
                f"max(max(rate, t, 0.7), {x}, 0.7)",
                f"-abs(abs({x} - 1) - 0.5)",
                {"polynomial": [0, "-2*weight", 3], "of": x},
                {"of": "rate", "piecewise": [{"below": 0, "polynomial": [1, 2]}, {"expression": "1 + 3*rate"}]},
                {"sum": [f"-{x}", {"polynomial": [0, -3], "of": "rate"}]},
                {"table": {x: [0.1, 0.2, 0.7], "value": [0, -3, -4]}},
                {"stop": {"at": 0.2, "side": "below", "stiffness": 500, "damping": 3}},
                {"let": {"gap": f"{x} - half", "slow": "rate/(1 + abs(rate))"}, "law": "-30*gap*abs(gap) - 2*slow"},
            )
        )

    def force(self, trees: list[str]) -> Node:
        base, follower = self.rng.sample(["ground", *self.bodies], 2)
        pair, body = {"bodies": [base, follower]}, self.rng.choice(self.bodies)
        parts: list[Node] = [
            {"kind": "point_spring", **pair, "from": [0.1, 0, 3], "to": [0.5, 1, 0], "law": self.law("length")},
            {
                "kind": "point_spring",
                **pair,
                "from": [0.1, 0, 3],
                "to": [0.5, 1, 0],
                "law": {"stiffness": 20, "damping": 3, "free_length": 2},
            },
            {"kind": "axial_force", **pair, "origin": [0, 0, 0], "point": self.point(), "axis": self.axis(), "law": self.law("travel")},
            {
                "kind": "load",
                "body": body,
                "at": self.point(),
                "force": ["x*vy", "drive", "-vz*abs(vz)"],
                "axes": self.rng.choice(("global", "body")),
            },
            {"kind": "load", "body": body, "torque": ["sin(t)", "drive*size", 0], "moving_only": self.chance()},
            {"kind": "load", "body": body, "let": {"w": "wx + wy", "c": "half*w"}, "torque": ["-c*wx", "-c*w", 0]},
            {
                "kind": "contact", **pair, "at": self.point(), "centre": self.point(), "radius": self.rng.choice((0, 0.5, "size")),
                **self.rng.choice(({"normal": "z"}, {"normal": [0, 1, 1], "along": "x"}, {"axis": "y", "cylinder": 2, "inside": True})),
                "force": ["-vx", "-vy*deflection", "max(0, 100*deflection*(1 + deflection_rate))"],
            },
            {"kind": "bushing", **pair, "at": self.point(), "stiffness": [9, 9, 9, 1, 1, "size"], "damping": [1, 1, 1, 0.1, 0.1, 0.1]},
        ]
        if trees:
            joint = self.rng.choice(trees)
            kind = self.joints[joint]["kind"]
            coordinate = self.rng.choice(COORDINATES[kind])
            parts.append({"kind": "joint_force", "joint": joint, "coordinate": coordinate, "law": self.law("position")})
            if self.chance(0.3):
                parts.append(self.friction(joint, coordinate))
        part = self.rng.choice(parts)
        return {**part, **({"active": False} if self.chance(0.1) else {})}

    def friction(self, joint: str, coordinate: str) -> Node:
        """Dry friction by what a joint carries, also of fields that do not suit the coordinate."""
        given = {"radius": 0.02, "arm": "0.3*size", "thrust_radius": 0.03, "static": 0.3, "stribeck_speed": 0.1, "preload": 2}
        names = [name for name in given if self.chance(0.4)] + (["radius"] if self.joints[joint]["kind"] == "revolute" else [])
        chosen = {name: given[name] for name in names}
        return {"kind": "joint_friction", "joint": joint, "coordinate": coordinate, "coefficient": 0.1, **chosen}

    def tyre(self) -> Node:
        constants = dict.fromkeys(("A0", "A1", "A2", "A3", "A4", "B1", "B3", "B4", "SN", "AF1", "AF2"), 1000)
        return {
            "kind": "tyre",
            "body": self.rng.choice(self.bodies),
            "centre": [0, 0, 0.3],
            "axis": [0, 1, 0],
            "radius": 0.3,
            "stiffness": 1e4,
            "calspan": constants,
        }

    def wheel(self) -> Node:
        """A wheel that turns, whose forces may be of any expression over its contact."""
        force = ["-100*(vx - 0.3*spin)", "-100*vy", "max(0, 1e4*deflection - 10*deflection_rate)"]
        moments = (None, [0, "-turn", "-camber*size"], [0, 0, "near"])
        return {
            "kind": "wheel", "body": self.rng.choice(self.bodies), "centre": [0, 0, 0.3], "axis": self.rng.choice(([0, 1, 0], "y")),
            "radius": 0.31, "force": force, "moment": self.rng.choice(moments) or [0, 0, 0], "let": {"near": "loaded_radius*drive"},
            **({"terrain_height": "0.01*sin(t)"} if self.chance(0.3) else {}),
        }  # fmt: skip

    def submodel(self) -> Node:
        return {
            "connectors": ["base"],
            "parameters": ["reach"],
            "points": {"C": [0, "reach", 0.3]},
            "bodies": {"wheel": {"mass": "weight", "centre_of_mass": "C", "inertia": [1, 2, 1]}},
            "joints": {
                "hub": {"kind": self.rng.choice(("revolute", "prismatic")), "bodies": ["base", "wheel"], "at": "C", "axis": [0, 1, 0.2]}
            },
            "forces": {
                "push": {"kind": "load", "body": "wheel", "at": "C", "force": ["y", "-vy*reach", "x"]},
                "spring": {"kind": "point_spring", "bodies": ["base", "wheel"], "from": [0, 0, 3], "to": "C", "law": self.law("length")},
            },
            "outputs": ["hub." + "rate", "wheel.y"][1:],
            "markers": {"end": {"body": "wheel", "at": "C"}},
        }

    def document(self) -> Node:
        """The whole model."""
        rng = self.rng
        self.tree(rng.choice((1, 1, 2, 2, 3, 4, 5)))
        while len(self.bodies) < 2:
            self.tree(1)
        for _ in range(rng.choice((0, 0, 1, 1, 2))):
            self.loop()
        trees = [n for n, j in self.joints.items() if "cut" not in j and "guide" not in j and COORDINATES[j["kind"]]]
        loops = len(self.joints) > len(self.bodies) and all("cut" not in j for j in self.joints.values())
        forces = {self.name("force"): self.force([] if loops else trees) for _ in range(rng.choice((0, 1, 1, 2, 4)))}
        if self.chance(0.2):
            forces[self.name("tyre")] = self.tyre()
        if self.chance(0.2):
            forces[self.name("wheel")] = self.wheel()
        cuts = [n for n, j in self.joints.items() if j.get("cut")]
        made: Node = {
            "cutjoint": 1,
            "name": rng.choice(ODD_NAMES[:20]) if self.chance(0.2) else "fuzzed",
            "gravity": [0, 0, rng.choice((-9.81, "-9.81*size"))],
            "parameters": {
                "size": {"value": 1.0, "binding": rng.choice(("const", "param"))},
                "ratio": 0.25,
                "third": "half*2/3",
                "half": "size/2",
                "weight": {"value": 2, "binding": rng.choice(("const", "param"))},
                "drive": {"value": 0.1, "binding": "input"},
                "load": {"value": 3, "unit": rng.choice(("kg", "g", "t")), "binding": "param"},
            },
            "points": {"origin": [0, 0, 0], "tip": [1, 0.5, "0.25*size"]},
            "bodies": {body: self.body_part() for body in self.bodies},
            "joints": self.joints,
            "forces": forces,
            "markers": {self.name("marker"): {"body": rng.choice(self.bodies), "at": self.point()} for _ in range(rng.randint(0, 2))},
            "reactions": {
                self.name("reaction"): {"joint": cut, "body": self.joints[cut]["bodies"][0], "direction": self.axis()} for cut in cuts
            },
        }
        if len(trees) > 1 and self.chance(0.3):
            made["gears"] = {"mesh": self.gear(trees)}
        if self.chance(0.3):
            made["submodels"] = {"side": self.submodel()}
            uses = {self.name("side"): mirror for mirror in rng.sample(["x", "y", "z", None], rng.randint(1, 3))}
            made["instances"] = {
                name: {"use": "side", "connect": {"base": rng.choice(self.bodies)}, "with": {"reach": 0.4}, **({"mirror": m} if m else {})}
                for name, m in uses.items()
            }
        made["outputs"] = [f"{rng.choice(self.bodies)}.{rng.choice(('x', 'vz', 'ay', 'roll', 'wx'))}" for _ in range(rng.randint(0, 3))]
        made["outputs"] = list(dict.fromkeys([*made["outputs"], *(f"{gear}.force" for gear in made.get("gears", {}))]))
        if self.chance(0.9):
            made["scenes"] = {self.name("scene"): self.scene(trees) for _ in range(rng.randint(1, 2))}
        if self.chance(0.3):
            self.control(made)
        return made

    def control(self, made: Node) -> None:
        """States, signals and controllers that read bodies, joints, forces and each other, now and then in a circle, and laws that read
        them."""
        rng = self.rng
        known = [f"{body}.{rng.choice(('x', 'vy', 'roll', 'wz', 'y', 'az' if self.chance(0.1) else 'z'))}" for body in self.bodies]
        known += [f"{joint}.{name}" for joint, part in self.joints.items() if "cut" not in part for name in JOINTS[part["kind"]].units]
        known += [f"{force}.{rng.choice(_REPORTS[part['kind']])}" for force, part in made["forces"].items()]
        known += [f"{side}.{rng.choice(('level', 'level.value', 'hub.angle', 'wheel.y', 'ask'))}" for side in made.get("instances", {})]
        states = [self.name("state") for _ in range(rng.randint(0, 2))]
        signals = [self.name("signal") for _ in range(rng.randint(0, 3))]
        controllers = [self.name("controller") for _ in range(rng.randint(0, 2))]
        known += [f"{name}.{rng.choice(('out', 'out', 'kept', 'more'))}" for name in controllers]
        calls = self.functions(made, controllers) if self.chance() else []
        sensed = [f"{sensor}.{rng.choice(('Fx', 'force', 'ay'))}" for sensor in (*made["reactions"], *made["markers"])]

        def term(*own: str) -> str:
            one, two = (rng.choice([*known, *states, *signals, *own, "drive", "size", "t"]) for _ in range(2))
            called = [f"0.1*{call.format(one, two)}" for call in calls]
            forms = (f"0.5*{one}", f"-2*{one} + sin({two})", f"where({one} < 0.1, {two}, 0.3)", f"max(0.2*{one}, -{two})")
            return rng.choice((*forms, *called))

        made["states"] = {name: {"start": rng.choice((0, 0.5, "size", "0.2 m")), "rate": term()} for name in states}
        for state in made["states"].values():
            if self.chance():
                state["nominal"] = rng.choice((1e5, "3 um", *((0, "size", "2 s") if self.chance(0.1) else ())))
        made["signals"] = {name: term() for name in signals}
        made["controllers"] = {name: self.controller(lambda *own: term(*own, *sensed)) for name in controllers}
        if "functions" in made:
            for controller in made["controllers"].values():
                kept = {"function": "worn", "arguments": [rng.choice(known), rng.choice(known)]}
                controller.setdefault("memory", {})["bytes"] = kept if self.chance(0.95) else {"function": "pushed",
                    "arguments": ["t"]}
        for force in made["forces"].values():
            if isinstance(force.get("law"), str) and self.chance():
                force["law"] += f" + 3*({term()})"
        if "submodels" in made:
            side = made["submodels"]["side"]
            side["states"] = {"level": {"start": 0.1, "rate": "ask - 2*level"}}
            side["controllers"] = {"slow": {"every": "1 ms", "signals": {"asked": "0.1*wheel.az + 0.1*level"}}}
            side["signals"] = {"ask": rng.choice(("0.1*wheel.vy + t", "spring.length - reach", "base.x*wheel.roll", "0.1*spring.force"))}
            side["forces"]["push"]["force"][1] = "level - vy*reach"

    def functions(self, made: Node, controllers: list[str]) -> list[str]:
        """Functions of the user, now and then with wrong units or sizes, and patterns of calls of two arguments."""
        rng = self.rng
        unit = rng.choice(("kN", "what", "m/s") if self.chance(0.2) else ("m/s", "1"))
        results = rng.choice((["force", "heat"], {"force": "N", "heat": "W"}, {"force": 1, "heat": unit}))
        memory = rng.choice((1, 7, 64, *((0, 300, "64") if self.chance(0.1) else ())))
        made["functions"] = {
            "pushed": {"arguments": {"a": "m", "b": "m/s"} if self.chance(0.1) else ["a", "b"], "partials": self.chance()},
            "worn": {"arguments": ["a", "b"], "results": results, "memory": memory},
        }
        if self.chance():
            made["functions"]["pushed"]["unit"] = rng.choice(("N", "m", "1"))
        calls = ["pushed({}, {})", *(f"worn.{result}({{}}, {{}}, {name}.bytes)" for result in results for name in controllers)]
        return [*calls, "worn({}, {})", "worn.cold({}, {}, t)", "pushed({})"] if self.chance(0.1) else calls

    def controller(self, term: Callable[..., str]) -> Node:
        """Its signals read each other, now and then in a circle."""
        rng = self.rng
        every = rng.choice((0.001, "2 ms", 0.0005, 0.3, *((0, "1 m", "size") if self.chance(0.1) else ())))
        circle = ("out",) if self.chance(0.1) else ()
        made: Node = {"every": every, "signals": {"out": term("more", "kept"), "more": term("kept", *circle)}}
        if self.chance():
            made["offset"] = rng.choice((0.001, "3 ms", 0, -1 if self.chance(0.1) else 0.0005))
        if self.chance():
            made["delay"] = rng.choice((0.006, "2 ms", 0.3, *((0.00077, 1e6) if self.chance(0.1) else ())))
        if self.chance():
            made["memory"] = {"kept": {"start": rng.choice((0, 0.5, "size")), "next": term("more", "kept", "out")}}
        if self.chance(0.2):
            made["signals"]["out"] = {"value": made["signals"]["out"], "start": rng.choice((1, "size", "1 m"))}
        return made

    def gear(self, trees: list[str]) -> Node:
        """A gear between two joints of the tree, now and then with a wrong name or unit."""
        ends = [f"{joint}.{self.rng.choice((*COORDINATES[self.joints[joint]['kind']], 'angle'))}" for joint in self.rng.sample(trees, 2)]
        if self.chance(0.2):
            laws = ("sin(position)*size", "position + position**2/4", "where(position < 0, 0, size)")
            return {"joints": ends, "law": self.rng.choice(laws)}
        return {"joints": ends, "ratio": self.rng.choice((-2.5, "1/3", "0.2*size", "-25 mm/rad", "40 rad/m", 0))}

    def scene(self, trees: list[str]) -> Node:
        rng = self.rng
        scene: Node = {"end": 0.01, "output_step": 0.005, "numerics": {"penalty": 1e7}}
        if self.chance():
            scene["inputs"] = {
                "drive": rng.choice(("0.2*sin(3*t)", {"table": {"t": [0, 1, 2], "value": [0, 1, 0]}}, 0.3, "where(t < 1, t, 1)"))
            }
        if trees and self.chance(0.5):
            joint = rng.choice(trees)
            scene["positions"] = {f"{joint}.{COORDINATES[self.joints[joint]['kind']][0]}": 0.01}
        balls = [name for name, joint in self.joints.items() if JOINTS[joint["kind"]].has_attitude and "cut" not in joint]
        if balls and self.chance(0.5):
            attitude = rng.choice((
                {"rotation_vector": self.triple()}, {"euler": self.triple(), "order": rng.choice(("xyz", "zyx", "zxz"))},
                {"quaternion": [0.8, 0, -0.6, 0]}, {"quaternion": ["sqrt(1 - third**2)", 0, "third", 0]},
            ))  # fmt: skip
            scene.setdefault("positions", {})[f"{rng.choice(balls)}.attitude"] = attitude
        if self.chance(0.3):
            scene["road"] = {
                "contact": rng.choice(("disc", "point")),
                "profile": [{"flat": 1}, {"ramp": 2, "rise": 0.1}, {"cosine": 1, "amplitude": 0.1}],
            }
            if self.chance(0.5):
                rough = {"iso8608": rng.choice("ABCDEF"), "seed": rng.randrange(-1, 9), "width": 1}
                heights = {"x": [0, 1, rng.choice((2, 3))], "y": [0, 1], "value": [[0, 0.1], [0.2, 0.1], rng.choice(([0, 0.1], [0]))]}
                scene["road"]["surface"] = rng.choice((rough, {"table": heights, "interpolation": rng.choice(("cubic", "linear"))}))
            if self.chance(0.5):
                scene["road"]["friction"] = [{"x": [0, 1], "y": [rng.choice((-1, 2)), 1], "value": rng.choice((0.3, 0)), "edge": 0.1}]
        if self.joints and self.chance(0.2):
            joint = rng.choice(sorted(self.joints))
            place = f"{joint}.{(*COORDINATES[self.joints[joint]['kind']], 'angle')[0]}"
            places = (place, f"sin({place})", f"{place}_rate", f"2*{place} - 0.1")
            scene["assemble"] = {rng.choice(places): rng.choice((0.02, "third", "1 mm", 30))}
        return scene


def make_document(rng: random.Random) -> Node:
    """A model that is valid but for what chance makes singular or unconnected."""
    return Maker(rng).document()


def write(document: Any) -> str:
    """The text of a model; JSON is YAML."""
    return json.dumps(document, indent=1)

"""Turn slip of the Magic Formula 6.2: the library's wheel beside the printed equations, which SymPy evaluates.

The equations are those of Pacejka, Tire and Vehicle Dynamics, 2012, section 4.3, by their numbers there, in the axes of property files: x
along, y to the left, z up.  In these phi is (psi' + (1 - eps) Omega sin gamma)/V, against the moment as in the book: its y and z point the
other way.  Moments beside turn slip are those of Besselink, Schmeitz and Pacejka, 2010, as in the tables of others.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy
import yaml

from cutjoint.model.files.property_file import read_properties
from cutjoint.model.read import read_model_text
from cutjoint.package.locations import library_folder
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.physics.simulation import compile_scene, completed
from tests.physics.test_wheels import DATA, of_formula

#: Other values than the defaults, with which every term counts.
TURN = {
    "PDXP1": 0.35, "PDXP2": 0.2, "PDXP3": 1.5, "PKYP1": 0.9, "PDYP1": 0.45, "PDYP2": -0.1, "PDYP3": 1.2, "PDYP4": 0.15, "PHYP1": 1.1,
    "PHYP2": 0.16, "PHYP3": 0.02, "PHYP4": -3.5, "PECP1": 0.6, "PECP2": 0.1, "QDTP1": 8.0, "QCRP1": 0.22, "QCRP2": 0.12, "QBRP1": 0.15,
    "QDRP1": 0.95, "QDRP2": -1.5, "LMP": 1.1,
}  # fmt: skip

TURNING = ", ".join(f"{name}: {value}" for name, value in TURN.items())

EQUATIONS = """
Fz0 = LFZO*FNOMIN
dfz = (Fz - Fz0)/Fz0
R0 = UNLOADED_RADIUS
# 4.75 and 4.76 with 4.90
eps = PECP1*(1 + PECP2*dfz)
Vc = sqrt(Vx**2 + Vy**2)
phit = turn/Vc
phi = (turn + (1 - eps)*Omega*sin(gamma))/Vc
# 4.105, 4.106, 4.78, 4.77, 4.79
Bxp = PDXP1*(1 + PDXP2*dfz)*cos(atan(PDXP3*kappa))
z1 = cos(atan(Bxp*R0*phi))
Byp = PDYP1*(1 + PDYP2*dfz)*cos(atan(PDYP3*tan(alpha)))
z2 = cos(atan(Byp*(R0*Abs(phi) + PDYP4*sqrt(R0*Abs(phi)))))
z3 = cos(atan(PKYP1*R0**2*phi**2))
# 4.E9 to 4.E18
Kxk = Fz*(PKX1 + PKX2*dfz)*exp(PKX3*dfz)*LKX
mux = (PDX1 + PDX2*dfz)*(1 - PDX3*gamma**2)*LMUX
Dx = mux*Fz*z1
Cx = PCX1*LCX
Bx = Kxk/(Cx*Dx)
kx = kappa + (PHX1 + PHX2*dfz)*LHX
Ex = (PEX1 + PEX2*dfz + PEX3*dfz**2)*(1 - PEX4*sign(kx))*LEX
SVx = Fz*(PVX1 + PVX2*dfz)*LVX*LMUX*z1
Fx0 = Dx*sin(Cx*atan(Bx*kx - Ex*(Bx*kx - atan(Bx*kx)))) + SVx
# 4.E25, 4.E28 to 4.E30, 4.84 to 4.89, 4.80
Kya0 = PKY1*Fz0*sin(PKY4*atan(Fz/(PKY2*Fz0)))*z3*LKY
Kya = PKY1*Fz0*(1 - PKY3*Abs(gamma))*sin(PKY4*atan(Fz/Fz0/(PKY2 + PKY5*gamma**2)))*z3*LKY
SVyg = Fz*(PVY3 + PVY4*dfz)*gamma*LKYC*LMUY*z2
SVy = Fz*(PVY1 + PVY2*dfz)*LVY*LMUY*z2 + SVyg
Kyg0 = Fz*(PKY6 + PKY7*dfz)*LKYC
CHyp = PHYP1
DHyp = (PHYP2 + PHYP3*dfz)*sign(Vx)
BHyp = Kyg0/(1 - eps)/(CHyp*DHyp*Kya0)
SHyp = DHyp*sin(CHyp*atan(BHyp*R0*phi - PHYP4*(BHyp*R0*phi - atan(BHyp*R0*phi))))*sign(Vx)
z4 = 1 + SHyp - SVyg/Kya
z0 = 0
# 4.E19 to 4.E27
SHy = (PHY1 + PHY2*dfz)*LHY + (Kyg0*gamma - SVyg)/Kya*z0 + z4 - 1
ay = alpha + SHy
muy = (PDY1 + PDY2*dfz)*(1 - PDY3*gamma**2)*LMUY
Dy = muy*Fz*z2
Cy = PCY1*LCY
By = Kya/(Cy*Dy)
Ey = (PEY1 + PEY2*dfz)*(1 + PEY5*gamma**2 - (PEY3 + PEY4*gamma)*sign(ay))*LEY
Fy0 = Dy*sin(Cy*atan(By*ay - Ey*(By*ay - atan(By*ay)))) + SVy
# 4.E50 to 4.E67
Bxa = (RBX1 + RBX3*gamma**2)*cos(atan(RBX2*kappa))*LXAL
Exa = REX1 + REX2*dfz
xs = Bxa*(alpha + RHX1)
xh = Bxa*RHX1
Fx = Fx0*cos(RCX1*atan(xs - Exa*(xs - atan(xs))))/cos(RCX1*atan(xh - Exa*(xh - atan(xh))))
Byk = (RBY1 + RBY4*gamma**2)*cos(atan(RBY2*(alpha - RBY3)))*LYKA
Eyk = REY1 + REY2*dfz
SHyk = RHY1 + RHY2*dfz
ys = Byk*(kappa + SHyk)
yh = Byk*SHyk
Gyk = cos(RCY1*atan(ys - Eyk*(ys - atan(ys))))/cos(RCY1*atan(yh - Eyk*(yh - atan(yh))))
DVyk = muy*Fz*(RVY1 + RVY2*dfz + RVY3*gamma)*cos(atan(RVY4*alpha))*z2
Fy = Gyk*Fy0 + DVyk*sin(RVY5*atan(RVY6*kappa))*LVYKA
# the side force without camber and turn slip
ku = PKY1*Fz0*sin(PKY4*atan(Fz/(PKY2*Fz0)))*LKY
mu = (PDY1 + PDY2*dfz)*LMUY
au = alpha + (PHY1 + PHY2*dfz)*LHY
Eu = (PEY1 + PEY2*dfz)*(1 - PEY3*sign(au))*LEY
bu = ku/(Cy*mu*Fz)*au
Fu = mu*Fz*sin(Cy*atan(bu - Eu*(bu - atan(bu)))) + Fz*(PVY1 + PVY2*dfz)*LVY*LMUY
# trail: 4.91
z5 = cos(atan(QDTP1*R0*phi))
SHt = QHZ1 + QHZ2*dfz + (QHZ3 + QHZ4*dfz)*gamma
at = atan(sqrt(tan(alpha + SHt)**2 + (Kxk/Kya)**2*kappa**2))*sign(alpha + SHt)
Bt = (QBZ1 + QBZ2*dfz + QBZ3*dfz**2)*(1 + QBZ4*gamma + QBZ5*Abs(gamma))*LKY/LMUY
Dt = Fz*R0/Fz0*(QDZ1 + QDZ2*dfz)*(1 + QDZ3*gamma + QDZ4*gamma**2)*LTR*z5
Et = (QEZ1 + QEZ2*dfz + QEZ3*dfz**2)*(1 + (QEZ4 + QEZ5*gamma)*2/pi*atan(Bt*QCZ1*(alpha + SHt)))
trail = LFZO*Dt*cos(QCZ1*atan(Bt*at - Et*(Bt*at - atan(Bt*at))))*cos(alpha)
# what is left: 4.92 to 4.99, 4.102 to 4.104
Mzi = QCRP1*muy*R0*Fz*sqrt(Fz/Fz0)*LMP
DDrp = Mzi/sin(pi/2*QDRP1)
Kzg = Fz*R0*(QDZ8 + QDZ9*dfz)*LKZC
BDrp = Kzg/(QDRP1*DDrp*(1 - eps))
Drp = DDrp*sin(QDRP1*atan(BDrp*R0*phi - QDRP2*(BDrp*R0*phi - atan(BDrp*R0*phi))))
z6 = cos(atan(QBRP1*R0*phi))
Mz90 = Mzi*2/pi*atan(QCRP2*R0*Abs(phit))*Gyk
z7 = 2/pi*acos(Mz90/(Abs(Drp) + 1e-6))
z8 = 1 + Drp
SHf = SHy + SVy/Kya
ar = atan(sqrt(tan(alpha + SHf)**2 + (Kxk/Kya)**2*kappa**2))*sign(alpha + SHf)
Br = (QBZ9*LKY/LMUY + QBZ10*By*Cy)*z6
Dr = Fz*R0*((QDZ6 + QDZ7*dfz)*LRES*z2 + (QDZ8 + QDZ9*dfz + (QDZ10 + QDZ11*dfz)*Abs(gamma))*gamma*LKZC*z0)*LMUY*cos(alpha) + z8 - 1
s = R0*(SSZ1 + SSZ2*Fy/FNOMIN + (SSZ3 + SSZ4*dfz)*gamma)*LS
Mz = -trail*Gyk*Fu + Dr*cos(z7*atan(Br*ar)) + s*Fx
"""


@cache
def coefficients() -> dict[str, float]:
    wheel = yaml.safe_load((library_folder() / "wheel_mf62.yaml").read_text())
    given = dict(read_properties((DATA / "mf62s.tir").read_text(), "t.tir", "instance 'w'").values)
    plain = {name: value for name, value in wheel["defaults"].items() if isinstance(value, int | float)}
    return {**plain, **{name: value for name, value in given.items() if isinstance(value, float)}, **TURN}


def printed(motion: dict[str, float]) -> dict[str, float]:
    """Values of the printed equations, in turn, with 30 digits."""
    names = {"kappa": "kappa", "alpha": "alpha", "gamma": "gamma", "load": "Fz", "vx": "Vx", "vy": "Vy", "spin": "Omega", "turn": "turn"}
    known: dict[str, object] = {name: sympy.Float(value, 30) for name, value in coefficients().items()}
    known |= {names[name]: sympy.Float(value, 30) for name, value in motion.items() if name in names}
    for line in EQUATIONS.splitlines():
        if line and not line.startswith("#"):
            name, _, formula = line.partition(" = ")
            known[name] = sympy.sympify(formula, locals=known).evalf(30)
    return {name: float(known[name]) for name in ("Fx", "Fy", "Mz")}  # type: ignore[arg-type]


def bench(rows: dict[str, np.ndarray], more: str) -> Trajectory:
    """The library's formula over rows of motion."""
    model = read_model_text(of_formula("mf62s", ("vy", "turn"), more), "m.yaml", folder=DATA)
    times = np.arange(len(rows["kappa"]), dtype=float)
    inputs = {name: {"t": times, "value": values, "interpolation": "linear"} for name, values in rows.items()}
    return completed(simulate(compile_scene(model, model.scenes["run"]), inputs=inputs, end=times[-1], error=False))


def motions(number: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(5)
    rows = {
        "kappa": rng.uniform(-0.3, 0.3, number), "alpha": rng.uniform(-0.3, 0.3, number), "gamma": rng.uniform(-0.1, 0.1, number),
        "load": rng.uniform(1500, 7000, number), "vx": rng.uniform(1.5, 20, number), "turn": rng.uniform(-3, 3, number),
        "pressure": np.full(number, coefficients()["NOMPRES"]),
    }  # fmt: skip
    return {**rows, "vy": rows["vx"] * np.tan(rows["alpha"]), "spin": (1 + rows["kappa"]) * rows["vx"] / 0.31}


def test_forces_with_turn_slip_are_those_of_the_printed_equations() -> None:
    rows = motions(40)
    found, plain = (bench(rows, f"turn_slip: {i}, {TURNING}, ") for i in (1, 0))
    expected = [printed({name: float(values[i]) for name, values in rows.items()}) for i in range(40)]
    for name in ("Fx", "Fy", "Mz"):
        values = np.array([each[name] for each in expected])
        assert found[f"bench.f.{name}.value"] == pytest.approx(values, rel=0, abs=1e-9 * np.abs(values).max()), name
        assert np.abs(plain[f"bench.f.{name}.value"] - values).max() > 0.005 * np.abs(values).max(), name


def straight(**motion: float) -> dict[str, np.ndarray]:
    """Free rolling at 10 m/s with two values of some motion, the one given and its opposite."""
    plain = dict.fromkeys(("kappa", "alpha", "gamma", "vy", "turn"), 0.0) | {"load": 4000.0, "vx": 10.0}
    plain |= {"spin": 10 / coefficients()["UNLOADED_RADIUS"], "pressure": coefficients()["NOMPRES"]}
    return {name: np.array([motion.get(name, value), -motion[name] if name in motion else value]) for name, value in plain.items()}


def test_a_little_camber_acts_as_without_turn_slip() -> None:
    """Its share of the spin is such that the side force by camber stays."""
    turning, plain = (bench(straight(gamma=1e-5), f"turn_slip: {i}, {TURNING}, ") for i in (1, 0))
    fy, before = (-float(np.diff(run["bench.f.Fy.value"])[0]) for run in (turning, plain))
    assert abs(before) > 0.01
    assert fy == pytest.approx(before, rel=1e-3)


def test_the_ground_resists_what_turns() -> None:
    """A wheel that turns to the left is turned back, on its way and on the spot."""
    left, right = bench(straight(turn=2), f"turn_slip: 1, {TURNING}, ")["bench.f.Mz.value"]
    assert left < -10 < 10 < right
    parked = straight(turn=0.5) | {"vx": np.zeros(2), "spin": np.zeros(2)}
    left, right = bench(parked, f"turn_slip: 1, {TURNING}, ")["bench.f.Mz.value"]
    assert left < -50 < 50 < right


def test_the_slip_angle_is_its_tangent_on_request(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the printed equations too, apart from the cosine, and the tangent in turn slip, of the angle at which the wheel moves."""
    equations = EQUATIONS.replace("cos(alpha)", "cos(angle)").replace("PDYP3*tan(alpha)", "PDYP3*tan(angle)")
    monkeypatch.setattr("tests.physics.test_turn_slip.EQUATIONS", f"angle = alpha\nalpha = tan(angle)\n{equations}")
    rows = motions(12)
    found, plain = (bench(rows, f"turn_slip: 1, tan_alpha: {i}, {TURNING}, ") for i in (1, 0))
    expected = [printed({name: float(values[i]) for name, values in rows.items()}) for i in range(12)]
    for name in ("Fx", "Fy", "Mz"):
        values = np.array([each[name] for each in expected])
        assert found[f"bench.f.{name}.value"] == pytest.approx(values, rel=0, abs=1e-9 * np.abs(values).max()), name
        assert np.abs(plain[f"bench.f.{name}.value"] - values).max() > 1e-4 * np.abs(values).max(), name

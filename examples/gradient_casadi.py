"""The press in CasADi: a callback whose Jacobian is exact, in a symbolic expression."""

from pathlib import Path

import casadi

import cutjoint

MODEL = Path(__file__).resolve().parents[1] / "models" / "press.yaml"
BY, STEPS, ROWS = ["stiffness", "A.z"], 400, 41
sim = cutjoint.load(MODEL, integrator="rk4", linearise=True, tunable=["A.z"])


class Trajectory(casadi.Callback):
    def __init__(self, name, inputs, width):
        super().__init__()
        self.inputs, self.width = inputs, width
        self.construct(name, {})

    def get_n_in(self):
        return len(self.inputs)

    def get_sparsity_in(self, i):
        return self.inputs[i]

    def get_sparsity_out(self, i):
        return casadi.Sparsity.dense(ROWS, self.width)

    def eval(self, arguments):
        sim.parameters.update(zip(BY, arguments[0].full()[:, 0].tolist(), strict=True))
        sim.reset(dt=1e-3).choose_independent(["pin.angle_rate"])
        run = sim.forward_sensitivities(STEPS, ["slider.x"], BY, every=10)
        return [casadi.DM(run.values if self.width == 1 else run.derivatives[:, 0])]

    def has_jacobian(self):
        return self.width == 1

    def get_jacobian(self, name, *_):
        self.derivatives = Trajectory(name, [self.inputs[0], casadi.Sparsity(ROWS, 1)], 2)
        return self.derivatives


x, trajectory = casadi.MX.sym("x", 2), Trajectory("trajectory", [casadi.Sparsity.dense(2, 1)], 1)
slope = casadi.Function("slope", [x], [casadi.gradient(casadi.sumsqr(trajectory(x)) / ROWS, x)])([2000.0, 0.1]).full()[:, 0]
print(f"the mean square of the slider's place changes by {slope[0]:.4g} m^2 per N/m and {slope[1]:.4g} m per m")

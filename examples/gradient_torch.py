"""The press in PyTorch: the trajectory of the slider by a spring's rate and a hardpoint, whose derivatives come by the adjoint method."""

from pathlib import Path

import torch
from torch.autograd.function import once_differentiable

import cutjoint

MODEL = Path(__file__).resolve().parents[1] / "models" / "press.yaml"
BY, STEPS = ["stiffness", "A.z"], 400
SCALES = torch.tensor([2000.0, 0.1], dtype=torch.float64)  # N/m and m

sim = cutjoint.load(MODEL, integrator="rk4", adjoint=True, tunable=["A.z"])


def start(x):
    """Start the simulation with parameters x (2)."""
    sim.parameters.update(zip(BY, x.tolist(), strict=True))
    sim.reset(dt=1e-3).choose_independent(["pin.angle_rate"])
    return sim


class Trajectory(torch.autograd.Function):
    """The slider's places (41) by x."""

    @staticmethod
    def forward(ctx, x):
        ctx.save_for_backward(x)
        return torch.from_numpy(start(x).forward_sensitivities(STEPS, ["slider.x"], [], every=10).values[:, 0])

    @staticmethod
    @once_differentiable  # PyTorch takes the derivatives for constants otherwise, and Hessians are wrong
    def backward(ctx, weights):
        run = start(*ctx.saved_tensors).adjoint_sensitivities(STEPS, ["slider.x"], BY, weights.numpy()[None, :, None], every=10)
        return torch.from_numpy(run.derivatives[0])


if __name__ == "__main__":
    x = SCALES.clone().requires_grad_()
    slope = torch.autograd.grad((Trajectory.apply(x) ** 2).mean(), x)[0].tolist()
    print(f"the mean square of the slider's place changes by {slope[0]:.4g} m^2 per N/m and {slope[1]:.4g} m per m")

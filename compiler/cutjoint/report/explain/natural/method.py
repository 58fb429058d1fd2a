"""The two methods' equations for a step (Cuadrado et al. 2000, sections 2.1 and 2.2)."""

from __future__ import annotations

from collections.abc import Mapping

from cutjoint.methods import METHODS
from cutjoint.model.records import Numerics
from cutjoint.report.explain.latex import number
from cutjoint.report.explain.views import Chapter, Entry, make_table

_RULE = (
    r"\dot q = \frac{2}{\Delta t} q + \hat{\dot q}, \quad \hat{\dot q} = -\frac{2}{\Delta t} q_n - \dot q_n",
    r"\ddot q = \frac{4}{\Delta t^2} q + \hat{\ddot q}, \quad"
    r" \hat{\ddot q} = -\frac{4}{\Delta t^2} q_n - \frac{4}{\Delta t} \dot q_n - \ddot q_n",
    r"A = M + \frac{\Delta t}{2} C + \frac{\Delta t^2}{4} K, \quad"
    r" C = -\frac{\partial Q}{\partial \dot q}, \quad K = -\frac{\partial Q}{\partial q}",
)

_STEP: Mapping[str, tuple[str, ...]] = {
    "augmented": (
        r"f = M \ddot q + \Phi_q^T (\alpha \Phi + \lambda) - Q = 0, \quad \lambda \leftarrow \lambda + \alpha \Phi",
        *_RULE,
        r"f_q \Delta q = -\frac{\Delta t^2}{4} f, \quad f_q = A + \frac{\Delta t^2}{4} \Phi_q^T \alpha \Phi_q",
    ),
    "classical": (
        r"f = \begin{bmatrix} M \ddot q + \Phi_q^T \lambda - Q \cr \Phi \end{bmatrix} = 0, \quad"
        r" x = \begin{bmatrix} q \cr \lambda \end{bmatrix}",
        *_RULE,
        r"f_x \Delta x = -\frac{\Delta t^2}{4} f, \quad"
        r" f_x = \begin{bmatrix} A & \frac{\Delta t^2}{4} \Phi_q^T \cr \frac{\Delta t^2}{4} \Phi_q & 0 \end{bmatrix}",
    ),
}

_PROJECTIONS: Mapping[str, tuple[str, ...]] = {
    "augmented": (
        r"f_q \Delta \dot q = -\frac{\Delta t^2}{4} \Phi_q^T \alpha \dot \Phi, \quad"
        r" f_q \Delta \ddot q = -\frac{\Delta t^2}{4} \Phi_q^T \alpha \ddot \Phi",
    ),
    "classical": tuple(
        rf"f_x \begin{{bmatrix}} \Delta \{dots} q \cr \cdot \end{{bmatrix}} ="
        rf" -\frac{{\Delta t^2}}{{4}} \begin{{bmatrix}} 0 \cr \{dots} \Phi \end{{bmatrix}}"
        for dots in ("dot", "ddot")
    ),
}

_DROPPED: Mapping[str, tuple[str, ...]] = {
    "augmented": (
        "It is symmetric: of $C$ and $K$ it has the symmetric parts alone. What it drops, their antisymmetric parts, comes from tyres, "
        "gyroscopic moments and dampers whose directions depend on the pose.",
        r"The change of $\Phi_q^T$ with $q$, at constant $\alpha \Phi + \lambda$, is dropped too.",
    ),
    "classical": (r"The change of $\Phi_q^T$ with $q$, at constant $\lambda$. $C$ and $K$ are whole.",),
}


_REPEATED = {
    "augmented": "One projection leaves a share of what it should close; conjugate gradients with the same tangent close the rest.",
    "classical": "They are repeated, since the tangent belongs to a pose before the last.",
}


def explain_method(method: str, numerics: Numerics) -> Chapter:
    """The equations of a step, with the scene's settings."""
    step = (
        "The unknowns are the coordinates at the end of a step that begins at $q_n$; the trapezoidal rule makes velocities and "
        "accelerations functions of them (eqs. 4, 5). Newton's method solves the equations of motion and of the constraints together.",
        _settings(method, numerics),
    )
    projection = (
        r"Then $\Phi$ is zero at the end of the step, but not $\dot \Phi$ and $\ddot \Phi$. The tangent of the last iteration tells the "
        "smallest changes of velocities and accelerations that make them so.",
        _REPEATED[method],
    )
    cost = "What is dropped costs iterations, not accuracy: $f$ itself is exact."
    nothing = make_table((), ())
    return Chapter(title=f"The {method} method", notes=(), formulas=(), entries=(
        Entry(title="Step", notes=step, formulas=_STEP[method], table=nothing),
        Entry(title="Projections", notes=projection, formulas=_PROJECTIONS[method], table=nothing),
        Entry(title="What the tangent drops", notes=(*_DROPPED[method], cost), formulas=(), table=nothing),
    ))  # fmt: skip


def _settings(method: str, numerics: Numerics) -> str:
    settings, given = numerics.of_method(method), numerics.methods.get(method, {})
    dt = rf"In this scene $\Delta t$ = {number(settings.step, times='e{}')} s"
    if METHODS[method].saddle_point:
        return f"{dt}."
    penalty = f"= {number(given['penalty'], times='e{}')}" if "penalty" in given else "follows from masses and step"
    return rf"{dt}, and $\alpha$ {penalty}."

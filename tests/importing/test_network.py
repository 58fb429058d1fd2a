"""Laws from neural networks in ONNX files, beside the evaluator of the package onnx, and fits of their weights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cutjoint
from tests.conftest import needs_cpp
from tests.fits.studies import write

onnx = pytest.importorskip("onnx")
reference = pytest.importorskip("onnx.reference")

_SLIDE = """cutjoint: 1
name: slide
gravity: [0, 0, 0]
parameters: {stiffness: {value: 150, unit: N/m}}
bodies: {block: {mass: 2, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: x}}
forces:
  spring: {kind: joint_force, joint: rail, law: -stiffness*position}
  rest: {kind: joint_force, joint: rail, law: LAW}
outputs: [rail.displacement, rail.displacement_rate, rest.force]
scenes: {swing: {end: 2, output_step: 10 ms, rates: {rail.displacement_rate: 1}}}
"""


def network(path: Path, nodes: list[Any], weights: dict[str, Any], inputs: int = 2, more: dict[str, Any] | None = None) -> Path:
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    tensors = [onnx.numpy_helper.from_array(np.asarray(x, dtype=np.float32), name) for name, x in weights.items()]
    ends = [helper.make_tensor_value_info(name, kind, [1, size]) for name, size in {"x": inputs, "y": 1, **(more or {})}.items()]
    graph = helper.make_graph([helper.make_node(*node[:3], **node[3]) for node in nodes], "net", ends[:1] + ends[2:], ends[1:2], tensors)
    path.write_bytes(helper.make_model(graph).SerializeToString())
    return path


def perceptron(path: Path, hidden: int = 5) -> Path:
    """All operators: Gemm with its factors, MatMul, Add, and all activations."""
    rng = np.random.default_rng(0)
    nodes = [
        ("Gemm", ["x", "a", "b"], ["g"], {"transB": 1, "alpha": 0.5, "beta": 2.0}), ("Tanh", ["g"], ["h"], {}),
        ("MatMul", ["h", "c"], ["m"], {}), ("Add", ["d", "m"], ["n"], {}), ("Sigmoid", ["n"], ["s"], {}),
        ("Gemm", ["s", "e"], ["u"], {}), ("Relu", ["u"], ["r"], {}), ("Identity", ["r"], ["i"], {}), ("Gemm", ["i", "k", "f"], ["y"], {}),
    ]  # fmt: skip
    sizes = {"a": (hidden, 2), "b": (hidden,), "c": (hidden, 2), "d": (2,), "e": (2, 1), "k": (1, 1), "f": (1,)}
    weights = {name: rng.normal(size=size) for name, size in sizes.items()}
    return network(path, nodes, weights | {"e": 20 * np.abs(weights["e"])})  # else it may be cut off everywhere


@needs_cpp
@pytest.mark.parametrize("hidden", [5, 20])  # of more than a hundred weights `let` is nested
def test_a_network_is_what_onnx_says(tmp_path: Path, hidden: int) -> None:
    file, model = perceptron(tmp_path / "net.onnx", hidden), tmp_path / "slide.yaml"
    model.write_text(_SLIDE.replace("LAW", cutjoint.network_law(file, ["position", "rate"])))
    run = cutjoint.simulate(model)
    x = np.column_stack([run["rail.displacement"], run["rail.displacement_rate"]])
    evaluate = reference.ReferenceEvaluator(str(file))
    expected = [float(evaluate.run(None, {"x": row[None].astype(np.float32)})[0][0, 0]) for row in x]
    assert np.ptp(expected) > 0.02
    assert np.abs(run["rest.force"] - expected).max() < 1e-5 * np.abs(expected).max()


@needs_cpp
@pytest.mark.parametrize("of", ["polynomial", "network"])
def test_what_physics_leaves_over_is_explained(tmp_path: Path, of: str) -> None:
    friction = _SLIDE.replace("LAW", "-1.5*rate - 2*rate**3 - 3*tanh(rate/0.2)")
    (tmp_path / "machine.yaml").write_text(friction)
    run, model = cutjoint.simulate(tmp_path / "machine.yaml"), tmp_path / "slide.yaml"
    data = write(tmp_path / "d.csv", run.t, x=run["rail.displacement"] + 1e-4 * np.random.default_rng(0).normal(size=len(run.t)))
    nodes = [("Gemm", ["x", "a", "b"], ["g"], {}), ("Tanh", ["g"], ["h"], {}), ("MatMul", ["h", "c"], ["y"], {})]
    start = network(tmp_path / "net.onnx", nodes, {"a": [[5, 1]], "b": [0, 0], "c": [[-3], [-2]]}, inputs=1)
    laws = {
        "nothing": ("0", []), "polynomial": ("{polynomial: [0, -1, 0, 0], of: rate}", [f"rest.law.polynomial.{i}" for i in (1, 2, 3)]),
        "network": (cutjoint.network_law(start, ["rate"]), [f"rest.law.let.w{i}" for i in (1, 4, 7, 8)]),
    }  # fmt: skip

    def fitted(law: str) -> Any:
        text, names = laws[law]
        model.write_text(_SLIDE.replace("LAW", text))
        part = {"data": data, "signals": {"rail.displacement": {"column": "x"}}}
        return cutjoint.fit({
            "cutjoint_fit": 1, "model": str(model), "integrator": "rk4", "dt": "2 ms",
            "parameters": {"stiffness": {}} | {name: {} for name in names},
            "experiments": {"first": {**part, "to": 1.2}, "whole": {**part, "validation": True}},
        })  # fmt: skip

    without, found = fitted("nothing"), fitted(of)
    shares = [1 - (b.rms / a.rms) ** 2 for a, b in zip(without.signals, found.signals, strict=True)]
    assert min(shares) > 0.999  # of the fitted second, and of all
    assert found.signals[1].explained > 0.999 > 0.9 > without.signals[1].explained


_TANH = [("Tanh", ["x"], ["y"], {})]


@pytest.mark.parametrize(
    ("nodes", "weights", "more", "words"),
    [
        ([("Softmax", ["x"], ["y"], {})], {}, {}, r"node 'y' \(Softmax\): a law has no such operator; use Gemm"),
        ([("Tanh", ["x"], ["y"], {"domain": "own"})], {}, {}, "no such operator"),
        (_TANH, {}, {}, "its output is 2 numbers; a law is one number"),
        (_TANH, {}, {"z": 1}, "it has 2 inputs and 1 output; export"),
        ([("Gemm", ["x", "w"], ["y"], {})], {"w": [[1]]}, {}, "it takes 1 unit, not 2; name each input"),
        ([("Gemm", ["w", "x"], ["y"], {})], {"w": [[1, 2]]}, {}, r"it has no vector of units; write x\*W"),
        ([("MatMul", ["x", "w"], ["y"], {})], {"w": [[[1]]]}, {}, "no constant matrix"),
        ([("MatMul", ["x", "x"], ["y"], {})], {}, {}, "no constant matrix"),
        ([("MatMul", ["x"], ["y"], {})], {}, {}, "no constant matrix"),
        ([("Add", ["x", "w"], ["y"], {})], {"w": [1, 2, 3]}, {}, "its bias is no constant as long as the units; keep"),
        ([("Add", ["w", "w"], ["y"], {})], {"w": [1]}, {}, "no vector of units"),
        ([("Add", ["x", "gone"], ["y"], {})], {}, {}, "its bias is no constant"),
        ([("MatMul", ["x", "w"], ["y"], {})], {"w": [[np.nan], [1]]}, {}, "tensor 'w': a number is not finite; train"),
        ([("MatMul", ["x", "w"], ["y"], {})], {"w": np.zeros((2, 1001))}, {}, "it has more than 2000 weights and units; take"),
    ],
)
def test_other_networks_are_refused(tmp_path: Path, nodes: Any, weights: Any, more: Any, words: str) -> None:
    file = network(tmp_path / "net.onnx", nodes, weights, more=more)
    with pytest.raises(cutjoint.NetworkError, match=f"net.onnx: .*{words}"):
        cutjoint.network_law(file, ["position", "rate"])


def test_what_is_no_network_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "net.onnx"
    with pytest.raises(cutjoint.NetworkError, match=r"net.onnx: cannot be read: No such file"):
        cutjoint.network_law(file, ["rate"])
    words = {b"\xff\xff": "is no ONNX file; export", b"": "is empty", bytes(1_000_001): "larger than 1000000 bytes; a law"}
    for content, message in words.items():
        file.write_bytes(content)
        with pytest.raises(cutjoint.NetworkError, match=message):
            cutjoint.network_law(file, ["rate"])


def test_weights_outside_the_file_are_refused(tmp_path: Path) -> None:
    file = network(tmp_path / "net.onnx", [("MatMul", ["x", "w"], ["y"], {})], {"w": [[1], [2]]})
    model = onnx.load(file)
    tensor = model.graph.initializer[0]
    tensor.ClearField("raw_data")
    tensor.data_location = onnx.TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value="/etc/hostname")
    file.write_bytes(model.SerializeToString())
    with pytest.raises(cutjoint.NetworkError, match="tensor 'w': its numbers do not stand in the file; export with the weights inside"):
        cutjoint.network_law(file, ["position", "rate"])

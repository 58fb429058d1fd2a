"""A small neural network from an ONNX file as a law of a model file, whose weights are numbers there.

A file of ONNX is data: known operators become expressions, all others are refused, and nothing of it runs.
"""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from cutjoint.model.document.values import MAX_PIECES
from cutjoint.package.errors import RunError, plural
from cutjoint.package.extensions import MissingPackageError, find_package

#: The largest file (bytes), and the most weights and units.
_BYTES, _NAMES = 1_000_000, 2000
_ACTIVATIONS = {"Tanh": "tanh({})", "Sigmoid": "(1 + tanh(({})/2))/2", "Relu": "max({}, 0)", "Identity": "{}"}
_LINEAR = ("Gemm", "MatMul", "Add")


class NetworkError(RunError):
    """A file has no network that a law can be."""


def network_law(file: str | PathLike[str], variables: Sequence[str]) -> str:
    """The law that a perceptron in an ONNX file is, as YAML for a model file: what stands after ``law:``.

    Its one input has so many ``variables``, its output is one number.  Weights are numbers under ``let``.

    Raises:
        MissingPackageError: the package onnx is not installed.
        NetworkError: the file cannot be read, or has another network.
    """
    onnx = find_package("onnx", otherwise=MissingPackageError("reading ONNX needs the package onnx: pip install 'cutjoint[onnx]'"))
    path = Path(file)
    try:
        content = path.read_bytes() if path.stat().st_size <= _BYTES else b""
        model = onnx.load_model_from_string(content, format="protobuf")  # never reads other files
    except OSError as error:
        raise NetworkError(f"{path}: cannot be read: {error.strerror}") from None
    except Exception:  # protobuf has its own
        raise NetworkError(f"{path}: is no ONNX file; export it again") from None
    if not content:
        raise NetworkError(f"{path}: is empty, or larger than {_BYTES} bytes; a law takes a small network")
    return _Network(path, onnx, model.graph, variables).law()


class _Network:
    """Expressions of units, or constant arrays, by the names of a graph's values, and the names under ``let`` that expressions use."""

    def __init__(self, path: Path, onnx: Any, graph: Any, variables: Sequence[str]) -> None:
        self.path, self.onnx, self.graph, self.let = path, onnx, graph, dict[str, str]()
        self.values: dict[str, Any] = {tensor.name: self._numbers(tensor) for tensor in graph.initializer}
        inputs = [each.name for each in graph.input if each.name not in self.values]
        if len(inputs) != 1 or len(graph.output) != 1:
            found = f"{plural(len(inputs), 'input')} and {plural(len(graph.output), 'output')}"
            self._refuse("graph", f"it has {found}", "export a network with one of each, a vector and a number")
        self.values[inputs[0]] = list(variables)

    def law(self) -> str:
        """Visit the nodes in their order, which follows the data; then nested mappings, since each has few names."""
        for node in self.graph.node:
            self.values[node.output[0]] = self._units(node, f"node '{node.name or node.output[0]}' ({node.op_type})")
        out = self.values.get(self.graph.output[0].name)
        if not isinstance(out, list) or len(out) != 1:
            self._refuse("graph", f"its output is {plural(len(out or ()), 'number')}", "a law is one number")
        entries = [f"{name}: {value}" for name, value in self.let.items()]
        groups = [entries[i : i + MAX_PIECES] for i in range(0, len(entries), MAX_PIECES)]
        return "".join(f"{{let: {{{', '.join(group)}}},\n      law: " for group in groups) + f'"{out[0]}"' + "}" * len(groups)

    def _units(self, node: Any, label: str) -> list[str]:
        if node.op_type not in (*_LINEAR, *_ACTIVATIONS) or node.domain not in ("", "ai.onnx"):
            self._refuse(label, "a law has no such operator", f"use {', '.join((*_LINEAR, *_ACTIVATIONS))}")
        units, other, bias = [*(self.values.get(name) for name in node.input), None, None, None][:3]
        if node.op_type == "Add" and not isinstance(units, list):
            units, other = other, units
        if not isinstance(units, list):
            self._refuse(label, "it has no vector of units", "write x*W, with the weights second")
        if node.op_type in _ACTIVATIONS:
            return [self._named("n", _ACTIVATIONS[node.op_type].format(unit)) for unit in units]
        if node.op_type == "Add":
            return self._biased(units, other, label)
        options = {each.name: self.onnx.helper.get_attribute_value(each) for each in node.attribute}
        if not isinstance(other, np.ndarray) or other.ndim != 2 or options.get("transA"):
            self._refuse(label, "its second input is no constant matrix", "keep weights constant, and its first input untransposed")
        weights = options.get("alpha", 1.0) * (other.T if options.get("transB") else other)
        if len(weights) != len(units):
            self._refuse(label, f"it takes {plural(len(weights), 'unit')}, not {len(units)}", "name each input of the network")
        units = [self._named("n", unit) for unit in units]
        sums = [" + ".join(f"{self._named('w', w)}*{unit}" for w, unit in zip(column, units, strict=True)) for column in weights.T]
        return sums if bias is None else self._biased(sums, options.get("beta", 1.0) * bias, label)

    def _biased(self, units: list[str], bias: Any, label: str) -> list[str]:
        if not isinstance(bias, np.ndarray) or bias.size not in (1, len(units)):
            self._refuse(label, "its bias is no constant as long as the units", "keep biases constant, a vector of each layer")
        return [f"{unit} + {self._named('w', each)}" for unit, each in zip(units, np.resize(bias, len(units)), strict=True)]

    def _numbers(self, tensor: Any) -> Any:
        try:
            found = None if tensor.external_data else np.asarray(self.onnx.numpy_helper.to_array(tensor), dtype=np.float64)
        except (TypeError, ValueError):
            found = None
        if found is None:
            self._refuse(f"tensor '{tensor.name}'", "its numbers do not stand in the file", "export with the weights inside")
        if not np.isfinite(found).all():
            self._refuse(f"tensor '{tensor.name}'", "a number is not finite", "train the network anew")
        return found

    def _named(self, letter: str, value: float | str) -> str:
        """A name under ``let`` for a number or an expression; names stand for themselves."""
        if isinstance(value, str) and value.isidentifier():
            return value
        name = f"{letter}{len(self.let) + 1}"
        if len(self.let) == _NAMES:
            self._refuse("graph", f"it has more than {_NAMES} weights and units", "take a smaller network")
        self.let[name] = f'"{value}"' if isinstance(value, str) else repr(float(value))
        return name

    def _refuse(self, element: str, message: str, hint: str) -> NoReturn:
        raise NetworkError(f"{self.path}: {element}: {message}; {hint}")

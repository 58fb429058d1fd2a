"""`cutjoint couple` with a system of FMUs: its connections as by hand, and what no system may have."""

from __future__ import annotations

import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cutjoint.coupling.connections import connect, open_system
from cutjoint.coupling.controller import Port
from cutjoint.coupling.run import _End
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.results import read_table
from tests.conftest import needs_cpp

from .test_with import HANGING, PUSHED, made, simulate, words_of

pytest.importorskip("fmpy")
pytestmark = needs_cpp

_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
_SPACES = 'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'

#: A chain: the first FMU hangs on the model, the second on the first.
CHAIN = (
    ("pushed", "mass.x", "hanging", "given"), ("hanging", "pull.force", "pushed", "given"), ("hanging", "mass.x",
        "second", "given"),
    ("second", "pull.force", "pushed", "other"),
)  # fmt: skip
WITH_OTHER = PUSHED.replace("{ given:", "{ other: {value: 0, unit: N, binding: input}, given:").replace('"-given"', '"-given + 0.5*other"')


def component(name: str, *, source: str = "", inner: str = "", more: str = "") -> str:
    return f'<ssd:Component name="{name}" source="{source or f"resources/{name}.fmu"}" {more}>{inner}</ssd:Component>'


def connection(*ends: str, inner: str = "") -> str:
    words = zip(("startElement", "startConnector", "endElement", "endConnector"), ends, strict=True)
    return f"<ssd:Connection {' '.join(f'{key}={value!r}' for key, value in words)}>{inner}</ssd:Connection>"


def structure(components: str, connections: str, head: str = _HEAD, before: str = "") -> str:
    return (
        f'{head}<ssd:SystemStructureDescription {_SPACES} version="1.0" name="s"><ssd:System name="s">{before}'
        f"<ssd:Elements>{components}</ssd:Elements><ssd:Connections>{connections}</ssd:Connections>"
        "</ssd:System></ssd:SystemStructureDescription>"
    )


def system(file: Path, text: str, **fmus: bytes) -> Path:
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for name, content in fmus.items():
            archive.writestr(f"resources/{name}.fmu", content)
    return file


def test_a_system_runs_as_its_connections_by_hand(tmp_path: Path) -> None:
    model = tmp_path / "pushed.yaml"
    model.write_text(WITH_OTHER)
    fmus = {name: made(HANGING, tmp_path / "made" / f"{name}.fmu") for name in ("hanging", "second")}
    names = ("pushed", "hanging", "second")
    text = structure("".join(map(component, names)), "".join(connection(*ends) for ends in CHAIN))
    archive = system(tmp_path / "chain.ssp", text, **{name: file.read_bytes() for name, file in fmus.items()})
    result = simulate(model, archive, tmp_path / "system.csv", "--integrator", "rk4", "--no-error")
    assert result.exit_code == 0, result.output
    assert "scene run with hanging.fmu, FMI 2, second.fmu, FMI 2" in words_of(result)
    pairs = ("hanging:given=mass.x", "hanging:pull.force=given", "second:given=hanging:mass.x", "second:pull.force=other")
    connections = [word for pair in pairs for word in ("--connect", pair)]
    by_hand = simulate(model, fmus["hanging"], tmp_path / "hand.csv", fmus["second"], *connections, "--integrator", "rk4", "--no-error")
    assert by_hand.exit_code == 0, by_hand.output
    assert (tmp_path / "system.csv").read_bytes() == (tmp_path / "hand.csv").read_bytes()
    assert abs(read_table(tmp_path / "system.csv")[1]["other"]).max() > 0.5


def test_ports_that_a_system_does_not_connect_stay(tmp_path: Path) -> None:
    """By hand the FMU's input would take the model's output of its name."""
    model = tmp_path / "pushed.yaml"
    model.write_text(PUSHED.replace("outputs: [mass.x, pull.force]", "outputs: [{place: {value: mass.x, unit: m}}]"))
    fmu = made(HANGING.replace("given", "place"), tmp_path / "made" / "hanging.fmu")
    text = structure(component("pushed") + component("hanging"), connection("hanging", "pull.force", "pushed",
        "given"))
    archive = system(tmp_path / "loose.ssp", text, hanging=fmu.read_bytes())
    result = simulate(model, archive, tmp_path / "loose.csv", "--no-error")
    assert result.exit_code == 0, result.output
    assert "stay at their start place of the FMU" in words_of(result)
    plain = simulate(model, fmu, tmp_path / "plain.csv", "--connect", "pull.force=given", "--no-error")
    assert "read place as place" in words_of(plain)


_BOTH = component("pushed") + component("hanging")
_BOMB = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c SYSTEM "file:///etc/passwd">]>'

_LOOP, _PLAIN = ("hanging", "pull.force", "pushed", "given"), component("pushed")


def beside(name: str = "hanging", **how: str) -> str:
    return structure(_PLAIN + component(name, **how), "")


REFUSED = [
    (structure(component("other"), ""), "the system has no component 'pushed', as the model is named; it has: other"),
    (beside(source="../../etc/x.fmu"), "its source '../../etc/x.fmu' is no file in resources/"),
    (beside(source="resources/../x.fmu"), "is no file in resources/"),
    (beside(source="file:///x.fmu"), "is no file in resources/"),
    (beside(source="resources/none.fmu"), "'resources/none.fmu' is no file in resources/"),
    (beside("../out", source="resources/hanging.fmu"), "name it by letters, digits and underscores"),
    (beside(more='implementation="ModelExchange"'), "'hanging' is no FMU for co-simulation"),
    (beside(inner="<ssd:ParameterBindings/>"), "has parameter bindings"),
    (structure(_PLAIN + '<ssd:System name="hanging"/>', ""), "'hanging' is no FMU for co-simulation"),
    (structure(_BOTH, "", before="<ssd:ParameterBindings/>"), "the system has parameter bindings"),
    (structure(_BOTH, connection(*_LOOP, inner="<ssc:LinearTransformation factor='2'/>")), "transforms its values"),
    (structure(_BOTH, connection("hanging", "pull.force", "elsewhere", "given")), "no component is named 'elsewhere'"),
    (structure(_BOTH, connection("hanging", "pull.force", "hanging", "given")), "is within one component"),
    (structure(_BOTH, connection("hanging", "x", "pushed", "a") + connection("hanging", "x", "pushed", "b")),
        "'hanging:x' is connected"),
    (structure(_BOTH.replace("resources/", "&b;resources/"), "", head=_HEAD + _BOMB), "has a document type, which no system needs"),
    (structure(_BOTH, "", head=_HEAD + _BOMB.replace("&a;", "")), "has a document type, which no system needs"),
    ("<x/>", "is no system structure of SSP 1.0"),
    ("<x", "SystemStructure.ssd: "),
]


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_what_no_system_may_have_is_reported(text: str, message: str, tmp_path: Path) -> None:
    file = system(tmp_path / "s.ssp", text, hanging=b"x")
    with pytest.raises(RunError) as reported, open_system([file], {}, "pushed"):
        pass
    assert str(reported.value).startswith(f"{file}: ")
    assert message in str(reported.value)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["s.ssp"]


def test_what_is_no_system_is_reported(tmp_path: Path) -> None:
    (tmp_path / "no.ssp").write_bytes(b"no archive")
    with zipfile.ZipFile(tmp_path / "empty.ssp", "w"):
        pass
    nothing = "There is no item named 'SystemStructure.ssd'"
    for name, message in (("no.ssp", "File is not a zip file"), ("empty.ssp", nothing), ("x.ssp", "No such file")):
        with pytest.raises(RunError, match=message), open_system([tmp_path / name], {}, "pushed"):
            pass
    with pytest.raises(RunError, match="pass only the system, without --connect"), open_system([tmp_path / "x.ssp"], {"a": "b"},
        "pushed"):
        pass


def test_a_controller_reads_outputs_in_its_own_units() -> None:
    """30 mm of the model are 0.03 m of a port in SI units, as the simulation has them and as the connections say."""
    model = read_model_text(PUSHED.replace("outputs: [mass.x,", "outputs: [{place: {value: 1000*mass.x, unit: mm}},"), "pushed.yaml")
    place, force = (Port(name=name, reference=i, causality=way, unit=None, fault="") for i, (name, way) in enumerate((
        ("where", "input"), ("force", "output"))))  # fmt: skip
    written: dict[str, float] = {}
    fmu: Any = SimpleNamespace(
        path=Path("c.fmu"), ports={"where": place, "force": force},
        set=lambda ports, values: written.update(zip((port.name for port in ports), values, strict=True)),
    )  # fmt: skip
    (connections,) = connect([fmu], model, model.scenes["run"], {"where": "place", "force": "given"})
    simulation: Any = SimpleNamespace(outputs={"place": 30.0})
    participant: Any = SimpleNamespace(fmu=fmu, connections=connections, step=0.01)
    _End(simulation, participant, [])._write_inputs()
    assert written == {"where": pytest.approx(0.03)}

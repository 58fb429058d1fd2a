"""`cutjoint compile`."""

import subprocess
from dataclasses import replace
from pathlib import Path

import click

from cutjoint.commands import options, table
from cutjoint.compile.c99 import c99_methods, make_c99
from cutjoint.compile.c_export import describe_frozen, freeze_start_parameters, make_standalone, needs_load_events
from cutjoint.compile.pipeline import compile_model, generate
from cutjoint.formulate.inputs import tunable_parameters
from cutjoint.methods import DEFAULT_PRECISION, METHODS
from cutjoint.model.expressions.functions import leave_to_host
from cutjoint.model.expressions.tunable import with_inputs
from cutjoint.model.records import Model, Scene
from cutjoint.report.tables import trim_facts
from cutjoint.run.artifact import Artifact
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.run.result_files import write_files
from cutjoint.run.run_file import find_trim
from cutjoint.run.scenes import find_case, method_of, with_default_closure
from cutjoint.toolchain.build import simulator_of
from cutjoint.toolchain.wasm import require_zig

#: The target whose product is a module for browsers and other hosts of WebAssembly.
WASM = "wasm"

#: The language of exports for controllers.
C99 = "c99"


def _refuse_dt(ctx: click.Context, param: click.Parameter, value: str | None) -> None:
    if value is not None:
        raise click.UsageError(f"no option --dt: write numerics: {{dt: {value}}} into the scene; C++ code also has NAME_set_step", ctx)


@table.command("compile")
@click.option("--dt", hidden=True, expose_value=False, callback=_refuse_dt)
def command(
    model: Path, scene: str | None, method: str | None, out: Path, integrator: str | None, linearise: bool, adjoint: bool, poses: bool,
    external_wrenches: tuple[str, ...], terrain: tuple[str, ...], tunable: tuple[str, ...], functions: Path | None, hosted: bool,
    target: str, reproducible: bool, language: str, iterations: int | None, precision: str,
) -> None:  # fmt: skip
    """Generate and compile the C++ of MODEL for one scene, or write it as C99."""
    if language == C99:
        others = {"linearise": linearise, "adjoint": adjoint, "poses": poses, "host-functions": hosted, "target wasm": target == WASM}
        if unfit := [name for name, value in others.items() if value]:
            raise click.UsageError(f"--{unfit[0]} does not apply to --language {C99}, which has steps and outputs alone")
    elif iterations is not None:
        raise click.UsageError(f"--iterations is for --language {C99}: exports in C++ have the call NAME_set_iterations")
    elif precision != DEFAULT_PRECISION:
        raise click.UsageError(f"--precision {precision} is for --language {C99}")
    if hosted and functions is not None:
        raise click.UsageError("--functions and --host-functions exclude each other: the code is compiled in or left to the host")
    with options.progress_bar(f"compiling {model.name}"):
        read = read_model(model, tunable=tunable, functions=functions)
        read = leave_to_host(read) if hosted else read
        case = find_case(read, scene)
        method = method or method_of(case[1], c99_methods(*case) if language == C99 else METHODS)
        if language == C99 or target == WASM:
            stepped = with_inputs(read, external_wrenches=external_wrenches, terrain=terrain)
            if language == C99:
                said = _write_c99(stepped, scene, method, out, integrator, iterations, precision)
            else:
                said = _write_module(stepped, scene, method, out, integrator, linearise=linearise, adjoint=adjoint, poses=poses)
            options.out.print(said)
            _print_start(*find_case(stepped, scene), is_fixed=language == C99)
            return
        artifact = compile_model(
            read, scene=scene, method=method, out=out, integrator=integrator, linearise=linearise, adjoint=adjoint, poses=poses,
            external_wrenches=external_wrenches, terrain=terrain, reproducible=reproducible,
        )  # fmt: skip
        price = _tunable_cost(artifact, model) if tunable else ""
    operations = artifact.program.operations(artifact.iteration)
    options.out.print(f"{operations} operations an evaluation{price}; source and simulator in {out}{_sizes(artifact, out)}")
    _print_start(artifact.topology.model, artifact.scene, is_fixed=False)
    if frozen := describe_frozen(freeze_start_parameters(artifact.topology.model, artifact.scene, trims=True)):
        options.out.print(f"interface {frozen}")


def _print_start(model: Model, scene: Scene, *, is_fixed: bool) -> None:
    """Print what the scene's trim finds, with which exported code starts, for other parameters too if it ``is_fixed``."""
    if scene.trim is not None:
        (_, found), *_ = trim_facts(find_trim(model, scene, {})[2])
        options.out.print(f"the start is trimmed {'once, ' if is_fixed else ''}with the parameters of the file: {found}")


def _write_module(
    model: Model, scene: str | None, method: str, folder: Path, integrator: str | None, *, linearise: bool, adjoint: bool, poses: bool
) -> str:  # fmt: skip
    """Write the folder with its module of WebAssembly; what was written, in words."""
    require_zig()
    case, found = find_case(model, scene)
    chosen = with_default_closure(found, method, integrator)
    case = freeze_start_parameters(case, chosen, trims=True)
    load_events = (linearise or adjoint) and needs_load_events(chosen, method, integrator, equal_steps=True)
    generated = generate(case, chosen, chosen.outputs, method=method, poses=poses, load_events=load_events, trims=True)
    standalone = make_standalone(generated, integrator=integrator, equal_steps=True, linearise=linearise, adjoint=adjoint)
    files, module = {**standalone.files, **standalone.module_files}, f"{standalone.name}.wasm"
    require_apart({"the model": Path(model.span.file)}, documents=[(f"--out {folder}: file", folder / name) for name in (*files, module)])
    made = standalone.build_module()
    write_files(folder, {**files, module: made})
    return f"{module}, {len(made) / 1000:.0f} kB, with its calls in JavaScript ({standalone.name}.mjs) in {folder}"


def _write_c99(
    model: Model, scene: str | None, method: str, folder: Path, integrator: str | None, iterations: int | None, precision: str
) -> str:  # fmt: skip
    """Write the C99 code; what was written, in words."""
    case, found = find_case(model, scene)
    chosen = with_default_closure(found, method, integrator)
    made = make_c99(case, chosen, method=method, integrator=integrator, iterations=iterations, precision=precision)
    require_apart({"the model": Path(model.span.file)}, documents=[(f"--out {folder}: file", folder / name) for name in made.files])
    write_files(folder, made.files)
    header, code, *_ = made.files
    return f"{made.operations} operations an evaluation; {header} and {code} in {folder}; README.md says how to compile them"


def _sizes(artifact: Artifact, folder: Path) -> str:
    program = (folder / simulator_of(artifact.topology.model.name)).resolve()
    said = subprocess.run([program, "--sizes"], capture_output=True, text=True, check=False)
    return f"; a simulation takes {said.stdout.strip()}" if said.returncode == 0 else ""


def _tunable_cost(artifact: Artifact, path: Path) -> str:
    plain = replace(read_model(path), code=artifact.model.code)
    case, scene = find_case(plain, artifact.scene.name)
    _, program, _ = generate(case, scene, artifact.scene.outputs, method=artifact.method)
    count = len(tunable_parameters(artifact.topology.model)) - len(tunable_parameters(plain))
    return f" ({count} constants are tunable; {program.operations(artifact.iteration)} without)"

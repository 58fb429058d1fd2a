"""`cutjoint explain`."""

from pathlib import Path

import click

from cutjoint.commands import options, table
from cutjoint.reduce.sequence import reduction_sequence
from cutjoint.report.explain.document import explain
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.run.result_files import write_whole
from cutjoint.run.scenes import method_of


@table.command("explain")
def command(model: Path, scene: str | None, method: str | None, reduced: bool, tunable: tuple[str, ...], out: Path | None) -> None:
    """Explain in Markdown what the compiler derives from MODEL: topology, equations, operations, what tunable parameters cost."""
    require_apart({"the model": model}, documents=[("--out", out)])
    checked, chosen = options.choose_case(read_model(model, tunable=tunable), scene)
    method = method or method_of(chosen)
    with options.progress_bar(f"explaining {model.name}"):
        variant = reduction_sequence(checked, chosen, method)[-1] if reduced else None
        text = explain(variant.model, variant.scene, method, done=variant.done) if variant else explain(checked, chosen, method)
    if out is None:
        click.echo(text, nl=False)
    else:
        write_whole(out, text)

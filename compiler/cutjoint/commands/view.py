"""`cutjoint view`."""

from __future__ import annotations

from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.run.outputs import require_apart
from cutjoint.topology.reading import read_model
from cutjoint.view.views import require_view, show_start, write_shown


@table.command("view")
def command(model: Path, scene: str | None, opened: tuple[str, ...], changes: tuple[str, ...], out: Path | None) -> None:
    """Draw the pose in which a scene of MODEL starts, as a page that a browser opens from the disk."""
    out = Path(f"{model.stem}.html") if out is None else out
    require_view(out, "--out")
    require_apart({"the model": model}, documents=[("--out", out)])
    checked = read_model(model, opened=opened)
    checked, chosen = options.take_case(checked, scene)
    with options.progress_bar(f"drawing {model.name}"):
        write_shown(out, show_start(checked, chosen, options.read_parameters(changes)))
    options.console_beside(out).print(f"view: {out}", markup=False)

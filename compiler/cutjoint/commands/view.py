"""`cutjoint view`."""

from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.package.errors import RunError
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.view.live import LiveView
from cutjoint.view.views import live_page, show_start


@table.command("view")
def command(
    model: Path, scene: str | None, tunable: tuple[str, ...], changes: tuple[str, ...], out: Path | None, live: int | None, *, shared: bool,
) -> None:  # fmt: skip
    """Draw the pose in which a scene of MODEL starts, as a page that a browser opens from the disk, or follow a running host."""
    if out is not None and live is not None:
        raise RunError("--live writes no file; leave out --out")
    if shared and live is None:
        raise RunError("--shared is of --live PORT")
    out = Path(f"{model.stem}.html") if out is None else out
    require_apart({"the model": model}, documents=[("--out", out)])
    checked, chosen = options.choose_case(read_model(model, tunable=tunable), scene)
    parameters = options.read_parameters(changes)
    if live is not None:
        with options.progress_bar(f"drawing {model.name}"):
            page = live_page(checked, chosen, parameters)
        view = LiveView(checked, page, live, is_open=shared, report=lambda trouble: options.err.print(trouble))
        options.out.print(f"http://localhost:{view.port}/ follows datagrams at UDP port {view.port}; Ctrl-C ends it")
        view.serve()
        return
    options.write_view(out, model.name, lambda: show_start(checked, chosen, parameters))

"""All kinds of inputs that are fuzzed, by name."""

from __future__ import annotations

from collections.abc import Mapping

from . import (
    caches,
    calls,
    controllers,
    dense,
    disks,
    friction,
    hosts,
    impacts,
    lanes,
    massless,
    mechanisms,
    meshes,
    model_files,
    parts,
    poses,
    road_files,
    robots,
    signals,
    tyres,
)  # fmt: skip
from .chain import run_chain
from .expressions import any_text
from .mutations import any_model
from .pipeline import compile_text
from .tally import Kind


def _check_text(text: str) -> tuple[str, ...]:
    message = run_chain(text)
    return (message,) if message else ()


KINDS: Mapping[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(name="expressions", suffix=".txt", make=any_text, check=_check_text, limit=30, waits=False),
        Kind(name="models", suffix=".yaml", make=any_model, check=lambda text: compile_text(text).problems, waits=False),
        Kind(name="model_files", suffix=".files.json", make=model_files.make, check=model_files.check, limit=30, waits=False),
        Kind(name="mechanisms", suffix=".mechanism.json", make=mechanisms.make, check=mechanisms.check, limit=600),
        Kind(name="dense", suffix=".dense.json", make=dense.make, check=dense.check, share=3.0, limit=240, waits=False),
        Kind(name="lanes", suffix=".lanes.json", make=lanes.make, check=lanes.check, waits=False),
        Kind(name="meshes", suffix=".mesh.json", make=meshes.make, check=meshes.check),
        Kind(name="calls", suffix=".call.json", make=calls.make, check=calls.check),
        Kind(name="disks", suffix=".disk.json", make=disks.make, check=disks.check, limit=240),
        Kind(name="caches", suffix=".cache.json", make=caches.make, check=caches.check, limit=1200),
        Kind(name="parts", suffix=".parts.json", make=parts.make, check=parts.check),
        Kind(name="signals", suffix=".signal.json", make=signals.make, check=signals.check, limit=240),
        Kind(name="impacts", suffix=".impact.json", make=impacts.make, check=impacts.check, limit=600),
        Kind(name="hosts", suffix=".host.json", make=hosts.make, check=hosts.check),
        Kind(name="controllers", suffix=".controller.json", make=controllers.make, check=controllers.check, limit=240),
        Kind(name="poses", suffix=".pose.json", make=poses.make, check=poses.check, limit=120),
        Kind(name="massless", suffix=".massless.json", make=massless.make, check=massless.check, limit=240),
        Kind(name="robots", suffix=".robot.json", make=robots.make, check=robots.check, limit=60, waits=False),
        Kind(name="road_files", suffix=".road.json", make=road_files.make, check=road_files.check, limit=30, waits=False),
        Kind(name="tyres", suffix=".damaged.tir", make=tyres.make, check=tyres.check, limit=60, waits=False),
        Kind(name="friction", suffix=".friction.json", make=friction.make, check=friction.check, limit=240),
    )
}

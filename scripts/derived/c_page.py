"""The C reference, from the header of an export that has every part."""

from __future__ import annotations

import re
from pathlib import Path

from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.emit.statuses import STATUSES
from cutjoint.model.expressions.functions import leave_to_host
from cutjoint.topology.reading import read_model

MODEL = Path(__file__).with_name("every_part.yaml")

HEAD = """# C reference

This page shows the header that `cutjoint compile` writes. `NAME` and `name` stand for the name of the model; numbers and names of elements
are those of an example. A header has only the calls and status codes of its model, method and options. [Embed a model in
C](../how-to/embed-in-c.md) shows the calls in order. The C99 export has [some of them](../how-to/controller-c99.md), and `NAME_STEP`.
"""


def page() -> str:
    """The page: each comment of the header as text, then the declarations that it describes."""
    model = leave_to_host(read_model(MODEL))
    scene = model.scenes["run"]
    generated = generate(model, scene, scene.outputs, poses=True)
    adaptive = _declarations(make_standalone(generated, integrator="dormand-prince", adjoint=True).files[f"{model.name}.h"])
    equal = _declarations(make_standalone(generated, integrator="trapezoidal").files[f"{model.name}.h"])
    settings = next(i for i, (_, code) in enumerate(adaptive) if "name_set_step(" in code)
    more = [(comment, code) for comment, code in equal if "name_set_step(" in code]
    lines = [HEAD]
    for comment, code in (*adaptive[: settings + 1], *more, *adaptive[settings + 1 :]):
        lines += [f"## {title}\n"] if (title := _title(code)) else []
        lines.append(_prose(comment) + "\n")
        if code.strip():
            lines.append(f"```c\n{code.strip()}\n```\n")
    return "\n".join(lines)


def _declarations(text: str) -> list[tuple[str, str]]:
    """The comments of a header, each with the declarations that it describes."""
    body = text.partition('extern "C" {\n#endif\n')[2].partition("#ifdef __cplusplus")[0]
    body = re.sub(r"\bEVERY_PART_", "NAME_", re.sub(r"\bevery_part_", "name_", body))
    body = re.sub(r"(name_create)_[0-9a-f]{16}", r"\1_DIGEST", re.sub(r'(DIGEST) "[0-9a-f]{16}"', r'\1 "..."', body))
    body = re.sub(r"(POSES_DIGEST|NAME_SIZE) (0x[0-9a-f]{16}ULL|\d+)", r"\1 ...", body)
    statuses = "".join(f"  NAME_{status.name} = {status.number}, /* {status.text} */\n" for status in STATUSES.values())
    body = re.sub(r"(  NAME_OK = 0,\n)(?:  NAME_\w+ = [1-9].*\n)*", lambda found: found[1] + statuses, body)
    body = body.replace("exported scene 'run'", "exported scene")
    return re.findall(r"^/\*(.*?)\*/\n((?:(?!/\*)[^\n]*\n)*)", body, re.DOTALL | re.MULTILINE)


def _prose(comment: str) -> str:
    """A comment as Markdown: lines that begin with the name of an argument are a list."""
    found: list[str] = []
    for line in (line.strip() for line in comment.strip().splitlines()):
        is_item = re.match(r"`\w+`[^:.]*:|`\w+` \(", line) is not None
        after_item = bool(found) and found[-1].startswith("* ")
        if found and is_item != after_item and (is_item or line[:1] != "`"):
            found.append("")
        found.append(f"* {line}" if is_item else line)
    return "\n".join(found)


def _title(code: str) -> str:
    """The functions of a block, at most three by name; "" where it has none."""
    names = re.findall(r"^[\w\s*]*?\b(name_\w+)\(", code, flags=re.MULTILINE)
    kind = "" if "name_set_step" not in names else ": adaptive integrators" if "name_set_tolerance" in names else ": equal steps"
    return ", ".join(f"`{name}`" for name in names[:3]) + (", ..." if len(names) > 3 else "") + kind

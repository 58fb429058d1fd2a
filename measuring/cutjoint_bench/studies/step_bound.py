"""A bound on the instructions of a step of C99 code, from its control flow, beside the count of an emulated run.

The bound is the longest path through each function of an object for aarch64 or Cortex-M7: a loop counts as often as its `for` statement in
C allows, a copy of n bytes as 40 + n/8, on Cortex-M7 40 + n/3.  Excluded: the reduction of angles beyond 1e6 rad, and square roots of
negative numbers.  The count is the largest of steps in QEMU (qemu-aarch64; the board mps2-an500), which logs each instruction: 100 from the
start of the scene, and 100 from there on with all angles of the state turned by 159154 turns, near 1e6 rad, where sines and cosines take
longer.  Parameters and inputs change before each step.  Both numbers are also given without the mathematical library.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory

import click
from rich.console import Console
from rich.table import Table

from cutjoint.compile.c99 import make_c99
from cutjoint.compile.c_export import Standalone, freeze_start_parameters, make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.methods import Events, Loops
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_case, with_default_closure
from cutjoint.toolchain.wasm import mathematics
from cutjoint_bench.studies.checkout import MODELS

FLAGS = ("-g", "-O2", "-fno-tree-vectorize", "-fno-tree-loop-distribute-patterns", "-fno-math-errno")


@dataclass(frozen=True, kw_only=True)
class Processor:
    """The tools of a processor, and its instructions: patterns of names (of names and operands for returns), and bytes copied by one."""

    prefix: str
    flags: tuple[str, ...] = ()
    link: tuple[str, ...] = ()
    run: tuple[str, ...]
    jump: str
    always: str
    back: str
    copied: str
    bytes_each: int


PROCESSORS = {
    "aarch64": Processor(
        prefix="aarch64-linux-gnu-", link=("-static",), run=("qemu-aarch64",), jump=r"b|b\.\w+|cbn?z|tbn?z", always="b",
        back=r"(ret|udf)\b.*", copied=r"x2, #(0x\w+|\d+)", bytes_each=8,
    ),
    "cortex-m7": Processor(
        prefix="arm-none-eabi-", flags=("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16"),
        link=("-nostartfiles", "-T", "board.ld", "board.c"),
        run=("qemu-system-arm", "-M", "mps2-an500", "-nographic", "-semihosting-config", "enable=on,target=native", "-kernel"),
        jump=r"(b(?!lx?\b|x\b|ic|fc|kpt)\w*(\.[nw])?)|cbn?z", always=r"b(\.[nw])?",
        back=r"(pop|ldmia)\S* .*pc\}|bx\S* lr|udf.*|ldr\S* pc, \[sp\].*",
        copied=r"r2, #(0x\w+|\d+)", bytes_each=3,
    ),
}  # fmt: skip

#: The start of a program on a board without an operating system, with semihosting for its end.
BOARD = """
extern int main(void);
static void reset(void);
__attribute__((section(".vectors"), used)) static void* const vectors[2] = {(void*)0x20400000, (void*)reset};
static void reset(void) {
  *(volatile unsigned*)0xE000ED88 |= 0xfu << 20; /* the floating-point unit */
  __asm volatile("dsb; isb");
  const unsigned end = main() == 0 ? 0x20026 : 0x20024;
  register unsigned call __asm("r0") = 0x18, reason __asm("r1") = end;
  __asm volatile("bkpt 0xab" : : "r"(call), "r"(reason));
  for (;;) {}
}
"""
LAYOUT = """
SECTIONS {
  . = 0;
  .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) *(.data*) }
  . = 0x20000000;
  .bss : { *(.bss*) *(COMMON) }
}
"""
NEVER = float("-inf")

#: Calls that no step within the stated limits makes.
EXCLUDED = frozenset({"cutjoint_k_rem_pio2_large", "sqrt"})

#: Functions of the C library that copy and fill.
COPIES = frozenset({"memcpy", "memset", "memmove"})

#: The beginning of names of the mathematical library.
LIBRARY = "cutjoint_"

#: Model, integrator, and whether its loops are embedded.
CASES = (
    ("press", None, False), ("four_bar", None, False), ("press", "rk4", False), ("four_bar", "rk4", False), ("press", "rk4", True),
    ("pendulum", "rk4", False),
)  # fmt: skip

TURNS = 159154 * 2 * pi

MAIN = """
#include "{p}.h"
static {p}_sim memory;
static const double turned[{P}_COORDINATES + 1] = {{{turned}}};
static double q[{P}_COORDINATES];
int main(void) {{
  {p}_sim* sim = {p}_create(&memory, sizeof memory);
  int status = {p}_start(sim), k, i;
  for (k = 0; status == 0 && k < 2 * {steps}; ++k) {{
    for (i = 0; k == {steps} && i < {P}_COORDINATES; ++i) {{ q[i] = {p}_coordinates(sim)[i] + turned[i]; }}
    if (k == {steps}) {{ {p}_set_state(sim, {p}_time(sim), q, {p}_speeds(sim)); }}
    {p}_set_parameter(sim, 0, {p}_parameters(sim)[0] * (1.0 + 1e-6 * (k % 3)));
    {inputs}
    status = {p}_step(sim);
  }}
  return status;
}}
"""


#: The places in source that an instruction comes from: in the function, and in those that are inlined there, outermost first.
Places = tuple[tuple[str, int], ...]


@dataclass
class Code:
    """The functions of an object file, and the largest numbers of rounds of its loops by source line."""

    processor: Processor
    functions: dict[str, list[tuple[int, str, str, Places]]]
    rounds: Mapping[tuple[str, int], int]
    without_library: bool = False
    known: dict[str, float] = field(default_factory=dict)

    def bound(self, name: str) -> float:
        """The most instructions of a call."""
        if name in EXCLUDED:
            return NEVER
        if self.without_library and name.startswith(LIBRARY):
            return 0.0
        if name not in self.known:
            self.known[name] = Function(self, self.functions[name]).bound
        return self.known[name]


@dataclass
class Function:
    """The basic blocks of a function by the addresses of their first instructions."""

    code: Code
    instructions: Sequence[tuple[int, str, str, Places]]

    @cached_property
    def bound(self) -> float:
        """The longest path from the entry."""
        self._find_blocks()
        entry = self.instructions[0][0]
        found = self._longest(set(self.next), entry, frozenset())
        return max(found.get(block, NEVER) for block in self.ends)

    def _find_blocks(self) -> None:
        known, of = {a for a, *_ in self.instructions}, self.code.processor
        first, jumps = {self.instructions[0][0]}, {}
        for i, (address, name, operands, _) in enumerate(self.instructions):
            if re.fullmatch(of.jump, name):
                jumps[address] = int(re.findall(r"\b([0-9a-f]+) <", operands)[0], 16)
                first |= {jumps[address]} & known
            elif not re.fullmatch(of.back, f"{name} {operands}"):
                assert name not in ("br", "tbb", "tbh"), "a jump by a table"
                continue
            if i + 1 < len(self.instructions):
                first.add(self.instructions[i + 1][0])
        starts = sorted(first)
        self.places: dict[int, list[Places]] = {}
        self.next: dict[int, list[int]] = {}
        self.price: dict[int, float] = {}
        self.ends: list[int] = []
        for start, end in zip(starts, [*starts[1:], 1 << 62], strict=True):
            block = [row for row in self.instructions if start <= row[0] < end]
            address, name, operands, _ = block[-1]
            self.places[start] = [row[3] for row in block]
            called = [row[2].partition("<")[2].rstrip(">") for row in block if row[1] == "bl"]
            self.next[start] = []
            if address in jumps and jumps[address] in known:
                self.next[start].append(jumps[address])
            elif address in jumps:  # a call in place of a return
                called.append(re.findall(r"<([\w.]+)>", operands)[0])
            returns, jumps_always = bool(re.fullmatch(of.back, f"{name} {operands}")), bool(re.fullmatch(of.always, name))
            if not (returns or jumps_always) and end < 1 << 62:
                self.next[start].append(end)
            elif (returns and name != "udf") or (jumps_always and not self.next[start]):
                self.ends.append(start)
            bytes_copied = [int(found[1], 0) for row in block if (found := re.match(of.copied, row[2]))]
            copies = [call in COPIES or call.startswith(".plt") for call in called]
            prices = [
                40 + bytes_copied[-1] / of.bytes_each if copy else self.code.bound(call) for call, copy in zip(called, copies, strict=True)
            ]  # fmt: skip
            self.price[start] = len(block) + sum(prices)

    def _longest(self, blocks: set[int], entry: int, cut: frozenset[tuple[int, int]]) -> dict[int, float]:
        """The most instructions from an entry to the end of each block, over blocks without the edges that are cut."""
        parts = _components(blocks, entry, lambda b: [n for n in self.next[b] if n in blocks and (b, n) not in cut])
        found: dict[int, float] = {}
        reached = {entry: 0.0}
        for part in parts:
            (heads,) = [[b for b in part if b in reached]]
            loops = len(part) > 1 or any(n == b and (b, n) not in cut for b in part for n in self.next[b])
            if not loops:
                here = {heads[0]: self.price[heads[0]]}
            else:
                assert len(heads) == 1, "a loop with two entries"
                here = self._loop(part, heads[0], cut)
            for block, length in here.items():
                found[block] = reached[heads[0]] + length
                for after in self.next[block]:
                    if after in blocks and after not in part and (block, after) not in cut:
                        reached[after] = max(reached.get(after, NEVER), found[block])
        return found

    def _loop(self, part: set[int], head: int, cut: frozenset[tuple[int, int]]) -> dict[int, float]:
        back = frozenset((b, head) for b in part if head in self.next[b])
        once = self._longest(part, head, cut | back)
        latches = [b for b, _ in back]
        tested_below = any(n not in part for b in latches for n in self.next[b])
        rounds = max(self._rounds(part, b) for b in latches)
        before = (rounds - tested_below) * max(once.get(b, NEVER) for b in latches)
        return {block: before + length for block, length in once.items()}

    def _rounds(self, part: set[int], latch: int) -> int:
        """The number of rounds that the `for` statement of a loop's last branch allows, in the innermost function with most of the loop."""
        places = [place for block in part for place in self.places[block]]
        last = self.places[latch][-1]
        depth = len(last) - 1
        while sum(place[:depth] == last[:depth] and len(place) > depth for place in places) < 0.9 * len(places):
            depth -= 1
        file, line = last[depth]
        while (file, line) not in self.code.rounds:
            line -= 1
            assert line > 0, f"no loop in {file} ends at {last}"
        return self.code.rounds[file, line]


def _components(blocks: set[int], entry: int, after: object) -> list[set[int]]:
    """The strongly connected components that an entry reaches, in topological order (Tarjan 1972)."""
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    found: list[set[int]] = []

    def visit(b: int) -> None:
        index[b] = low[b] = len(index)
        stack.append(b)
        for n in after(b):  # type: ignore[operator]
            if n not in index:
                visit(n)
                low[b] = min(low[b], low[n])
            elif n in stack:
                low[b] = min(low[b], index[n])
        if low[b] == index[b]:
            part = set()
            while b not in part:
                part.add(stack.pop())
            found.append(part)

    visit(entry)
    return found[::-1]


def read_code(processor: Processor, binary: Path, sources: Mapping[str, str], rounds: Mapping[str, int]) -> Code:
    """The code of an object file; ``rounds`` are the values of limits of loops that are no numbers."""
    call = [f"{processor.prefix}objdump", "-dl", "--inlines", "--no-show-raw-insn", str(binary)]
    said = subprocess.run(call, check=True, capture_output=True, text=True).stdout
    functions: dict[str, list[tuple[int, str, str, Places]]] = {}
    rows, place = [], ("", 0)
    callers: list[tuple[str, int]] = []
    for line in said.splitlines():
        if start := re.match(r"[0-9a-f]+ <([\w.]+)>:", line):
            rows = functions.setdefault(start[1], [])
        elif source := re.match(r"(inlined by )?\S*?([\w.]+\.[ch]):(\d+)", line):
            if source[1]:
                callers.insert(0, (source[2], int(source[3])))
            else:
                place = source[2], int(source[3])
        elif row := re.match(r" +([0-9a-f]+):\t(\S+)\s*(.*)", line):
            rows.append((int(row[1], 16), row[2], row[3], (*callers, place)))
            callers = []
    functions = {name: [row for row in body if not row[1].startswith("nop")] for name, body in functions.items()}
    return Code(processor, functions, _limits(sources, rounds))


def _limits(sources: Mapping[str, str], rounds: Mapping[str, int]) -> dict[tuple[str, int], int]:
    limits = {}
    for file, text in sources.items():
        names = {**{name: int(value) for name, value in re.findall(r"\b([A-Z_]+) = (\d+)", text)}, **rounds}
        names["STATES"] = names["COORDINATES"] + names["SPEEDS"]
        for number, line in enumerate(text.splitlines(), 1):
            if found := re.search(r"for \((\w+) = (\d+); .*?\b\1 (<=?) ([\w>-]+)", line):
                limit = int(found[4]) if found[4].isdigit() else names[found[4]]
                limits[file, number] = limit - int(found[2]) + (found[3] == "<=")
    return limits


def measure(binary: Path, name: str, code: Code) -> tuple[int, int]:
    """The largest numbers of instructions of a step in an emulated run, with those of the mathematical library and without."""
    entry = code.functions[f"{name}_step"][0][0]
    calls = [i for i, row in enumerate(code.functions["main"]) if row[1] == "bl" and f"<{name}_step>" in row[2]]
    back = code.functions["main"][calls[0] + 1][0]
    library = {row[0] for function, rows in code.functions.items() if function.startswith(LIBRARY) for row in rows}
    most, now = [0, 0], [0, 0]
    qemu, *options = code.processor.run
    call = [qemu, "-singlestep", "-d", "exec,nochain", "-D", "/dev/stdout", *options, str(binary)]
    with subprocess.Popen(call, stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout
        for line in run.stdout:
            at = int(line.split("/")[1], 16) if line.startswith("Trace") else -1
            if at in (entry, back):
                most, now = [max(pair) for pair in zip(most, now, strict=True)] if at == back else most, [0, 0]
            now[0] += 1
            now[1] += at not in library
    assert run.returncode == 0, "a step fails"
    return most[0], most[1]


def _turned(standalone: Standalone) -> list[str]:
    """By how much each coordinate is turned."""
    equations = standalone.parts.mechanism
    turned = [0.0] * len(equations.coordinate_names)
    for chart in equations.charts:
        for i in range(chart.scalars):
            turned[chart.q + i] = TURNS * equations.angular[chart.v + i]
    return [repr(angle) for angle in turned]


def compare(
    name: str, integrator: str | None, embedded: bool = False, processor: str = "aarch64", steps: int = 100
) -> list[tuple[int, int]]:  # fmt: skip
    """The bound on the instructions of a step of a model and the largest count of a run, with the mathematical library and without."""
    text = (MODELS / f"{name}.yaml").read_text(encoding="utf-8")
    case, scene = find_case(read_model_text(text, f"{name}.yaml"), None)
    scene = with_default_closure(scene, "recursive", integrator)
    if embedded:
        scene = replace(scene, numerics=replace(scene.numerics, loops=Loops.EMBEDDED, events=Events.CROSSED))
    files = make_c99(case, scene, method="recursive", integrator=integrator).files
    made_of = generate(freeze_start_parameters(case, scene), scene, scene.outputs, method="recursive", lanes=False)
    turned = _turned(make_standalone(made_of, integrator=integrator, equal_steps=True, lanes=False))
    inputs = f"{name}_set_input(sim, 0, 0.01 * k, 0.1 * (k % 7), 0.0);" if "_set_input" in files[f"{name}.h"] else ""
    of = PROCESSORS[processor]
    with TemporaryDirectory() as made:
        folder, own = Path(made), mathematics()
        (folder / "libm").mkdir()
        for file, content in {**files, "board.c": BOARD, "board.ld": LAYOUT, "main.c": MAIN.format(
            p=name, P=name.upper(), steps=steps, inputs=inputs, turned=", ".join(turned))}.items():
            (folder / file).write_text(content, encoding="utf-8")
        named = ("-include", "libm/names.h")
        sources = [f"libm/{path.name}" for path in sorted((folder / "libm").glob("*.c"))]
        calls = [(*own.cxx, "-std=c99", "main.c"), (*own.cxx, "-std=c99", *named, f"{name}.c")]
        calls += [(*own.c, *named, source) for source in sources]
        for i, call in enumerate(calls):
            subprocess.run([f"{of.prefix}gcc", *of.flags, *FLAGS, "-c", *call, "-o", f"{i}.o"], cwd=folder, check=True)
        objects = [f"{i}.o" for i in range(len(calls))]
        subprocess.run([f"{of.prefix}gcc", *of.flags, *of.link, *objects, "-lm", "-o", "all"], cwd=folder, check=True)
        read = {f"{name}.c": files[f"{name}.c"]}
        iterations = re.search(r"_ITERATIONS (\d+)", files[f"{name}.h"])
        rounds = dict.fromkeys(("self->iterations", f"{name.upper()}_ITERATIONS"), int(iterations[1]) if iterations else 0)
        code = read_code(of, folder / "all", read, rounds)
        bounds = [int(one.bound(f"{name}_step")) for one in (code, replace(code, without_library=True, known={}))]
        return list(zip(bounds, measure(folder / "all", name, code), strict=True))


@click.command(help=__doc__)
@click.option("--only", default="", help="Models whose name has this text.")
@click.option("--processor", default="aarch64", type=click.Choice(list(PROCESSORS)))
def command(only: str, processor: str) -> None:
    """Print the table."""
    table = Table("model", "loops", "integrator", "bound", "count", "ratio", "bound without library", "count", "ratio")
    for name, integrator, embedded in CASES:
        if only in name:
            found = compare(name, integrator, embedded, processor)
            cells = [cell for bound, count in found for cell in (str(bound), str(count), f"{bound / count:.2f}")]
            table.add_row(name, "embedded" if embedded else "exact", integrator or "trapezoidal", *cells)
    Console().print(table)


if __name__ == "__main__":
    command()

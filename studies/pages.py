"""What studies tell: how far they are, the machine, figures as JSON, and Markdown: tables, and blocks of pages, each
marked with a digest of the code it was measured with.

A block stands between ``<!-- generated: NAME of SUBJECT, code DIGEST -->`` and ``<!-- end -->``. The subject says which
rooms the figures depend on. The digest covers the code of these rooms without comments and docstrings, so that better
words do not make figures stale.
"""

import ast
import hashlib
import json
import math
import os
import platform
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import distributions
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from smartmesh_ros import InputError

ROOT = Path(__file__).parents[1]
_CORE = ("core", "terrain", "ground", "world")
# The rooms that the figures of a block depend on, by its subject: folders, from that of the package. The core's folder
# of soil counts for figures of soil alone: the scenes of the others have none.
SUBJECTS = {
    "core": (*_CORE, "../studies/report"),
    "soil": ("core", "terrain", "soil"),
    "node": (*_CORE, "node"),
    "tuner": (*_CORE, "tools/evaluation", "tools/replay", "tools/tune"),
}
_MARK = re.compile(r"<!-- generated: (?P<name>[\w -]+?) of (?P<subject>\w+), code (?P<digest>\w+) -->\n")
_END = "<!-- end -->"


class Block(NamedTuple):
    """A block of a page: its name, its subject, and the digest of the code it was measured with."""

    name: str
    subject: str
    digest: str


def blocks_of(page: Path) -> list[Block]:
    """The blocks of a page; raises `InputError` for a subject that does not exist."""
    found = [Block(*match.groups()) for match in _MARK.finditer(page.read_text())]
    for block in found:
        if block.subject not in SUBJECTS:
            raise InputError("document", f"{page.name}: {block.subject!r} is no subject; choose {', '.join(SUBJECTS)}")
    return found


def fill(page: Path, blocks: Mapping[str, str]) -> None:
    """Replaces blocks of a page by their names, and notes the code of today. Raises `InputError` and writes nothing if
    the page lacks one of them."""
    text = page.read_text()
    for name, content in blocks.items():
        found = next((match for match in _MARK.finditer(text) if match["name"] == name), None)
        end = text.find(_END, found.end()) if found else -1
        if found is None or end < 0:
            raise InputError("document", f"{page} has no block <!-- generated: {name} of SUBJECT, code DIGEST -->")
        mark = f"<!-- generated: {name} of {found['subject']}, code {digest_of(found['subject'])} -->"
        text = f"{text[: found.start()]}{mark}\n{content}\n{text[end:]}"
    page.write_text(text)


@cache
def digest_of(subject: str) -> str:
    """Digest of the code that figures of a subject depend on."""
    left_out = {"tests"} if subject == "soil" else {"tests", "soil"}
    rooms = [(ROOT / "smartmesh_ros" / room).resolve() for room in SUBJECTS[subject]]
    sources = [path for room in rooms for path in sorted(room.rglob("*"))]
    files = [path for path in sources if path.suffix in (".py", ".cpp", ".h") and path.parent.name not in left_out]
    return digest({str(file.relative_to(ROOT)): file.read_text() for file in files})


def digest(sources: Mapping[str, str]) -> str:
    """Digest of Python and C++ sources by file name, without their comments and docstrings."""
    total = hashlib.sha256()
    for name, source in sources.items():
        if name.endswith(".py"):
            tree = ast.parse(source)
            for node in ast.walk(tree):
                if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                    node.body = node.body[ast.get_docstring(node, clean=False) is not None :]
            code = ast.dump(tree)
        else:
            code = " ".join(re.sub(r"//[^\n]*|/\*.*?\*/", " ", source, flags=re.DOTALL).split())
        total.update(f"{name}\0{code}\0".encode())
    return total.hexdigest()[:12]


def stale_blocks(folder: Path) -> list[str]:
    """Blocks of the pages in a folder that were measured with other code than today's, a sentence each."""
    return [
        f"{page.name}: {block.name} (of {block.subject}, code {block.digest}; today's is {digest_of(block.subject)})"
        for page in sorted(folder.glob("*.md"))
        for block in blocks_of(page)
        if block.digest != digest_of(block.subject)
    ]


def main(pages: Path = ROOT / "docs") -> int:
    """``make docs-check``: lists the blocks of a folder whose figures are older than the code."""
    total = sum(len(blocks_of(page)) for page in pages.glob("*.md"))
    stale = stale_blocks(pages)
    print("\n".join([*stale, f"{len(stale)} of {total} generated blocks are older than the code they measure"]))
    return 1 if stale else 0


def number(value: float) -> str:
    """Three significant digits, without an exponent; - where there is none."""
    if math.isnan(value):
        return "-"
    if value == 0.0:
        return "0"
    return f"{value:.{max(2 - math.floor(math.log10(abs(value))), 0)}f}"


def times(ratio: float) -> str:
    """A ratio, as 3.2x."""
    return "-" if math.isnan(ratio) else f"{ratio:.2g}x" if ratio < 10 else f"{ratio:,.0f}x"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; the first column is text, the others are numbers."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (header, *rows)]
    return "\n".join([lines[0], "|---|" + "---:|" * (len(header) - 1), *lines[1:]])


PACKAGES = ("numpy", "pybullet", "mujoco", "sapien", "rapier3d", "coal")
BEGUN = perf_counter()


def say(line: str) -> None:
    """Show a line in place of the one before on the standard error output, behind the time since the start."""
    print(f"\r\033[K{perf_counter() - BEGUN:5.0f} s  {line}", end="", file=sys.stderr, flush=True)


def short(between: str = ", ") -> str:
    """The machine, by cores and processor, and nothing that identifies it."""
    file = Path("/proc/cpuinfo")
    models = re.findall(r"model name\s*: (.*)", file.read_text()) if file.exists() else []
    return f"{os.cpu_count() or 1} cores{between}{(models or [platform.processor() or platform.machine()])[0]}"


def measured_on() -> str:
    """The machine, and versions of Python and the measured packages, as the beginning of a sentence."""
    found = {one.name: one.version for one in distributions()}
    versions = ", ".join(f"{name} {found.get(name, 'not installed')}" for name in PACKAGES)
    return f"Measured on {short(' of ')}; python {platform.python_version()}, {versions}"


def save(path: Path, data: Mapping[str, Any]) -> None:
    """Write figures as JSON with five digits, what has no records inside in a line; entries of the file that ``data``
    lacks stay."""
    exact = json.dumps({**(json.loads(path.read_text()) if path.exists() else {}), **data})
    text = json.dumps(json.loads(exact, parse_float=lambda figure: float(f"{float(figure):.5g}")), indent=1)

    def in_a_line(record: re.Match[str]) -> str:
        return re.sub(r",\n *", ", ", re.sub(r"(?<=[{[])\n *|\n *(?=[]}])", "", record[0]))

    path.write_text(re.sub(r"{[^{}]+}|\[[^][{}]+\]", in_a_line, text) + "\n")

"""``make load``: the node under load, as real processes over DDS."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from smartmesh_ros.startup.domains import isolated_unless_chosen
from studies.load import cases, pictures, regions, tables
from studies.load.cases import Case
from studies.load.processes import run_case
from studies.load.tables import PAGE, PICTURES, Summary
from studies.machine import short
from studies.pages import digest_of, fill


def groups(*, quick: bool) -> dict[str, list[Case]]:
    """Everything that is run."""
    makers = {"grid": cases.grid, "executors": cases.executors, "memory": cases.memory, "rest": cases.rest}
    return {name: make(quick=quick) for name, make in makers.items()}


def run(case: Case) -> dict[str, Any]:
    """Runs a case, and prints a line about it."""
    result = run_case(case)
    s = Summary.of(result)
    print(
        f"{case.name:50s} update+step {s.update_and_step:6.2f} ms  missed {100 * s.missed:6.2f} %  "
        f"real time {s.real_time_factor:.2f}  lost {s.lost}",
        flush=True,
    )
    return result


def report(data: dict[str, Any], out: Path, page: Path | None) -> None:
    """Pictures, and the tables of the page."""
    found = data["groups"]
    summaries = {name: [Summary.of(result) for result in found.get(name, [])] for name in groups(quick=True)}
    for path in pictures.draw(summaries, data["machine"], out):
        print(f"wrote {path}")
    blocks = {
        "grid": tables.runs(summaries["grid"]),
        "executors": tables.executors(summaries["executors"]),
        "memory": tables.memory(summaries["memory"]),
        "rest": tables.runs(summaries["rest"]),
        "machine": f"Machine: {data['machine']}.",
        "regions": regions.table(data.get("regions", [])),
    }
    if page is not None:
        code = data["code"]
        fill(page, blocks, {name: code.get(name, code.get("grid", "unknown")) for name in blocks})
        print(f"wrote {page}")


def main(args: list[str] | None = None) -> None:
    """Runs the study, and keeps what there is after each case, with the digest of the code of each group."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few cases in less than two minutes; writes no page")
    parser.add_argument(
        "--out", type=Path, help=f"folder of JSON and pictures (default {PICTURES}; out/load with --quick)"
    )
    parser.add_argument("--only", choices=[*groups(quick=True), "regions"], help="run one group again, keep the others")
    options = parser.parse_args(args)
    out = options.out or (Path("out/load") if options.quick else PICTURES)
    out.mkdir(parents=True, exist_ok=True)
    file = out / "load.json"
    data: dict[str, Any] = json.loads(file.read_text()) if options.only and file.is_file() else {}
    data = {"groups": {}, "code": {}, **data, "machine": short()}
    with isolated_unless_chosen():
        for group, members in groups(quick=options.quick).items():
            if options.only in (None, group):
                data["code"][group], data["groups"][group] = digest_of("node"), []
            for case in members if options.only in (None, group) else []:
                data["groups"][group].append(run(case))
                file.write_text(json.dumps(data, indent=1))
        if options.only in (None, "regions"):
            data["code"]["regions"], data["regions"] = digest_of("node"), regions.measure(quick=options.quick)
    file.write_text(json.dumps(data, indent=1))
    report(data, out, None if options.quick else PAGE)


if __name__ == "__main__":
    main()

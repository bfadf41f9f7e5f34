"""``make load``: the node under load, as real processes over DDS."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import monotonic
from typing import Any

from smartmesh_ros.startup.dds import isolated_unless_chosen
from studies.load import cases, pictures, regions, tables
from studies.load.cases import Case
from studies.load.processes import run_case
from studies.load.summary import Summary
from studies.load.tables import PAGE, PICTURES
from studies.machine import short
from studies.pages import digest_of, fill


def groups(*, quick: bool) -> dict[str, list[Case]]:
    """Everything that is run."""
    makers = {"grid": cases.grid, "executors": cases.executors, "memory": cases.memory, "rest": cases.rest}
    return {name: make(quick=quick) for name, make in makers.items()}


def run_all(chosen: dict[str, list[Case]], file: Path, known: dict[str, Any]) -> None:
    """Runs every case that is not ``known`` yet, a line each, and keeps what there is in ``file`` after each, with the
    digest of the code that each group was measured with."""
    groups = {**known.get("groups", {}), **{group: known.get("groups", {}).get(group, []) for group in chosen}}
    code = {**known.get("code", {}), **{group: digest_of("node") for group in chosen}}
    data: dict[str, Any] = {**known, "machine": short(), "code": code, "groups": groups}
    file.write_text(json.dumps(data, indent=1))
    start = monotonic()
    for group, members in chosen.items():
        done = {Case(**result["case"]).name for result in data["groups"][group]}
        for case in (case for case in members if case.name not in done):
            result = run_case(case)
            data["groups"][group].append(result)
            file.write_text(json.dumps(data, indent=1))
            s = Summary.of(result)
            print(
                f"{monotonic() - start:6.0f} s  {case.name:50s} update+step {s.update_and_step:6.2f} ms  "
                f"missed {100 * s.missed:6.2f} %  real time {s.real_time_factor:.2f}  lost {s.lost}",
                flush=True,
            )


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
    print(tables.targets(summaries))
    if page is not None:
        code = data["code"]
        fill(page, blocks, {name: code.get(name, code.get("grid", "unknown")) for name in blocks})
        print(f"wrote {page}")


def main(args: list[str] | None = None) -> None:
    """Runs the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few cases in less than two minutes; writes no page")
    parser.add_argument(
        "--out", type=Path, help=f"folder of JSON and pictures (default {PICTURES}; out/load with --quick)"
    )
    parser.add_argument("--report", action="store_true", help="only draw and write what was measured before")
    parser.add_argument("--resume", action="store_true", help="run only what was not measured before")
    parser.add_argument("--only", choices=[*groups(quick=True), "regions"], help="run one group again, keep the others")
    options = parser.parse_args(args)
    out = options.out or (Path("out/load") if options.quick else PICTURES)
    file = out / "load.json"
    if not options.report:
        out.mkdir(parents=True, exist_ok=True)
        known = json.loads(file.read_text()) if (options.resume or options.only) and file.is_file() else {}
        chosen = groups(quick=options.quick)
        if options.only:
            chosen = {name: cases for name, cases in chosen.items() if name == options.only}
            known.get("groups", {}).pop(options.only, None)
        with isolated_unless_chosen():
            run_all(chosen, file, known)
            if options.only in (None, "regions"):
                data = json.loads(file.read_text())
                code = {**data["code"], "regions": digest_of("node")}
                found = regions.measure(quick=options.quick)
                file.write_text(json.dumps({**data, "code": code, "regions": found}, indent=1))
    report(json.loads(file.read_text()), out, None if options.quick else PAGE)


if __name__ == "__main__":
    main()

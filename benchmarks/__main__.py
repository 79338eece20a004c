"""Runs benchmarks: `mjx-arenas bench [NAME ...]`."""

import fcntl
import json
import os
import pathlib
import sys
import time
import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from benchmarks import measure
from benchmarks.case import SIZES, Case
from benchmarks.cases import CASES
from mjx_arenas import gpu as gpu_
from mjx_arenas.parser import Parser

RESULTS = pathlib.Path(__file__).parent / "results"
OTHERS = "box_contacts, devices, training and when_needed are benchmarks with options of their own: mjx-arenas bench training --help."


def main(argv: Sequence[str] | None = None) -> int:
    """Runs cases; 1 if one failed, 2 if there is none of that name."""
    parser = Parser(prog="mjx-arenas bench", description="Measures what mjx_arenas costs.", epilog=OTHERS)
    parser.add_argument("names", nargs="*", metavar="NAME", help="names of cases (default: all)")
    parser.add_argument("--list", action="store_true", help="list the cases, and stop")
    parser.add_argument(
        "--size", choices=SIZES, help="size of the cases (default: by the device); tiny only checks that they run"
    )
    parser.add_argument("--json", action="store_true", help="print the results as JSON instead of lines")
    parser.add_argument("-o", "--out", type=pathlib.Path, help="folder of cpu.json and gpu.json, into which results go")
    argv = sys.argv[1:] if argv is None else argv
    options = parser.parse_args(argv)
    known = {case.name: case for case in CASES}
    unknown = [name for name in options.names if name not in known]
    if unknown:
        parser.error(f"There is no case {', '.join(unknown)}; there are {', '.join(known)}.")
    if options.list:
        for case in CASES:
            print(f"{case.name:16} {case.what}" + (f"; against {case.against}" if case.against else ""))
        return 0
    gpu_.leave_room(None)  # before JAX starts
    record = {"command": " ".join(["mjx-arenas bench", *argv]), **measure.environment()}
    gpu = record["platform"] != "cpu"
    size = options.size or ("gpu" if gpu else "cpu")
    out = options.out or (pathlib.Path("out/benchmarks") if size == "tiny" else RESULTS)
    stdout = os.dup(1)
    if options.json:
        os.dup2(2, 1)  # lines, and what native code prints
    done = {}
    for case in CASES:
        if case.name in options.names or (not options.names and size in case.sizes):
            done[case.name] = {"size": size, **record, **run(case, size)}
            merge(out / ("gpu.json" if gpu else "cpu.json"), {case.name: done[case.name]})
    if options.json:
        os.write(stdout, (json.dumps(done, indent=1) + "\n").encode())
    elif sys.stdout.isatty():
        table(done)
    return int(any("error" in result for result in done.values()))


def _answered(rows: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The rows; says in one sentence what to set where Warp finds no memory beside JAX."""
    from mjx_arenas.sim.warp_notes import no_room_answered

    with no_room_answered():
        yield from rows


def run(case: Case, size: str) -> dict[str, Any]:
    """The rows of one case as far as it came, and why it stopped if it did not come to its end."""
    rows, result = [], {"load_average": os.getloadavg()[0]}  # what else the machine does
    begin = time.perf_counter()
    try:
        if size not in case.sizes:
            raise measure.Skipped(f"not measured at size {size}")
        for row in _answered(case.function()(**case.sizes[size])):
            rows.append(row)
            for name, value in case.metrics(row).items():
                print(
                    f"{case.name}.{name} {value:.6g}" if isinstance(value, float) else f"{case.name}.{name} {value}",
                    flush=True,
                )
    except measure.Skipped as reason:
        result["skipped"] = str(reason)
    except Exception as error:  # the other cases go on
        result["error"] = f"{type(error).__name__}: {error}"
        traceback.print_exc()
    for word in result.keys() & {"skipped", "error"}:
        print(f"{case.name}.{word} {result[word]}", flush=True)
    result |= {"seconds": round(time.perf_counter() - begin, 1), "by": case.by, "rows": rows}
    return result | ({"targets": targets(case, rows)} if size == "gpu" and case.targets else {})


def targets(case: Case, rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """What each metric that has a target should be, and whether it is."""
    found = {}
    for row in rows:
        for name, value in case.metrics(row).items():
            if (target := case.target(name)) is not None:
                sign, bound = target
                met = {">=": value >= bound, "<=": value <= bound, "<": value < bound}[sign]
                found[name] = f"{sign} {bound:g}: {'met' if met else 'missed'}"
    return found


def merge(path: pathlib.Path, cases: Mapping[str, Any]) -> None:
    """Puts results into a file beside those of other cases; several processes may do so at once.

    What did not come to its end leaves earlier results as they are.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        results = json.loads(file.read() or "{}")
        ended = {name: case for name, case in cases.items() if not case.keys() & {"skipped", "error"}}
        results = {**cases, **results, **ended}
        order = {case.name: i for i, case in enumerate(CASES)}
        results = dict(sorted(results.items(), key=lambda item: order.get(item[0], len(order))))
        file.truncate(0)
        file.write(json.dumps(results, indent=1) + "\n")


def table(done: Mapping[str, Any]) -> None:
    """Prints a table with one line a row of results."""
    from rich.console import Console
    from rich.table import Table

    for name, result in done.items():
        reason = next((f"{word}: {result[word]}" for word in ("error", "skipped") if word in result), None)
        view = Table(title=name, title_justify="left", caption=reason)
        for column in result["rows"][0] if result["rows"] else ():
            view.add_column(column, justify="right")
        for row in result["rows"]:
            view.add_row(*(f"{v:.4g}" if isinstance(v, float) else str(v) for v in row.values()))
        Console().print(view)
        for metric, verdict in result.get("targets", {}).items():
            Console().print(f"  {metric} {verdict}")


if __name__ == "__main__":
    sys.exit(main())

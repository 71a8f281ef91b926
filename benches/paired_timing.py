"""Times two builds of ridgeway in turn, old, new, old, new …, and prints a table of ratios in Markdown.

    cargo build --release --example solve_problem --bin ridgeway     # in a checkout of each version
    python3 benches/paired_timing.py OLD/target/release NEW/target/release

Runs in turn see the same machine, so that the median of the ratios tells a few percent apart where the medians of the
times would not: what else the machine does slows both. The order within a pair alternates. Wall and user time and peak
memory are those of the whole process, as the system accounts for it; a solve is timed by `solve_problem` itself, the
best of five. Give --repeat 15 or more for a judgement within 3 %. Needs Python 3.9 and nothing else.
"""

import argparse
import json
import os
import subprocess
import time
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory

THREADS = ("1", "2")


def run(binary, arguments, folder):
    """Wall seconds, user seconds, peak memory in MB, and what it printed."""
    with open(folder / "output", "w+b") as output:
        begin = time.perf_counter()
        process = subprocess.Popen([binary, *arguments], cwd=folder, stdout=output, stderr=subprocess.STDOUT)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - begin
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        printed = output.read().decode()
    if process.returncode != 0:
        raise SystemExit(f"{binary} {' '.join(map(str, arguments))}\n{printed}")
    return {"wall": wall, "user": usage.ru_utime, "memory": usage.ru_maxrss / 1024}, printed


def command(arguments):
    """Measures a command as a whole."""
    return lambda build, scratch, more: run(build / "ridgeway", [*arguments, *more], scratch)[0]


def solve(problem, accuracy):
    """Measures a solve at 1001² alone; memory is that of the process."""
    what = ["--problem", problem, "--size", "1001", "--accuracy", accuracy, "--repeat", "5"]

    def measure(build, scratch, more):
        measured, printed = run(build / "examples" / "solve_problem", [*what, *more], scratch)
        return {"wall": min(json.loads(printed)["runs"][0]["solve_s"]), "memory": measured["memory"]}

    return measure


def cases(scratch, sizes):
    for problem in ("hills", "constant-25"):
        for accuracy in ("fast", "high"):
            yield f"solve {problem} 1001², {accuracy}", solve(problem, accuracy)
    for size in sizes:
        dem = scratch / f"range-{size}.tif"
        start, goal = (f"pixel:{int(share * size)},{int(share * size)}" for share in (0.05, 0.95))
        places = ["--start", start, "--goal", goal]
        metrics = ["--metrics", "isotropic,curvature"]
        outputs = {"distance": "d.tif", "compare": "compare"}
        for name, more in (("distance", []), ("distance", ["--accuracy", "high"]), ("compare", metrics)):
            words = [name, dem, *places, *more, "-o", outputs[name], "--overwrite", "--quiet"]
            yield f"`{' '.join([name, *more])}` {size}²", command(words)


def ratio(pairs, what):
    """Median and quartiles of new / old."""
    ratios = [new[what] / old[what] for old, new in pairs if what in old]
    if not ratios:
        return ""
    low, _, high = quantiles(ratios, n=4) if len(ratios) > 1 else ratios * 3
    return f"{median(ratios):.3f} ({low:.3f}–{high:.3f})"


def row(name, threads, pairs):
    wall = f"{median(old['wall'] for old, _ in pairs):.3f} s"
    memory = f"{median(old['memory'] for old, _ in pairs):.0f} MB"
    ratios = " | ".join(ratio(pairs, what) for what in ("wall", "user", "memory"))
    return f"| {name} | {threads} | {wall}, {memory} | {ratios} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path, help="folder with the binaries of one version")
    parser.add_argument("new", type=Path, help="folder with those of the other")
    parser.add_argument("--repeat", type=int, default=9, help="pairs for each row")
    parser.add_argument("--sizes", type=int, nargs="*", default=[1000, 4000], help="of the synthetic range")
    options = parser.parse_args()
    old, new = options.old.resolve(), options.new.resolve()
    with TemporaryDirectory() as scratch:
        scratch = Path(scratch)
        for size in options.sizes:
            words = ["synth", "range", "--size", f"{size}x{size}", "-o", scratch / f"range-{size}.tif"]
            run(old / "ridgeway", words, scratch)
        print(f"| {options.repeat} pairs | threads | before | wall, after / before (quartiles) | user | peak memory |")
        print("|---|---|---|---|---|---|", flush=True)
        for name, measure in cases(scratch, options.sizes):
            for threads in THREADS:
                pairs = []
                for turn in range(options.repeat):
                    order = (old, new) if turn % 2 == 0 else (new, old)
                    measured = {build: measure(build, scratch, ["--threads", threads]) for build in order}
                    pairs.append((measured[old], measured[new]))
                print(row(name, threads, pairs), flush=True)


if __name__ == "__main__":
    main()

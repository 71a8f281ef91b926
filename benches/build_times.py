"""Measures how long a checkout takes to build and test, and prints a Markdown table.

    git worktree add /tmp/before OLD-COMMIT
    python3 benches/build_times.py /tmp/before . --clean

Cold means an empty target folder with all sources fetched. User seconds are those of all processes; on a machine with
other work they are what can be compared. `--clean` removes the target folders of the checkouts. Needs Python 3.9 and
nothing else.
"""

import argparse
import os
import resource
import shutil
import subprocess
import time
from pathlib import Path

WARM = ("src/cli/report.rs", "src/export/gpx.rs")
BUILD = ["cargo", "build", "--release", "--locked"]
TEST = ["cargo", "test", "--locked"]


def timed(command, checkout):
    """Wall and user seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    begin = time.perf_counter()
    subprocess.run(command, cwd=checkout, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def after_a_line(file, checkout):
    """The tests after a line was added, and taken away again."""
    text = (checkout / file).read_text()
    try:
        (checkout / file).write_text(text + "// One line more.\n")
        return timed(TEST, checkout)
    finally:
        (checkout / file).write_text(text)


def measure(checkout, clean):
    target = checkout / "target"
    if target.exists() and not clean:
        raise SystemExit(f"{target} exists; --clean removes it")
    shutil.rmtree(target, ignore_errors=True)
    yield "`cargo build --release`, cold", timed(BUILD, checkout)
    shutil.rmtree(target)
    yield "`cargo test --no-run`, cold", timed([*TEST, "--no-run"], checkout)
    yield "`cargo test` after that", timed(TEST, checkout)
    for file in WARM:
        yield f"`cargo test` after a line in `{file}`", after_a_line(file, checkout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkout", type=Path, nargs="+")
    parser.add_argument("--clean", action="store_true")
    options = parser.parse_args()
    for checkout in options.checkout:
        subprocess.run(["cargo", "fetch", "--locked"], cwd=checkout, check=True, stderr=subprocess.DEVNULL)
        print(f"| {checkout.resolve().name}, {os.cpu_count()} processors | wall | user |\n|---|---|---|", flush=True)
        for name, (wall, user) in measure(checkout, options.clean):
            print(f"| {name} | {wall:.0f} s | {user:.0f} s |", flush=True)
        print()


if __name__ == "__main__":
    main()

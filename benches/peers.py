"""Runs ridgeway's solver and the eikonal solvers that Python users install, and prints Markdown tables.

    python3 -m venv /tmp/peers
    /tmp/peers/bin/pip install numpy scikit-fmm eikonalfm scikit-image fim-python
    /tmp/peers/bin/python benches/peers.py

The problems are those of benches/problems: a square of side 1, the source in its middle node. All solvers run on them
in turn, again and again, so that a busy machine slows all alike; the tables give medians. The peers use one thread.
Errors are relative, over the nodes more than three cells from the source at which the closed form holds; random-speed
has none, and is judged by eikonalfm's own answer at three times the resolution, which favours eikonalfm. On constant
speed a factored solver is exact by construction: linear-speed and random-speed tell more. scikit-fmm gets the source as
a zero of phi at one node; from a circle of a tenth of the side its mean error is some five times smaller.

scikit-fmm, eikonalfm and scikit-image know isotropic speeds only. The anisotropic solvers that are wheels and run on a
CPU, fim-python and eikonax, work on meshes of triangles; fim-python, in NumPy, is shown at the few nodes that it can
do in seconds, eikonax needs JAX and is left out. Hamiltonian fast marching, the best of them all, is C++ to be built
from source: the wheel of its Python front, agd, has solvers for a GPU and asks for that program on a CPU.
"""

import os

for pool in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ[f"{pool}_NUM_THREADS"] = "1"

import argparse
import json
import platform
import subprocess
import sys
import time
from contextlib import redirect_stdout
from functools import lru_cache
from importlib.metadata import version
from io import StringIO
from itertools import pairwise
from pathlib import Path
from statistics import median
from tempfile import NamedTemporaryFile

import eikonalfm
import numpy as np
import skfmm
from skimage.graph import MCP_Geometric

with redirect_stdout(StringIO()):  # It tells that it has no GPU.
    from fimpy.solver import create_fim_solver

ROOT = Path(__file__).resolve().parent.parent


# Problems -----------------------------------------------------------------------------------------------------------


def nodes(n):
    """x along columns, y along rows; -1/2 to 1/2."""
    axis = np.arange(n) / (n - 1) - 0.5
    return np.meshgrid(axis, axis)


@lru_cache
def speed(problem, n):
    x, y = nodes(n)
    if problem == "constant-1":
        return np.ones((n, n))
    if problem == "linear-speed":
        return 1 + x
    share, exponent = random_shares(7), np.zeros((n, n))
    for _ in range(40):
        frequency, direction, phase = 4 + 28 * next(share), 2 * np.pi * next(share), 2 * np.pi * next(share)
        exponent += np.cos(frequency * (np.cos(direction) * x + np.sin(direction) * y) + phase)
    return 10 ** np.clip(exponent / 2 / np.sqrt(20), -1, 1)


def random_shares(state):
    """Xorshift, as in benches/problems."""
    while True:
        for shift in (13, -7, 17):
            state ^= (state << shift if shift > 0 else state >> -shift) & (2**64 - 1)
        yield (state >> 11) / 2**53


@lru_cache
def exact(problem, n):
    """The closed form, NaN where it does not hold: a shortest way leaves the square."""
    if problem == "random-speed":
        return eikonalfm_distance(problem, 3 * (n - 1) + 1)[::3, ::3]
    x, y = nodes(n)
    if problem == "constant-1":
        return np.hypot(x, y)
    if problem == "constant-25":
        u, v = rotated(x, y)
        return np.sqrt(u * u + 25 * v * v)
    # Speed 1 + x is the half-plane of hyperbolic geometry: shortest ways are arcs centred at (-1, centre).
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = ((1 + x) ** 2 + y * y - 1) / (2 * y)
        passes_top = (centre * np.sign(y) > 0) & (np.abs(centre) < np.abs(y))
        bulges = passes_top & (np.hypot(1, centre) - 1 > 0.5)
    return np.where(bulges, np.nan, np.arccosh(1 + (x * x + y * y) / (2 * (1 + x))))


def rotated(x, y):
    """Coordinates along and across the fast axis of constant-25."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    return c * x + s * y, c * y - s * x


def errors(distance, closed_form):
    n = len(distance)
    far = np.abs(np.arange(n) - (n - 1) / 2) > 3
    judged = (far[:, None] | far) & np.isfinite(closed_form)
    relative = np.abs(distance[judged] / closed_form[judged] - 1)
    return {"mean": relative.mean(), "max": relative.max()}


# Solvers: problem and size to seconds and errors --------------------------------------------------------------------


def timed(solve, problem, n):
    begin = time.perf_counter()
    distance = solve()
    seconds = time.perf_counter() - begin
    return {"seconds": seconds} | errors(np.asarray(distance).reshape(n, n), exact(problem, n))


def scikit_fmm(problem, n):
    phi = np.ones((n, n))
    phi[n // 2, n // 2] = 0
    speeds = speed(problem, n)
    return timed(lambda: skfmm.travel_time(phi, speeds, dx=1 / (n - 1), order=2), problem, n)


def eikonalfm_distance(problem, n):
    source, step = (n // 2, n // 2), (1 / (n - 1),) * 2
    factor = eikonalfm.factored_fast_marching(speed(problem, n), source, step, 2)
    return factor * eikonalfm.distance(factor.shape, step, source, indexing="ij")


def eikonalfm_factored(problem, n):
    speed(problem, n)  # Made before the clock runs.
    return timed(lambda: eikonalfm_distance(problem, n), problem, n)


def scikit_image(problem, n):
    costs = 1 / (speed(problem, n) * (n - 1))
    return timed(lambda: MCP_Geometric(costs).find_costs([(n // 2, n // 2)])[0], problem, n)


def fim_python(problem, n):
    x, y = nodes(n)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    even = np.add.outer(np.arange(n - 1), np.arange(n - 1)).ravel() % 2 == 0
    first = np.where(even[:, None], np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    second = np.where(even[:, None], np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    triangles = np.concatenate([first, second])
    (ux, uy), (vx, vy) = rotated(1, 0), rotated(0, 1)  # Rows of the rotation, by columns.
    turn = np.array([[ux, vx], [uy, vy]])
    tensor = turn.T @ np.diag([1, 1 / 25]) @ turn
    tensors = np.broadcast_to(tensor, (len(triangles), 2, 2)).copy()
    solver = create_fim_solver(np.stack([x.ravel(), y.ravel()], 1), triangles, tensors)
    middle = np.array([i[n // 2, n // 2]])
    return timed(lambda: solver.comp_fim(middle, np.zeros(1)), problem, n)


class Ridgeway:
    """The example solve_problem; each call is a solve that is not timed and one that is."""

    def __init__(self, program, accuracy, threads):
        self.program, self.accuracy, self.threads = program, accuracy, threads
        self.name = f"**ridgeway** {accuracy}, {threads} thread" + ("s" if threads > 1 else "")

    def __call__(self, problem, n):
        options = {"problem": problem, "size": n, "accuracy": self.accuracy, "threads": self.threads, "repeat": 1}
        command = [self.program] + [f"--{key}={value}" for key, value in options.items()]
        with NamedTemporaryFile() as written:
            command.append(f"--write={written.name}")
            report = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
            distance = np.fromfile(written.name, "<f4").reshape(n, n)
        if error := report["error"]:
            error = {"mean": error["mean_relative"], "max": error["max_relative"]}
        else:
            error = errors(distance, exact(problem, n))
        run = report["runs"][0]
        solve = run["solve_s"][0]
        return {"seconds": solve, "whole": run["tensors_s"] + solve + run["values_s"][0]} | error


def build():
    """The path of the example, built."""
    command = ["cargo", "build", "--release", "--example", "solve_problem", "--message-format=json"]
    messages = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout.splitlines()
    built = [json.loads(message).get("executable") for message in messages]
    return next(path for path in built if path)


# Tables -------------------------------------------------------------------------------------------------------------


def measure(solvers, problem, n, repeat):
    """Medians by name of solver, of runs in turn."""
    runs = {name: [] for name in solvers}
    for _ in range(repeat):
        for name, solve in solvers.items():
            runs[name].append(solve(problem, n))
    return {
        name: {key: median(run[key] for run in of_solver) for key in of_solver[0]}
        | {"least": min(run["seconds"] for run in of_solver)}
        for name, of_solver in runs.items()
    }


def table(head, rows):
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print(flush=True)


def milliseconds(seconds):
    return f"{1e3 * seconds:.3g}" if seconds < 1 else f"{1e3 * seconds:.0f}"


def side_by_side(solvers, problem, n, repeat):
    """Times and errors, and both as multiples of the first solver's."""
    print(f"### {problem}, {n}² nodes\n")
    results = measure(solvers, problem, n, repeat)
    first = next(iter(results.values()))
    table(
        ["solver", "ms", "least", "ns/node", "time ratio", "mean error", "max error", "mean error ratio"],
        (
            [
                name,
                milliseconds(r["seconds"]),
                milliseconds(r["least"]),
                f"{1e9 * r['seconds'] / n**2:.1f}",
                f"{r['seconds'] / first['seconds']:.2f}",
                f"{r['mean']:.1e}",
                f"{r['max']:.1e}",
                f"{r['mean'] / first['mean']:.2g}",
            ]
            for name, r in results.items()
        ),
    )
    whole = ", ".join(f"{name} {milliseconds(r['whole'])}" for name, r in results.items() if "whole" in r)
    print(f"With making the tensors before and a row-major array after, ms: {whole}.\n")


GOALS = (1e-3, 1e-4, 1e-5, 1e-6)


def time_to_accuracy(solvers, problem, sizes, repeat):
    print(f"### Time to accuracy, {problem}: ms → mean / max error, and ms to a mean error\n")
    by_size = [measure(solvers, problem, n, repeat) for n in sizes]
    rows = []
    for name in solvers:
        results = [result[name] for result in by_size]
        cells = [f"{milliseconds(r['seconds'])} → {r['mean']:.1e} / {r['max']:.1e}" for r in results]
        rows.append([name, *cells, *(time_to(goal, results) for goal in GOALS)])
    table(["solver", *(f"{n}²" for n in sizes), *(f"to {goal:.0e}" for goal in GOALS)], rows)


def time_to(goal, results):
    """Interpolated by powers between two sizes; not extrapolated."""
    if results[0]["mean"] <= goal:
        return f"< {milliseconds(results[0]['seconds'])}"
    for coarse, fine in pairwise(results):
        if fine["mean"] <= goal:
            share = np.log(coarse["mean"] / goal) / np.log(coarse["mean"] / fine["mean"])
            return milliseconds(coarse["seconds"] ** (1 - share) * fine["seconds"] ** share)
    return f"> {milliseconds(results[-1]['seconds'])}"


def alone(program, problems, accuracies, n, *options):
    """Ridgeway on problems that no peer can do, on one thread and two in turn."""
    print(f"### {n}² nodes\n")
    command = [program, f"--problem={problems}", f"--size={n}", f"--accuracy={accuracies}", "--threads=1,2", *options]
    rows = []

    def per_node(seconds):
        return f"{1e9 * seconds / n**2:.1f}"

    for line in subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout.splitlines():
        report = json.loads(line)
        one, two = report["runs"]
        speedups = [a / b for a, b in zip(one["solve_s"], two["solve_s"])]
        error = report["error"]
        rows.append(
            [
                f"{report['problem']}, {report['accuracy']}",
                *(f"{per_node(median(run['solve_s']))} ({per_node(min(run['solve_s']))})" for run in (one, two)),
                f"{median(speedups):.2f} of {median(two['spin_speedup']):.2f}",
                f"{report['passes_per_node']:.1f}",
                f"{report['activations_per_tile']:.1f}",
                f"{error['mean_relative']:.1e} / {error['max_relative']:.1e} ({error['against']})" if error else "",
            ]
        )
    head = ["problem", "ns/node on 1 thread (least)", "on 2 threads (least)", "speed-up, of a spin loop's"]
    table(head + ["passes/node", "activations/tile", "mean / max error"], rows)


def calibration():
    """Milliseconds of a fixed loop, and how much two processes at once do of it compared with one."""
    loop = "import time; begin = time.perf_counter(); sum(range(3 * 10**7)); print(time.perf_counter() - begin)"
    spin = [sys.executable, "-c", loop]
    alone = float(subprocess.run(spin, check=True, stdout=subprocess.PIPE).stdout)
    both = [subprocess.Popen(spin, stdout=subprocess.PIPE) for _ in range(2)]
    together = max(float(process.communicate()[0]) for process in both)
    return f"Spin loop: {1e3 * alone:.0f} ms alone; two at once do {2 * alone / together:.2f} times the work of one.\n"


def processor():
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--accuracies", default="fast", help="of ridgeway, separated by commas (default: %(default)s)")
    parser.add_argument("--size", type=int, default=1001, help="nodes along a side (default: %(default)s)")
    parser.add_argument("--sizes", default="251,501,1001,2001", help="for time to accuracy (default: %(default)s)")
    parser.add_argument("--repeat", type=int, default=5, help="runs of each solver (default: %(default)s)")
    args = parser.parse_args()

    program = build()
    ours = [Ridgeway(program, accuracy, threads) for accuracy in args.accuracies.split(",") for threads in (1, 2)]
    ours = {solver.name: solver for solver in ours}
    one_thread = {name: solver for name, solver in ours.items() if solver.threads == 1}
    peers = {
        "eikonalfm, order 2, factored": eikonalfm_factored,
        "scikit-fmm, order 2": scikit_fmm,
        "scikit-image MCP_Geometric": scikit_image,
    }
    packages = ["numpy", "eikonalfm", "scikit-fmm", "scikit-image", "fim-python"]
    print(f"{processor()}, {os.cpu_count()} cores; Python {platform.python_version()}, ", end="")
    print(", ".join(f"{package} {version(package)}" for package in packages) + f"; medians of {args.repeat}.\n")

    print("## Isotropic\n")
    print(calibration())
    for problem in ("constant-1", "linear-speed", "random-speed"):
        side_by_side(ours | peers, problem, args.size, args.repeat)
    sizes = [int(n) for n in args.sizes.split(",")]
    for problem in ("constant-1", "linear-speed"):
        time_to_accuracy(one_thread | peers, problem, sizes, min(args.repeat, 3))
    print("## Anisotropic\n")
    print(calibration())
    side_by_side(ours | {"fim-python": fim_python}, "constant-25", 201, min(args.repeat, 3))
    for problem in ("constant-25", "constant-100", "constant-400", "diffeomorphism", "cylinder", "sphere-cap"):
        time_to_accuracy(one_thread, problem, sizes, min(args.repeat, 3))
    print("## Easy and hard, ridgeway alone\n")
    repeat = f"--repeat={args.repeat}"
    hard = "constant-1,hills,constant-400,rotating,random-speed,maze,spiral"
    alone(program, hard, args.accuracies, args.size, repeat, "--finer=4")
    alone(program, "constant-1,constant-25", args.accuracies, 4 * args.size - 3, repeat)
    print(calibration())


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""The solvers of Siconos and `drystone solve` on the same contact problems: a table for `drystone report convergence`.

    apt-get install python3-siconos python3-h5py python3-scipy
    python3 benches/against_siconos.py --drystone target/release/drystone --out siconos.csv FILE...
    drystone report convergence --siconos siconos.csv

A FILE is a contact problem that drystone reads: text, or FCLIB's HDF5 in global or local form. A global problem goes to the
global solvers of Siconos and, as W = H^T M^-1 H in blocks, to the local ones.

Siconos ends at its own error, drystone at e_vel. This script computes e_vel from the impulses of both. Each solver of Siconos
runs with the tolerances 1e-1, 1e-2 ... 1e-14, and the first run whose e_vel is at most a target counts for the target. Times are
those of the driver, without the assembly of W. Each solver runs in a process of its own, on one thread: some solvers crash, and
some do not end. The runs of drystone are half before and half after those of Siconos.
"""

import argparse
import csv
import json
import multiprocessing
import os
import pathlib
import subprocess
import tempfile
import time

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import h5py
import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg

TARGETS = [1e-2, 1e-4, 1e-8]
TOLERANCES = [10.0**-k for k in range(1, 15)]
MAX_ITERATIONS = 100_000
LOCAL = ["NSGS", "ADMM", "NSN_AC", "NSN_AC_TEST", "NSN_FB", "NSN_NM", "PROX", "TFP", "ACLMFP", "SOCLCP", "VI_EG", "VI_FPP"]
GLOBAL = ["NSGS_WR", "ADMM", "ADMM_WR", "NSN_AC_WR", "PROX_WR", "IPM", "ACLMFP"]


def matrix(group):
    """A matrix of FCLIB: entries (nz >= 0), columns (-1) or rows (-2)."""
    rows, columns, form = (int(np.ravel(group[name][()])[0]) for name in ("m", "n", "nz"))
    p, i, x = (group[name][()] for name in ("p", "i", "x"))
    if form >= 0:
        return sparse.coo_matrix((x, (i, p)), (rows, columns)).tocsr()
    kind = sparse.csc_matrix if form == -1 else sparse.csr_matrix
    return kind((x, i, p), (rows, columns)).tocsr()


class Problem:
    """u = W r + q with friction mu; M, H, f, w where the file has them."""

    def __init__(self, path):
        file = h5py.File(path, "r")
        self.is_global = "fclib_global" in file
        group = file["fclib_global" if self.is_global else "fclib_local"]
        self.mu = group["vectors/mu"][()]
        if self.is_global:
            self.m, self.h = matrix(group["M"]), matrix(group["H"])
            self.f, self.w = group["vectors/f"][()], group["vectors/w"][()]
            masses = sparse.linalg.splu(self.m.tocsc())
            self.delassus = (self.h.T @ sparse.csr_matrix(masses.solve(self.h.toarray()))).tocsr()
            self.q = self.h.T @ masses.solve(self.f) + self.w
        else:
            self.delassus, self.q = matrix(group["W"]), group["vectors/q"][()]
        self.rho = 3.0 / self.delassus.diagonal().reshape(-1, 3).sum(axis=1)

    def error(self, r):
        """e_vel, as drystone_problems::residuals defines it."""
        u = (self.delassus @ r + self.q).reshape(-1, 3)
        r, mu = r.reshape(-1, 3), self.mu
        x = r - self.rho[:, None] * u
        x[:, 0] -= self.rho * mu * np.linalg.norm(u[:, 1:], axis=1)
        length = np.linalg.norm(x[:, 1:], axis=1)
        normal = np.maximum(0.0, (x[:, 0] + mu * length) / (1.0 + mu * mu))
        scale = mu * normal / np.maximum(length, 1e-300)
        nearest = np.column_stack([normal, x[:, 1] * scale, x[:, 2] * scale])
        inside = length <= mu * x[:, 0]
        nearest[inside] = x[inside]
        error = np.linalg.norm((r - nearest) / self.rho[:, None]) / np.linalg.norm(self.q)
        return error if np.isfinite(error) else np.inf

    def to_blocks(self, path):
        """The local problem as a file of Siconos with W in 3x3 blocks, the storage that its sweeps are fastest with."""
        blocks = sparse.bsr_matrix(self.delassus, blocksize=(3, 3))
        blocks.sort_indices()
        count = len(self.mu)
        ends = " ".join(str(3 * i + 3) for i in range(count))
        numbers = lambda x: " ".join(f"{v:.17e}" for v in x)
        with open(path, "w") as file:
            file.write(f"3\n{count}\n1\n{3 * count}\n{3 * count}\n{len(blocks.indices)}\n{count}\n{count}\n{ends}\n{ends}\n")
            file.write(f"{count + 1}\n{len(blocks.indices)}\n{' '.join(map(str, blocks.indptr))}\n{' '.join(map(str, blocks.indices))}\n")
            for i, block in enumerate(blocks.data):
                file.write(f"{i}\n{numbers(block.T.ravel())}\n")
            file.write(f"{numbers(self.q)}\n{numbers(self.mu)}\n")


def solve(problem, form, name, blocks, limit, runs):
    """One solver with every tolerance; writes (tolerance, ms, iterations, e_vel) of each run. Runs in a process of its own."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    import siconos.numerics as sn

    if form == "global":
        theirs = sn.GlobalFrictionContactProblem()
        theirs.dimension, theirs.numberOfContacts = 3, len(problem.mu)
        theirs.M, theirs.H = problem.m.tocsc(), problem.h.tocsc()
        theirs.q, theirs.b, theirs.mu = problem.f, problem.w, problem.mu
        key = "SICONOS_GLOBAL_FRICTION_3D_" + name
    else:
        theirs = sn.frictionContact_new_from_filename(str(blocks))
        key = "SICONOS_FRICTION_3D_" + name
    begun = time.perf_counter()
    for tolerance in TOLERANCES:
        best = None
        for _ in range(3):
            options = sn.SolverOptions(getattr(sn, key))
            options.dparam[sn.SICONOS_DPARAM_TOL] = tolerance
            options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = MAX_ITERATIONS
            r, u, v = np.zeros(len(problem.q)), np.zeros(len(problem.q)), np.zeros(len(getattr(problem, "f", [])))
            start = time.perf_counter()
            if form == "global":
                sn.gfc3d_driver(theirs, r, u, v, options)
            else:
                sn.fc3d_driver(theirs, r, u, options)
            ms = 1e3 * (time.perf_counter() - start)
            if best is None or ms < best[0]:
                best = (ms, int(options.iparam[sn.SICONOS_IPARAM_ITER_DONE]), float(problem.error(r)))
            if ms > 100.0:
                break
        with open(runs, "a") as file:
            file.write(json.dumps([tolerance, *best]) + "\n")
        if best[2] <= TARGETS[-1] or time.perf_counter() - begun > limit:
            break


def siconos(problem, form, name, blocks, limit):
    """All runs of one solver that ended."""
    runs = blocks.with_suffix(".runs")
    runs.write_text("")
    child = multiprocessing.Process(target=solve, args=(problem, form, name, blocks, limit, runs))
    child.start()
    child.join(1.5 * limit)
    if child.is_alive():
        child.kill()
        child.join()
    return [json.loads(line) for line in runs.read_text().splitlines()]


def drystone(command, path, target, problem):
    """One run: (ms, iterations, e_vel), with the error that this script computes."""
    words = [command, "solve", path, "--method", "newton", "--tolerance", str(target), "--json"]
    ended = subprocess.run(words, capture_output=True, text=True)
    if ended.returncode != 0:
        return None
    report = json.loads(ended.stdout)
    return report["ms"], report["iterations"], float(problem.error(np.ravel(report["impulses"])))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="+", type=pathlib.Path)
    parser.add_argument("--drystone", default="target/release/drystone")
    parser.add_argument("--out", default="siconos.csv")
    parser.add_argument("--limit", type=float, default=20.0, help="seconds of a solver of Siconos on a problem")
    arguments = parser.parse_args()
    with open(arguments.out, "w", newline="") as out, tempfile.TemporaryDirectory() as folder:
        table = csv.writer(out)
        table.writerow(["problem", "form", "contacts", "solver", "target", "ms", "iterations", "e_vel"])
        for path in arguments.files:
            fclib = path
            if path.suffix == ".contacts":
                fclib = pathlib.Path(folder) / (path.stem + ".hdf5")
                subprocess.run([arguments.drystone, "export", path, "--fclib", fclib], check=True, capture_output=True)
            problem = Problem(fclib)
            blocks = pathlib.Path(folder) / "blocks.dat"
            problem.to_blocks(blocks)
            form = "global" if problem.is_global else "local"

            def put(solver, target, best):
                row = [f"{best[0]:.4f}", best[1], f"{best[2]:.2e}"] if best else ["", "", ""]
                table.writerow([path.stem, form, len(problem.mu), solver, f"{target:.0e}", *row])
                print(path.stem, solver, f"{target:.0e}", *row, flush=True)

            ours = lambda: {target: [drystone(arguments.drystone, path, target, problem) for _ in range(3)] for target in TARGETS}
            before = ours()
            for kind, name in [("local", s) for s in LOCAL] + [("global", s) for s in GLOBAL if problem.is_global]:
                runs = siconos(problem, kind, name, blocks, arguments.limit)
                for target in TARGETS:
                    first = next((run[1:] for run in runs if run[3] <= target), None)
                    put(("global " if kind == "global" else "") + name, target, first)
            after = ours()
            for target in TARGETS:
                solved = [run for run in before[target] + after[target] if run and run[2] <= 1.01 * target]
                put("drystone", target, min(solved) if solved else None)
            out.flush()


if __name__ == "__main__":
    main()

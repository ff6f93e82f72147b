"""Random stage programmes and the dense programme each is equal to, put together by brute force."""

import numpy as np

from motionserver.solvers.base import QpMatrices, QpVectors
from motionserver.solvers.stage import Stage, StageProgramme


def random_programme(seed, stages=5, terminal=False, hard=True):
    """Feasible by construction: hard bounds leave room about a trajectory of the dynamics."""
    rng = np.random.default_rng(seed)
    sizes = [int(n) for n in rng.integers(2, 5, stages)]
    inputs = [int(k) for k in rng.integers(1, 4, stages - 1)] + [int(rng.integers(0, 2))]
    start = rng.normal(size=sizes[0])
    x, made = start, []
    for number, (n, k) in enumerate(zip(sizes, inputs, strict=True)):
        last = number == stages - 1
        after, g = (0 if last else sizes[number + 1]), int(rng.integers(1, 5))
        root = rng.normal(size=(n + k, n + k))
        cost = root @ root.T + 0.5 * np.eye(n + k)
        A, B = 0.7 * rng.normal(size=(after, n)), rng.normal(size=(after, k))
        C, D = rng.normal(size=(g, n)), rng.normal(size=(g, k))
        u = 0.3 * rng.normal(size=k)
        middle = C @ x + D @ u
        lower = middle - rng.uniform(0.05, 1.0, g)
        upper = middle + rng.uniform(0.05, 1.0, g)
        lower[rng.random(g) < 0.4] = -np.inf
        upper[rng.random(g) < 0.2] = np.inf
        soft = np.flatnonzero(rng.random(g) < (0.4 if hard else 1.1)).astype(np.intc)
        # soft rows may well be out of reach
        upper[soft] -= rng.uniform(0.0, 1.5, len(soft))
        lower = np.minimum(lower, upper - 0.1)
        if last and terminal:
            C, D = np.eye(n)[:g], np.zeros((min(g, n), k))
            lower = upper = x[: min(g, n)].copy()
            soft = np.empty(0, dtype=np.intc)
        made.append(
            Stage(
                A,
                B,
                0.1 * rng.normal(size=after),
                np.ascontiguousarray(cost[:n, :n]),
                np.ascontiguousarray(cost[n:, :n]),
                np.ascontiguousarray(cost[n:, n:]),
                3.0 * rng.normal(size=n),
                3.0 * rng.normal(size=k),
                np.ascontiguousarray(C),
                D,
                lower,
                upper,
                soft,
                rng.uniform(0.5, 3.0, len(soft)),
                rng.uniform(0.1, 2.0, len(soft)),
            )
        )
        if not last:
            x = A @ x + B @ u + made[-1].b
    return StageProgramme(start, tuple(made))


def condensed(programme):
    """Variables: all inputs, then a lower and an upper slack for each soft row."""
    stages = programme.stages
    k_all = sum(stage.sizes[1] for stage in stages)
    s_all = sum(len(stage.soft) for stage in stages)
    size = k_all + 2 * s_all
    H, q = np.zeros((size, size)), np.zeros(size)
    rows, lower, upper = [], [], []
    # x = M v + c
    M, c = np.zeros((len(programme.start), size)), np.array(programme.start)
    at, slack = 0, k_all
    for stage in stages:
        _, k, g = stage.sizes
        U = np.zeros((k, size))
        U[:, at : at + k] = np.eye(k)
        at += k
        both = np.vstack((M, U))
        offset = np.concatenate((c, np.zeros(k)))
        cost = np.block([[stage.Q, stage.S.T], [stage.S, stage.R]])
        H += both.T @ cost @ both
        q += both.T @ (cost @ offset + np.concatenate((stage.q, stage.r)))
        for row in range(g):
            above = stage.C[row] @ M + stage.D[row] @ U
            known = stage.C[row] @ c
            below = above.copy()
            if row in stage.soft:
                index = int(np.flatnonzero(stage.soft == row)[0])
                for j in (slack, slack + 1):
                    H[j, j] += stage.quadratic[index]
                    q[j] += stage.linear[index]
                below[slack] += 1.0
                above[slack + 1] -= 1.0
                slack += 2
            rows += [below, above]
            lower += [stage.lower[row] - known, -np.inf]
            upper += [np.inf, stage.upper[row] - known]
        M, c = stage.A @ M + stage.B @ U, stage.A @ c + stage.b
    # slacks are not negative
    rows += list(np.eye(size)[k_all:])
    lower += [0.0] * (2 * s_all)
    upper += [np.inf] * (2 * s_all)
    lower, upper = np.array(lower), np.array(upper)
    there = np.isfinite(lower) | np.isfinite(upper)
    vectors = QpVectors(q, lower[there], upper[there], np.empty(0), np.empty(0))
    return QpMatrices(0.5 * (H + H.T), np.array(rows)[there]), vectors, k_all

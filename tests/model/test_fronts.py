"""Elimination by fronts solves what scipy solves, compiled or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from flexctrl.kernels.native import Packed, Reals, Singles
from flexctrl.model.flat import fronts
from flexctrl.model.flat.fronts import Fronts, Plan, factor, plan_of
from flexctrl.model.flat.solving import solve

pytest.importorskip("llvmlite")


@dataclass
class Problem:
    fronts: Fronts
    entries: Reals
    diagonal: Reals
    down: Reals
    up: Reals
    b: Reals
    work: Reals


def solved(m: Problem) -> int:
    where = factor(m.fronts, m.entries, m.diagonal, m.down, m.up)
    if where < 0:
        solve(m.fronts, m.down, m.up, m.b, m.work)
    return where


@dataclass
class Brief:
    fronts: Fronts
    down: Singles
    up: Singles
    b: Reals
    work: Reals


def solved_briefly(m: Brief) -> int:
    solve(m.fronts, m.down, m.up, m.b, m.work)
    return 0


def chain(links: int, freedoms: int, rng: np.random.Generator) -> sp.csr_matrix:
    """Blocks along a line, as beams have them, the last hung on the middle too: a tree with a branch."""
    A = sp.lil_matrix((freedoms * (links + 1),) * 2)
    for link in range(links):
        first = freedoms * (link if link < links - 1 else links // 2)
        cells = np.r_[first : first + freedoms, freedoms * (link + 1) : freedoms * (link + 2)]
        A[np.ix_(cells, cells)] = A[np.ix_(cells, cells)].toarray() + rng.normal(size=(len(cells),) * 2)
    return (A + 8.0 * freedoms * sp.identity(A.shape[0])).tocsr()


RNG = np.random.default_rng(5)
MATRICES = {
    "beams": chain(9, 6, RNG),
    "planar": chain(12, 3, RNG),
    "single": chain(30, 1, RNG),
    "sevens": chain(5, 7, RNG),
    "wide": chain(3, 18, RNG),
    "grid": sp.kronsum(sp.diags([-1, 2.5, -1.3], [-1, 0, 1], (6, 6)), sp.diags([-1, 2.5, -1], [-1, 0, 1], (7, 7))),
    "scattered": sp.random(50, 50, 0.08, random_state=4) + 4.0 * sp.identity(50),
    "full": sp.csr_matrix(RNG.normal(size=(19, 19)) + 9.0 * np.eye(19)),
    "diagonal": sp.identity(11) * 3.0,
    "one": sp.csr_matrix([[2.0]]),
}


def problem(A: sp.spmatrix, b: np.ndarray) -> tuple[Plan, Problem]:
    A = A.tocoo()
    plan = plan_of(A.row, A.col, A.shape[0])
    entries = np.zeros(plan.length)
    np.add.at(entries, plan.places(A.row, A.col), A.data)
    f = plan.fronts
    room = [np.zeros(size) for size in (len(b), f.below + 8, f.right + 8)]
    return plan, Problem(f, entries, *room, b[plan.order], np.zeros(plan.widest))


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("name", MATRICES)
def test_solutions_are_those_of_scipy(name, compiled):
    A = MATRICES[name].tocsc()
    b = np.random.default_rng(1).normal(size=A.shape[0])
    plan, m = problem(A, b)
    assert (Packed(m).bound(solved)() if compiled else solved(m)) == -1
    x = np.empty_like(b)
    x[plan.order] = m.b
    assert np.allclose(x, np.atleast_1d(spsolve(A, b)), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("name", ["beams", "planar", "wide"])
def test_solutions_do_not_hang_on_how_many_nodes_are_eliminated_together(name, compiled, monkeypatch):
    """Where factors fit no near cache nodes are eliminated one by one: 2/3 of the numbers, for the same answer."""
    b = np.random.default_rng(2).normal(size=MATRICES[name].shape[0])
    together, _ = problem(MATRICES[name], b)
    monkeypatch.setattr(fronts, "LARGE", 0)
    plan, m = problem(MATRICES[name], b)
    assert plan.fronts.below <= together.fronts.below
    assert (Packed(m).bound(solved)() if compiled else solved(m)) == -1
    x = np.empty_like(b)
    x[plan.order] = m.b
    assert np.allclose(x, spsolve(MATRICES[name].tocsc(), b), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("nodes", [1, 2])
@pytest.mark.parametrize("name", MATRICES)
def test_factors_in_single_precision_keep_six_digits(name, nodes, compiled, monkeypatch):
    A = MATRICES[name].tocsc()
    b = np.random.default_rng(3).normal(size=A.shape[0])
    monkeypatch.setattr(fronts, "LARGE", 0 if nodes == 1 else fronts.LARGE)
    _, m = problem(A, b)
    right = m.b.copy()
    assert solved(m) == -1
    brief = Brief(m.fronts, m.down.astype(np.float32), m.up.astype(np.float32), right, m.work.copy())
    assert (Packed(brief).bound(solved_briefly)() if compiled else solved_briefly(brief)) == 0
    apart = np.abs(brief.b - m.b).max() / np.abs(m.b).max()
    assert apart < 1e-6
    assert apart > 0.0 or np.array_equal(brief.down, m.down)


@pytest.mark.parametrize("compiled", [False, True])
def test_a_vanishing_pivot_is_reported(compiled):
    A = MATRICES["planar"].tolil()
    A[:, 7] = A[:, 8]
    plan, m = problem(A, np.ones(A.shape[0]))
    where = Packed(m).bound(solved)() if compiled else solved(m)
    assert plan.order[where] in (6, 7, 8)


def test_elimination_of_a_chain_fills_but_what_two_nodes_taken_together_have():
    """12 pivots and 6 others: 12 (2 · 18 − 12) entries where node by node there are 2 · 6 (2 · 12 − 6)."""
    A = MATRICES["beams"]
    plan, _ = problem(A, np.ones(A.shape[0]))
    f = plan.fronts
    assert A.nnz <= (f.pivots * (2 * f.size - f.pivots)).sum() <= 4 / 3 * A.nnz


def test_no_unknowns_are_no_trouble():
    plan, m = problem(sp.csr_matrix((0, 0)), np.zeros(0))
    assert plan.length == 0
    assert solved(m) == -1

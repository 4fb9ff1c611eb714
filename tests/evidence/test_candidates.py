import math
from types import SimpleNamespace

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.evidence import candidates
from ridgebayes.evidence.candidates import Candidate, Weighing, evaluate
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.moves import Independence
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations


def draws_of(model):
    rng = np.random.default_rng(1)
    return SimpleNamespace(coordinates=rng.standard_normal((256, model.n_coordinate)))


@pytest.mark.parametrize(
    ("noise", "se_most", "expected"),
    [("step:student", 0.1, [128]), ("step:student", 0.01, [128, 128, 256]), ("step", 0.01, [128])],
)
def test_evaluate__draws_again_where_drawn_offsets_leave_an_evidence_unsure(
    monkeypatch, noise, se_most, expected
):
    data = Observations.from_table(rb.paper_sweep())
    laplace = fit_laplace(Model(data, rb.Modified(), Noise.named(noise)))
    tried, proposals = [], []

    def drawn(model, laplace, proposal, *, seed, n_draw):
        tried.append(n_draw)
        proposals.append(proposal)
        return draws_of(model), LogEvidence("importance", float(n_draw), 6.4 / n_draw)

    monkeypatch.setattr(candidates, "importance_posterior", drawn)
    monkeypatch.setattr(candidates, "several_modes", lambda model, laplace: ())
    first = Candidate("modified", noise, LogEvidence("laplace", 0.0, math.nan), laplace)
    efforts = tuple({"n_draw": n} for n in (128, 256))
    task = Weighing(
        data,
        rb.Modified(),
        Noise.named(noise),
        {},
        0,
        screened=first,
        efforts=efforts,
        se_most=se_most,
    )
    assert evaluate(task).evidence.value == tried[-1]
    assert tried == expected
    assert proposals[0] is None
    assert all(isinstance(one, Independence) for one in proposals[1:])  # fitted to the draws before


def test_evaluate__keeps_what_fewer_draws_found_where_more_fail(monkeypatch):
    data = Observations.from_table(rb.paper_sweep())
    laplace = fit_laplace(Model(data, rb.Modified(), Noise.named("step:student")))

    def drawn(model, laplace, proposal, *, seed, n_draw):
        status = "ok" if n_draw == 128 else "importance weights: Pareto k 0.78, above 0.7"
        return draws_of(model), LogEvidence("importance", float(n_draw), 0.05, status)

    monkeypatch.setattr(candidates, "importance_posterior", drawn)
    monkeypatch.setattr(candidates, "several_modes", lambda model, laplace: ())
    first = Candidate("modified", "step:student", LogEvidence("laplace", 0.0, math.nan), laplace)
    efforts = tuple({"n_draw": n} for n in (128, 256))
    given = {"screened": first, "efforts": efforts, "se_most": 0.01}
    task = Weighing(data, rb.Modified(), Noise.named("step:student"), {}, 0, **given)
    assert evaluate(task).evidence.value == 128.0


@pytest.mark.parametrize(("se", "method"), [(0.2, "importance"), (0.6, "laplace")])
def test_evaluate__prefers_uneven_draws_to_laplace_while_they_agree(monkeypatch, se, method):
    data = Observations.from_table(rb.paper_sweep())
    laplace = fit_laplace(Model(data, rb.Modified(), Noise()))
    heavy = LogEvidence("importance", 3.0, se, "importance weights: Pareto k 0.86, above 0.7")
    monkeypatch.setattr(candidates, "importance_posterior", lambda *a, **k: (None, heavy))
    monkeypatch.setattr(candidates, "several_modes", lambda model, laplace: ())
    first = Candidate("modified", "step:student", LogEvidence("laplace", 0.0, math.nan), laplace)
    given = {"screened": first, "efforts": ({},)}
    task = Weighing(data, rb.Modified(), Noise.named("step:student"), {}, 0, **given)
    assert evaluate(task).evidence.method == method
    assert evaluate(task).evidence.ok

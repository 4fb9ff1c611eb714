import math
from dataclasses import replace

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.commands.request import FitRequest
from ridgebayes.commands.run import run_job
from ridgebayes.commands.run_files import read_run
from ridgebayes.errors import InputError
from ridgebayes.evidence import quadrature_evidence
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.presets import PRESETS, QUICK, REFERENCE, STANDARD, Preset
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.results import calibrate
from ridgebayes.simulate.generation import LOAD_PRESETS, generate


def test_accuracies__are_three_each_tighter_than_the_one_before():
    assert list(PRESETS) == ["quick", "standard", "reference"]
    for looser, tighter in ((QUICK, STANDARD), (STANDARD, REFERENCE)):
        assert tighter.moment_error < looser.moment_error
        assert tighter.evidence_error < looser.evidence_error
    errors = [preset.load_error for preset in LOAD_PRESETS.values()]
    assert list(LOAD_PRESETS) == list(PRESETS)
    assert errors == sorted(errors, reverse=True)
    with pytest.raises(
        InputError, match=r"accuracy: expected one of quick, standard, reference, got 'best'"
    ):
        Preset.named("best")


@pytest.fixture(scope="module")
def exact(paper):
    """A quarter of a million draws of Hybrid's posterior, and its evidence by quadrature."""
    model = Model(Observations.from_table(paper), rb.Hybrid(), Noise.named("iid"))
    fit, _ = importance_posterior(model, seed=11, n_draw=65_536)
    theta = fit.model.to_theta(fit.chains.u.reshape(-1, 3))
    from ridgebayes.inference.laplace import fit_laplace

    return theta, quadrature_evidence(model.log_density, fit_laplace(model)).value


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["quick", "standard", pytest.param("reference", marks=pytest.mark.long)]
)
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_accuracy__keeps_what_it_promises_of_posteriors_and_evidences(paper, exact, name, seed):
    wanted, (theta, log_evidence) = PRESETS[name], exact
    cmp = rb.compare(paper, [rb.Hybrid()], rng=seed, accuracy=wanted, noise="iid")
    u = cmp.fits["hybrid"].chains.u
    found = cmp.fits["hybrid"].model.to_theta(u.reshape(-1, 3))
    sd = theta.std(axis=0)
    for moment in (
        lambda x: x.mean(axis=0),
        lambda x: x.std(axis=0),
        lambda x: np.quantile(x, 0.05, axis=0),
        lambda x: np.quantile(x, 0.95, axis=0),
    ):
        # 1/250 of an sd is the exact draws' own Monte Carlo error, twice.
        assert np.abs((moment(found) - moment(theta)) / sd).max() < wanted.moment_error + 0.004
    used = cmp.evidence[cmp.evidence["used"]]["log_evidence"].iloc[0]
    assert abs(used - log_evidence) < wanted.evidence_error
    assert cmp.accuracy == name


@pytest.mark.parametrize("name", list(PRESETS))
def test_accuracy__keeps_what_it_promises_of_loads(name):
    scene = rb.Scene.of([(0.022, 0.02), (0.012, 0.09), (0.04, 0.004)], p_over_E=0.02)
    exact = generate(scene, rel_tol=1e-12).column("p_over_E")
    found = generate(scene, accuracy=name).column("p_over_E")
    # The finest tolerance has an error of its own: rounding, 1e-13 of a load.
    assert np.abs(found / exact - 1).max() < LOAD_PRESETS[name].load_error + 1e-12


@pytest.mark.slow
def test_quick__walks_where_importance_weights_are_too_uneven(paper, monkeypatch):
    plain = rb.compare(paper, [rb.Modified()], rng=2, accuracy=QUICK, noise="iid")
    assert plain.fits["modified"].sampler == "importance"
    assert plain.evidence["method"].tolist() == ["quadrature", "laplace"]

    def uneven(*args, **options):
        fit, evidence = importance_posterior(*args, **options)
        return replace(
            fit, convergence_failures=("importance weights: Pareto k 0.9, above 0.7",)
        ), evidence

    monkeypatch.setattr("ridgebayes.comparison.compare.importance_posterior", uneven)
    walked = rb.compare(paper, [rb.Modified()], rng=2, accuracy=QUICK, noise="iid")
    assert walked.evidence["method"].tolist()[0] == "bridge"
    assert walked.complete


@pytest.mark.long
@pytest.mark.slow
def test_quick_run__chooses_the_same_error_model_and_form(tmp_path):
    cmp = run_job(tmp_path / "out", FitRequest(accuracy="quick"), workers=1)
    assert cmp.complete
    assert (cmp.noise.name, cmp.best) == ("step-smooth", "hybrid")
    assert not (tmp_path / "out/reference-fe").exists()
    assert not (tmp_path / "out/left_out.csv").exists()
    again = read_run(tmp_path / "out")
    assert again.accuracy == "quick"
    assert not (tmp_path / "out/costs.csv").exists()
    assert {len(fit.draws) for fit in again.fits.values()} == {QUICK.n_kept}
    page = (tmp_path / "out/report.md").read_text(encoding="utf-8")
    assert "<summary>Accuracy and run time</summary>" in page
    assert "Accuracy quick: the target error is" in page
    # The standard evidence of this pair, by bridge sampling: 261.9.
    used = cmp.evidence[cmp.evidence["used"] & (cmp.evidence["form"] == "hybrid")]
    own = used[used["noise"] == "step-smooth"]["log_evidence"].max()
    assert math.isclose(own, 261.89, abs_tol=3 * QUICK.evidence_error)


def test_settings__of_moves_by_another_name_are_refused():
    with pytest.raises(
        InputError, match=r"moves: expected mixture, independence, .*, got 'snooker'"
    ):
        rb.SampleSettings(moves="snooker")


@pytest.mark.slow
@pytest.mark.long
def test_settings__of_moves_are_known_by_name(paper):
    sds = {}
    for moves in ("mixture", "independence", "differential evolution", "stretch"):
        settings = rb.SampleSettings(n_walker=64, moves=moves, tau_change=0.1)
        fit = calibrate(paper, rb.Hybrid(), rng=3, settings=settings, noise="iid")
        sds[moves] = fit.summary["sd"].to_numpy()
        assert fit.converged, moves
    for moves, sd in sds.items():
        # Monte Carlo: sds of a few thousand effective draws, to 6 %: five of their errors.
        np.testing.assert_allclose(sd, sds["mixture"], rtol=0.06, err_msg=moves)

"""What a result lists to be cited is what it rests on, no more and no less."""

from dataclasses import replace

import ridgebayes as rb


def used(result):
    return set(rb.citations(result)["used"])


def test_comparison__lists_samplers_evidences_and_scores(comparison):
    found = used(comparison)
    assert {"forms", "importance sampling", "MCMC", "bridge sampling", "stacking"} <= found
    assert "finite elements" not in found
    unscored = replace(comparison, loo=comparison.loo.head(0))
    assert found - used(unscored) == {"leave-one-out scores", "stacking"}


def test_comparison__on_finite_elements_lists_them(comparison):
    table = rb.reference_fe()
    assert "finite elements" in used(replace(comparison, table=table))


def test_comparison__that_walked_no_form_lists_no_walk(comparison):
    evidence = comparison.evidence[comparison.evidence["method"] != "bridge"]
    found = used(replace(comparison, evidence=evidence))
    assert used(comparison) - found == {"MCMC", "moves", "bridge sampling", "its error"}


def test_fit__lists_its_own_sampler_alone(comparison):
    fit = comparison.fits["hybrid"]
    assert "importance sampling" in used(fit)
    assert "bridge sampling" not in used(fit)
    walked = replace(fit, sampler="emcee")
    assert used(walked) ^ used(fit) == {"MCMC", "moves", "importance sampling"}


def test_references__can_be_found_by_a_number(comparison):
    frame = rb.citations(comparison)
    assert frame.loc[frame["doi"] == "", "used"].tolist() == ["this package"]
    assert rb.__version__ in frame["reference"][0]

"""Works to cite: the study, the methods behind a result, and the packages that computed it."""

from collections.abc import Mapping

import pandas as pd

from ridgebayes._types import __version__
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.results import Fit

# Method or package, its authors, and its DOI or arXiv number.
_ALWAYS = (
    ("this package", f"ridgebayes {__version__}", ""),
    (
        "forms",
        "A parametric contact model to describe the interlocking of soft bodies with ridged "
        "surface textures used in haptic applications, "
        "International Journal of Solids and Structures",
        "10.1016/j.ijssolstr.2019.06.026",
    ),
    ("arrays", "Harris et al. (2020), NumPy", "10.1038/s41586-020-2649-2"),
    ("algorithms", "Virtanen et al. (2020), SciPy", "10.1038/s41592-019-0686-2"),
    ("diagnostics", "Kumar et al. (2019), ArviZ", "10.21105/joss.01143"),
    ("R-hat, effective sample size", "Vehtari et al. (2021)", "10.1214/20-BA1221"),
)
_OF_SAMPLERS = {
    "importance": (("importance sampling", "Cappe et al. (2008)", "10.1007/s11222-008-9059-x"),),
    "emcee": (
        ("MCMC", "Foreman-Mackey et al. (2013), emcee", "10.1086/670067"),
        ("moves", "ter Braak & Vrugt (2008)", "10.1007/s11222-008-9104-9"),
    ),
}
_OF_EVIDENCES = {
    "bridge": (
        ("bridge sampling", "Gronau et al. (2017)", "10.1016/j.jmp.2017.09.005"),
        ("its error", "Micaletto & Vehtari (2025)", "arXiv:2508.14487"),
    ),
}
_OF_FACTORS = (
    ("words for Bayes factors", "Kass & Raftery (1995)", "10.1080/01621459.1995.10476572"),
)
_OF_SCORES = (
    ("leave-one-out scores", "Vehtari, Gelman & Gabry (2017)", "10.1007/s11222-016-9696-4"),
    ("stacking", "Yao et al. (2018)", "10.1214/17-BA1091"),
)
_OF_ELEMENTS = (
    ("finite elements", "Gustafsson & McBain (2020), scikit-fem", "10.21105/joss.02369"),
)


def citations(result: Fit | Comparison) -> pd.DataFrame:
    """List the methods and packages that a result used, for citation.

    Parameters
    ----------
    result : Fit or Comparison
        Its samplers and methods of evidence decide what is listed, and for a comparison also the
        solver of its table.

    Returns
    -------
    pandas.DataFrame
        Columns used, reference, doi (empty for this package).

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], noise="iid", rng=1)
    >>> list(rb.citations(cmp)["used"])[6:]
    ['importance sampling', 'MCMC', 'moves', 'bridge sampling', 'its error',
    'words for Bayes factors', 'leave-one-out scores', 'stacking']
    """
    fits = list(result.fits.values()) if isinstance(result, Comparison) else [result]
    samplers = {one.sampler for fit in fits for one in (fit, *fit.others.values())}
    methods = set(result.evidence["method"]) if isinstance(result, Comparison) else set()
    if "bridge" in methods:  # from a walk to its evidence
        samplers.add("emcee")
    rows = [*_ALWAYS, *_chosen(_OF_SAMPLERS, samplers), *_chosen(_OF_EVIDENCES, methods)]
    if isinstance(result, Comparison):
        rows += [*_OF_FACTORS] * (not result.bayes_factors.empty)
        rows += [*_OF_SCORES] * (not result.loo.empty)
        by_elements = result.table.frame["solver"].astype(str).str.startswith("cylinder")
        rows += [*_OF_ELEMENTS] * bool(by_elements.any())
    return pd.DataFrame(rows, columns=["used", "reference", "doi"])


def _chosen(
    known: Mapping[str, tuple[tuple[str, str, str], ...]], names: set[str]
) -> list[tuple[str, str, str]]:
    """Return the rows of those names that there are, in the order of the lists above."""
    return [row for name, rows in known.items() if name in names for row in rows]

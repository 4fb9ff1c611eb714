"""Works to cite for a result: the study, its methods and the packages used."""

import io
from importlib.resources import files

import pandas as pd

from ridgebayes._types import __version__
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.errors import expect
from ridgebayes.results import Fit

_COLUMNS = ["used", "reference", "doi"]


def citations(result: Fit | Comparison) -> pd.DataFrame:
    """List the methods and packages that a result used, for citation.

    Parameters
    ----------
    result : Fit or Comparison
        Result. Its samplers and evidence methods determine the works, as does the solver in the
        table of a comparison.

    Returns
    -------
    pandas.DataFrame
        Columns used, reference, doi (empty for this package).

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), ["modified", "hybrid"], noise="iid", accuracy="quick")
    >>> list(rb.citations(cmp)["used"])[6:]
    ['importance sampling', 'words for Bayes factors', 'leave-one-out scores', 'stacking']
    """
    expect(Fit, Comparison, result=result)
    fits = list(result.fits.values()) if isinstance(result, Comparison) else [result]
    reasons = {"always"}
    reasons |= {posterior.sampler for fit in fits for posterior in (fit, *fit.others.values())}
    if isinstance(result, Comparison):
        reasons |= set(result.evidence["method"])
        by_elements = result.table.frame["solver"].astype(str).str.startswith("cylinder").any()
        reasons |= {"factors"} if len(result.bayes_factors) else set()
        reasons |= {"scores"} if len(result.loo) else set()
        reasons |= {"elements"} if by_elements else set()
    if "bridge" in reasons:  # bridge sampling uses the chains of emcee
        reasons.add("emcee")
    text = (files("ridgebayes.comparison") / "citations.csv").read_text(encoding="utf-8")
    works = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
    package = pd.DataFrame([("this package", f"ridgebayes {__version__}", "")], columns=_COLUMNS)
    return pd.concat([package, works.loc[works["with"].isin(reasons), _COLUMNS]], ignore_index=True)

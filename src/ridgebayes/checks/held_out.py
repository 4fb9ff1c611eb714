"""Held-out rows beside the bands that were predicted for them."""

from dataclasses import replace
from weakref import WeakKeyDictionary

import pandas as pd

from ridgebayes.comparison.bands import loads_table
from ridgebayes.comparison.comparison import Comparison

# Figure, HTML and Markdown all ask for it.
_known: "WeakKeyDictionary[Comparison, pd.DataFrame]" = WeakKeyDictionary()


def held_out_loads(comparison: Comparison) -> pd.DataFrame:
    """Return the predicted load of each held-out transition, and whether the observed one fits.

    Parameters
    ----------
    comparison : Comparison
        Fits and their table.

    Returns
    -------
    pandas.DataFrame
        As `comparison.bands.loads_table`, simulation bands of held-out rows only, with columns
        ``inside``, and ``prior_alone`` where the power law has no K for the texture. Empty if no
        transition was held out, or no form has a probability.
    """
    if comparison not in _known:
        held_out = comparison.table.held_out
        loads = pd.DataFrame()
        # Without a usable evidence there are no weights to average the forms with.
        weighed = bool(comparison.probabilities)
        if weighed and len(held_out) and (held_out.column("kind") == "transition").any():
            loads = loads_table(replace(comparison, table=held_out))
            loads = loads[loads["kind_of_band"] == "simulation"].reset_index(drop=True)
            observed = loads["p_over_E_observed"]
            loads["prior_alone"] = (loads["form"] == "power-law") & ~_has_k(comparison, loads)
            loads["inside"] = observed.between(loads["p_over_E_lower"], loads["p_over_E_upper"])
        _known[comparison] = loads
    return _known[comparison].copy()


def _has_k(comparison: Comparison, loads: pd.DataFrame) -> "pd.Series[bool]":
    power_law = comparison.fits.get("power-law")
    known = set(power_law.model.data.textures) if power_law is not None else set()
    pairs = zip(loads["a_over_R"], loads["b_over_R"], strict=True)
    return pd.Series([pair in known for pair in pairs], index=loads.index)

# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Names of forms and parameters in running text."""

_FORMS = {
    "classic": "Classic",
    "power-law": "Power law",
    "modified": "Modified",
    "hybrid": "Hybrid",
    "half-plane": "Half-plane",
    "average": "Average of forms",
}
_STRUCTURES = {
    "iid": "independent rows",
    "texture": "texture offsets",
    "step": "step offsets",
    "texture+step": "texture and step offsets",
    "step-smooth": "an offset smooth in log h and a/pitch",
}
_PARAMETERS = {
    "c1": "c₁",
    "c2": "c₂",
    "sigma": "σ",
    "tau_texture": "τ texture",
    "tau_step": "τ step",
    "length_h": "ℓ of log h",
    "length_ratio": "ℓ of a/pitch",
    "df": "ν of t",
}


def form_name(name: str) -> str:
    """Return a form's name for a reader.

    Examples
    --------
    >>> form_name("power-law")
    'Power law'
    """
    return _FORMS.get(name, name)


def parameter_name(name: str) -> str:
    """Return a parameter's symbol for a reader.

    Examples
    --------
    >>> parameter_name("c2"), parameter_name("K[fine]")
    ('c₂', 'K of fine')
    """
    if name.startswith("K["):
        return f"K of {name[2:-1]}"
    return _PARAMETERS.get(name, name)


def noise_name(name: str) -> str:
    """Return an error model in words.

    Examples
    --------
    >>> noise_name("texture+step:student")
    'texture and step offsets, Student errors'
    """
    structure, _, tail = name.partition(":")
    return f"{_STRUCTURES.get(structure, structure)}, {tail.capitalize() or 'normal'} errors"


def said(words: str) -> str:
    """Return a reading such as 'strong for hybrid' with the forms named for a reader."""
    for name, title in _FORMS.items():
        words = words.replace(f" for {name} ", f" for {title} ")
    return words

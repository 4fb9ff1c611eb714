"""Contact forms: the number of proximal edges at a load, and the load at each transition.

Notation: s = sqrt(p/E) at nu = 0.5, A = a/R, B = b/R, L = A + B, and h = Q/2 - 1 is the number of
ridge pairs beyond the first. F_k is the half-plane's (p/E)(1 - nu^2) / L^2 at transition k. In
every form, s is a known function of texture and count, divided by a rate that has the coefficients:

    s(Q) = shape(Q, a, b) / rate(a, b; theta).

| form       | shape              | rate              | coefficients      |
|------------|--------------------|-------------------|-------------------|
| Classic    | h L + B/2          | c                 | c                 |
| PowerLaw   | Q - 2              | K of the texture  | one K per texture |
| Modified   | h L                | c                 | c                 |
| Hybrid     | h                  | c1/L + c2/A       | c1, c2            |
| HalfPlane  | L sqrt(F_k/0.75)   | c                 | c (theory: 1)     |

This structure makes the likelihood cheap: the coefficients shift the log loads of a texture by one
amount, so that the rows of a texture enter as a number, a mean and a sum of squares.

Poisson's ratio enters through the reduced load (p/E)(1 - nu^2)/0.75, as in half-plane theory. Loads
are computed with +, *, / and sqrt only, whose IEEE rounding does not depend on the size of an
array: `count` at a load that `load` returned is exactly the same Q.
"""

import re

from ridgebayes.errors import InputError
from ridgebayes.model.forms.base import Form
from ridgebayes.model.forms.closed import Classic, Hybrid, Modified
from ridgebayes.model.forms.half_plane import HalfPlane
from ridgebayes.model.forms.power_law import PowerLaw

__all__ = [
    "FORMS",
    "Classic",
    "Form",
    "HalfPlane",
    "Hybrid",
    "Modified",
    "PowerLaw",
    "as_form",
    "form_named",
]

FORMS: dict[str, type[Form]] = {
    form.name: form for form in (Classic, PowerLaw, Modified, Hybrid, HalfPlane)
}


_RESERVED = ("average", "noise")  # in the column `form` of a run, and among the keys of priors


def form_named(name: str) -> Form:
    """Return a form by name, for example ``"hybrid"``.

    Raises
    ------
    InputError
        If no form has this name; the message lists the names.

    Examples
    --------
    >>> form_named("hybrid").parameter_names
    ('c1', 'c2')
    """
    if name not in FORMS:
        raise InputError(f"form {name!r}: unknown; expected one of {', '.join(FORMS)}")
    return FORMS[name]()


def as_form(form: Form | str) -> Form:
    """Return the form, or the form of the given name.

    Raises
    ------
    InputError
        If the argument is neither a form nor the name of a form, or if a form has a name that
        files cannot have, or the name of another form.
    """
    if isinstance(form, Form):
        name = form.name
        is_name = isinstance(name, str) and re.fullmatch(r"\w[\w .+()-]*", name)
        if not is_name or name in _RESERVED or not isinstance(form, FORMS.get(name, Form)):
            raise InputError(
                f"form: expected a name of letters, digits, spaces, and '+-_.()', other than "
                f"{', '.join(_RESERVED)} and the names of other forms, got {name!r}"
            )
        return form
    if isinstance(form, str):
        return form_named(form)
    raise InputError(f"form: expected a form, such as Hybrid(), or its name, got {form!r}")

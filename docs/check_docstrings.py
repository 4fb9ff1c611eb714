"""Check the docstrings of all public names: ``python docs/check_docstrings.py``.

By the rules of numpydoc. Public are the names in `ridgebayes.__all__` and, of classes, the methods
and properties that do not begin with an underscore. Each name itself has an example too, which the
tests run. Exits 1 and lists what is missing.
"""

import inspect
import re
import sys
from collections.abc import Iterator

from numpydoc.validate import validate

import ridgebayes as rb

# Of numpydoc's rules those about content; layout is ruff's business.
PRIVATE_FIELDS = {"_frame"}
CHECKED = {
    "GL08": "no docstring",
    "PR01": "parameters not documented",
    "PR02": "unknown parameters",
    "PR03": "parameters in another order",
    "PR04": "a parameter without a type",
    "PR07": "a parameter without a description",
    "RT01": "no Returns section",
    "RT03": "a return value without a description",
    "YD01": "no Yields section",
}


def documented(owner: type, member: str) -> str:
    """Return where the words of a method stand: in the first class that has any.

    A method that fulfils a documented protocol inherits its words.
    """
    for base in owner.__mro__:
        what = vars(base).get(member)
        if what is not None and getattr(what, "__func__", what).__doc__:
            return f"{base.__module__}.{base.__qualname__}.{member}"
    return f"{owner.__module__}.{owner.__qualname__}.{member}"


def public_names() -> Iterator[tuple[str, bool]]:
    """Yield each public name, and whether it is called with arguments."""
    for name in rb.__all__:
        value = getattr(rb, name)
        if inspect.isclass(value):
            yield f"{value.__module__}.{value.__qualname__}", False
            for member, what in inspect.getmembers(value):
                inherited = not str(getattr(what, "__module__", "")).startswith("ridgebayes")
                if member.startswith("_") or (inspect.isroutine(what) and inherited):
                    continue
                if inspect.isroutine(what):
                    takes = len(inspect.signature(what).parameters) > isinstance(
                        inspect.getattr_static(value, member), type(public_names)
                    )
                    yield documented(value, member), takes
        elif inspect.isroutine(value):
            yield f"{value.__module__}.{value.__qualname__}", True


def problems(name: str, *, takes_arguments: bool) -> list[str]:
    """Return what numpydoc finds wrong with one docstring, a line each."""
    found = []
    for code, text in validate(name)["errors"]:
        # What takes no argument and says in one line what it returns needs no section for it;
        # a field that begins with an underscore is nobody's to give.
        if code == "PR01" and set(re.findall(r"'(\w+)'", text)) <= PRIVATE_FIELDS:
            continue
        if code in CHECKED and (takes_arguments or code == "GL08" or code.startswith("PR")):
            found.append(f"{name}: {code} {text}")
        if code == "EX01" and name.rpartition(".")[2] in rb.__all__:
            found.append(f"{name}: {code} {text}")
    return found


def main() -> None:
    """Check all and say what is missing."""
    found = sorted(
        {line for name, takes in public_names() for line in problems(name, takes_arguments=takes)}
    )
    print("\n".join(found) or f"docstrings of {len(set(public_names()))} public names are complete")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()

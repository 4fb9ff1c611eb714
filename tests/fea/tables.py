"""Tables in files, imported as the command does."""

import json

from ridgebayes.fea.given import Given
from ridgebayes.fea.read import import_files

TYPED = ("R", "E", "nu", "thickness", "load_se")


def imported(path, mapping=None, values=None, **options):
    """Import a table; constants that are no options stand in a map beside it."""
    values = {key: str(value) for key, value in (values or {}).items()}
    options |= {key: values.pop(key) for key in TYPED if key in values}
    texts = [f"{key}={header}" for key, header in (mapping or {}).items()]
    if values:
        file = path.with_name("map.toml")
        lines = (f"{key} = {json.dumps(value)}" for key, value in values.items())
        file.write_text("\n".join(["[values]", *lines]))
        texts.append(str(file))
    return import_files([path], Given(map=tuple(texts), **options))

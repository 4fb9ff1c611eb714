"""Tables in files, imported as the command does."""

import json

from ridgebayes.fea.read import import_files
from ridgebayes.fea.record import Given


def imported(path, mapping=None, **facts):
    """Import a table; constants that are no options stand in a map beside it."""
    texts = [f"{key}={header}" for key, header in (mapping or {}).items()]
    values = {key: facts.pop(key) for key in [*facts] if not hasattr(Given, key)}
    if values:
        file = path.with_name("map.toml")
        lines = (f"{key} = {json.dumps(value)}" for key, value in values.items())
        file.write_text("\n".join(["[values]", *lines]))
        texts.append(str(file))
    return import_files([path], Given(map=tuple(texts), **facts))

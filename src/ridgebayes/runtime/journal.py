"""Finished parts of long work on disk, so that a killed sweep goes on where it was.

One JSON file for each part, written whole or not at all, under the digest of all that decides its
content. Python writes floats so that they come back the same to the last bit.
"""

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

from ridgebayes.runtime.atomic import cannot_write, write_text


class Journal:
    """A folder of finished parts.

    Parameters
    ----------
    folder : Path
        Made when the first part is kept.

    Attributes
    ----------
    n_found, n_kept, n_damaged : int
        Parts that were there, that were added, and that were there but cannot be trusted.

    Notes
    -----
    A damaged part counts as missing, so that it is computed again: files are renamed into place,
    not forced to the disk, and a machine that loses power may leave empty ones.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     journal = Journal(Path(folder, "sweep"))
    ...     journal.keep({"load": 0.1}, [1, 2])
    ...     journal.find({"load": 0.1}), journal.find({"load": 0.2})
    ([1, 2], None)
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.n_found = self.n_kept = self.n_damaged = 0

    def exists(self) -> bool:
        """Return whether anything was kept."""
        return self.folder.is_dir()

    def find(self, key: dict[str, Any]) -> Any | None:
        """Return what was kept of a part, or None.

        Parameters
        ----------
        key : dict
            All that decides the part's content, in values that JSON has.
        """
        try:
            content = json.loads(self._path(key).read_text(encoding="utf-8"))
            kept = content["found"]
            sound = content["given"] == key and content["sha256"] == _digest(kept)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError):
            sound, kept = False, None
        self.n_found += sound
        self.n_damaged += not sound
        return kept if sound else None

    def keep(self, key: dict[str, Any], part: Any) -> None:
        """Write a finished part.

        Parameters
        ----------
        key : dict
            As in `find`.
        part : object
            Its content, in values that JSON has.

        Raises
        ------
        InputError
            If there is no folder to make the journal's in.
        OutputError
            If it cannot be written, such as on a full disk.
        """
        content = {"given": key, "found": part, "sha256": _digest(part)}
        path = self._path(key)
        try:
            self.folder.mkdir(exist_ok=True)
        except OSError as error:
            raise cannot_write(path, error) from None
        write_text(json.dumps(content) + "\n", path)
        self.n_kept += 1

    def remove(self) -> None:
        """Remove the folder, with all that is in it."""
        if self.exists():
            shutil.rmtree(self.folder)

    def _path(self, key: dict[str, Any]) -> Path:
        return self.folder / f"{_digest(key)}.json"


def _digest(content: Any) -> str:
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()

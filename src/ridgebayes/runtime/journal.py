"""Journal of finished parts of long work, so that a killed sweep can be resumed.

Each part is a JSON file, written atomically. Its name is the digest of everything that determines
its content. Python writes floats so that they are read back exactly.
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
        Folder, created when the first part is kept.

    Attributes
    ----------
    n_found, n_kept, n_damaged : int
        Number of parts that were found, added, and found to be damaged.

    Notes
    -----
    A damaged part counts as missing and is computed again. Files are renamed into place without
    forcing them to the disk, so a power failure may leave empty files.

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
        """Return whether any part was kept."""
        return self.folder.is_dir()

    def find(self, key: dict[str, Any]) -> Any | None:
        """Return the content of a part, or None if it is missing or damaged.

        Parameters
        ----------
        key : dict
            Everything that determines the part's content, as values of JSON.
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
            Key, see `find`.
        part : object
            Content, as values of JSON.

        Raises
        ------
        InputError
            If the parent folder does not exist.
        OutputError
            If the file cannot be written, for instance because the disk is full.
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
        """Remove the folder and its content."""
        if self.exists():
            shutil.rmtree(self.folder)

    def _path(self, key: dict[str, Any]) -> Path:
        return self.folder / f"{_digest(key)}.json"


def _digest(content: Any) -> str:
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()
